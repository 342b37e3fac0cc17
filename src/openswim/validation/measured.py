"""Measured irradiance: clear moments of stations' days, against the clear sky over the station."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import openswim
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.stations.checks import checked, sun_of
from openswim.stations.clear_day import fit_aerosol, scene_over
from openswim.stations.clear_sky import clear_times
from openswim.stations.files import kind_of, read_station
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import score
from openswim.validation.reference.phases import PhaseTables

QUANTITIES = ("ghi", "dni", "dhi")
_LOWEST_SUN_DEG = 15.0
_MOST_TIMES = 150  # of a day
_FEWEST = 10  # clear times that a row needs
_FOR_FIT = 30


def matches(reference: Reference) -> bool:
    kind = kind_of(reference.path)
    if kind == "ARM":
        return reference.has("down_short_hemisp")
    return kind is not None and (kind != "table" or {"lat", "lon", "elev_m"} <= set(reference.about))


def compare(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows for GHI and, where measured, DNI and DHI: clear moments with the sun above 15 degrees, day by day.

    Without more in the name the model has its default aerosol (.05 at 550 nm above the station), not the day's; "after
    a fit" stands for an aerosol whose depth was fitted to DNI in the first half of the clear moments, compared in the
    second.
    """
    station, _ = checked(read_station(reference.path))
    days = list(_days(station))
    rows = 0
    for date, day in days:
        for row in _of_day(reference, day, f", {date}" if len(days) > 1 else "", solver):
            rows += 1
            yield row
    if not rows:
        raise UserError(f"clear sky at fewer than {_FEWEST} times: nothing to compare a clear-sky model with")


def _days(station: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Days by the sun, of at most 150 times, with the sun high enough."""
    shift = np.timedelta64(round(240 * station.attrs["longitude"]), "s")
    date = (station.time.values + shift).astype("datetime64[D]")
    high = sun_of(station).refracted_altitude_deg > _LOWEST_SUN_DEG
    for one in np.unique(date):
        rows = np.flatnonzero((date == one) & high)
        if rows.size >= _FEWEST:
            yield str(one), station.isel(time=rows[:: max(1, rows.size // _MOST_TIMES)])


def _of_day(reference: Reference, day: xr.Dataset, name: str, solver: Solver) -> Iterator[Row]:
    watch = Stopwatch()
    scene = scene_over(day)
    with watch.running():
        model = _model(scene, day, solver)
    measured = {each: day[each].values for each in QUANTITIES if each in day}
    clear = clear_times(day.time.values, measured, {each: model[each].values for each in measured})
    if clear.sum() < _FEWEST:
        return
    yield from _rows(reference, solver, model, day, clear, f"clear sky{name}", watch)
    if "dni" not in measured or clear.sum() < _FOR_FIT:
        return
    first = clear & (np.cumsum(clear) <= clear.sum() // 2)
    with watch.running():
        found = fit_aerosol(day, first, scene)
        assert scene.atmosphere is not None
        fitted = dataclasses.replace(scene, atmosphere=scene.atmosphere.with_aerosol_depth(found.optical_depth))
        model = _model(fitted, day, solver)
    yield from _rows(reference, solver, model, day, clear & ~first, f"after a fit{name}", watch)


def _model(scene: Scene, day: xr.Dataset, solver: Solver) -> xr.Dataset:
    if not isinstance(solver, openswim.Solver):
        raise UserError(f"solver {solver.name} has no irradiance")
    return openswim.irradiance(scene, *scene.place, day.time.values, solver=solver)


def _rows(
    reference: Reference, solver: Solver, model: xr.Dataset, day: xr.Dataset, used: NDArray[np.bool_], name: str,
    watch: Stopwatch,
) -> Iterator[Row]:  # fmt: skip
    present = [each for each in QUANTITIES if each in day]
    cpu = watch.lap() / len(present)
    for each in present:
        found = score(model[each].values[used], day[each].values[used])
        yield reference.row(solver.name, f"{each.upper()}, {name}", found, cpu)

