"""Modelled beside measured irradiance: bias and RMSE, and a plot of the day as in Fig. 2 of Albers et al. (2020)."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.files import written_whole

NAMES = {"ghi": "global horizontal", "dni": "direct normal", "dhi": "diffuse horizontal"}
_SAME_TIME = np.timedelta64(1, "s")
_COLOURS = {"ghi": "#b03030", "dni": "#c07800", "dhi": "#2060b0"}


class Difference(NamedTuple):
    """Modelled minus measured, W m-2; `mean` is that of the measured values."""

    bias: float
    rmse: float
    mean: float
    n: int


def differences(model: xr.Dataset, station: xr.Dataset, rows: NDArray[np.bool_]) -> dict[str, Difference]:
    """For each of ghi, dni and dhi that was measured, over `rows` (nt,) of the common times; raises UserError where the
    times of the two are not the same."""
    _check_times(model, station, rows)
    found = {}
    for name in NAMES:
        if name not in station:
            continue
        measured, modelled = station[name].values, model[name].values
        use = rows & np.isfinite(measured)
        off = modelled[use] - measured[use]
        if off.size:
            found[name] = Difference(
                float(off.mean()), float(np.sqrt((off**2).mean())), float(measured[use].mean()), int(off.size)
            )
    return found


def _check_times(model: xr.Dataset, station: xr.Dataset, rows: NDArray[np.bool_] | None) -> None:
    """Raise UserError where values that lie side by side are of different times."""
    same = model.time.shape == station.time.shape
    if not (same and (np.abs(model.time.values - station.time.values) < _SAME_TIME).all()):
        raise UserError(f"model and station have different times ({model.sizes['time']} and {station.sizes['time']}): "
                        "compare station.sel(time=model.time), or ask for light at the station's times")  # fmt: skip
    if rows is not None and (np.shape(rows) != model.time.shape or np.asarray(rows).dtype != bool):
        raise UserError(f"rows must be True or False for each of {model.sizes['time']} times")


def plot(model: xr.Dataset, station: xr.Dataset, path: Path, clear: NDArray[np.bool_] | None = None) -> None:
    """Measured (thin) and modelled (thick) irradiance through time, and their difference below (PNG, PDF, SVG)."""
    _check_times(model, station, clear)
    try:
        from matplotlib.dates import ConciseDateFormatter, date2num
        from matplotlib.figure import Figure
    except ImportError as error:
        raise UserError("a plot needs the package matplotlib: pip install 'openswim[stations]'") from error
    figure = Figure(figsize=(9, 7), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    time = date2num(model.time.values)
    for name, text in NAMES.items():
        above.plot(time, model[name].values, color=_COLOURS[name], linewidth=2, label=f"{text}, model")
        if name not in station:
            continue
        measured = station[name].values
        above.plot(time, measured, color=_COLOURS[name], linewidth=0.8, linestyle="--", label=f"{text}, measured")
        off = model[name].values - measured
        shown = np.isfinite(off) if clear is None else clear & np.isfinite(off)
        below.plot(time[shown], off[shown], ".", markersize=3, color=_COLOURS[name])
        if shown.any():
            reach = float(np.abs(off[shown]).max())
            below.set_ylim(*(side * max(reach * 1.1, abs(below.get_ylim()[1]), 5.0) for side in (-1, 1)))
    above.set_ylabel("irradiance (W m$^{-2}$)")
    above.set_ylim(bottom=0)
    figure.legend(fontsize=8, ncols=3, loc="outside lower center")  # beside the curves, not over them
    about = station.attrs
    above.set_title(f"{about.get('source', '')}  {_degrees(about['latitude'], 'NS')} "
                    f"{_degrees(about['longitude'], 'EW')}")  # fmt: skip
    below.axhline(0, color="0.5", linewidth=0.6)
    if not any(np.size(line.get_xdata()) for line in below.lines[:-1]):
        below.set_yticks([])
        below.text(0.5, 0.65, "at no time" if clear is None else "clear sky at no time", transform=below.transAxes,
                   ha="center")  # fmt: skip
    below.set_ylabel(("" if clear is None else "clear sky: ") + "model -\nmeasured (W m$^{-2}$)")
    below.xaxis.axis_date()
    below.xaxis.set_major_formatter(ConciseDateFormatter(below.xaxis.get_major_locator()))
    below.set_xlabel("UTC")
    with written_whole(path) as partial:
        figure.savefig(partial, dpi=120, format=path.suffix[1:].lower())


def _degrees(value: float, sides: str) -> str:
    return f"{abs(value):.3f} {sides[value < 0]}"
