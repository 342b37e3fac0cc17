"""`openswim irradiance`: light on the ground through time, and beside what a station has measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from openswim.cli.options import check_plot, tell_notes
from openswim.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from openswim.stations import Series
    from openswim.stations.aeronet import Sunphotometer

_LOWEST_SUN_DEG = 15.0
_SAME_TIME_S = 1.0  # that clocks of loggers are off
_MOST_TIMES = 600_000  # a year of minutes, which is a quarter of an hour of work


@dataclass(frozen=True)
class IrradianceRequest:
    """The options of `openswim irradiance`; None: not given."""

    files: tuple[Path, ...] = ()
    output: Path | None = None
    clear: bool = False
    lat: float | None = None
    lon: float | None = None
    height_m: float = 2.0
    ground_m: float | None = None
    start: str | None = None
    end: str | None = None
    every: str | None = None
    planes: tuple[str, ...] = ()
    wavelengths: str | None = None
    vapour_cm: float | None = None
    aeronet: tuple[Path, ...] = ()
    aod: float | None = None
    albedo: float | None = None
    station: Path | None = None
    fit: str | None = None
    plot: Path | None = None
    member: int | None = None
    solver: str = "fast"


def run(request: IrradianceRequest) -> None:
    """Compute, print what is worth knowing, write."""
    from openswim.scene.files import check_targets

    if request.clear == bool(request.files):
        raise UserError("give a model's FILES, or --clear for a clear sky")
    if request.clear and request.member is not None:
        raise UserError("--member belongs to a model's FILES; leave it out with --clear")
    if request.output is None and request.plot is None and request.station is None:
        raise UserError("--output missing: give -o irradiance.nc (or .csv)")
    if request.output is not None and request.output.suffix.lower() not in (".nc", ".csv"):
        raise UserError(f"output {request.output}: suffix {request.output.suffix!r} is unknown; use .nc or .csv")
    inputs = [*request.files, *request.aeronet, *([request.station] if request.station else [])]
    check_targets([("output", request.output), ("--plot", request.plot)], inputs)
    if request.station is None and (request.plot or request.fit):
        raise UserError("--plot and --fit need a --station to be compared with")
    if not request.clear and (request.fit or request.aeronet or request.aod is not None or request.albedo is not None):
        raise UserError("--fit, --aod, --aeronet and --albedo are of a clear sky: leave them out with a model's FILES")
    if request.aeronet and request.aod is not None:
        raise UserError("give --aeronet or --aod")
    if request.plot is not None:
        check_plot(request.plot, "stations")
    if request.station is None:
        _save(_alone(request), request)
        return
    model, station, clear = _beside_station(request)
    _save(model, request)
    if request.plot is not None:
        from openswim.stations.comparison import plot

        plot(model, station, request.plot, clear)


def _save(model: xr.Dataset, request: IrradianceRequest) -> None:
    if request.output is not None:
        _write(model, request.output)
        click.echo(f"{request.output}: {model.sizes['time']} times, {model.attrs['solves']} solves")


def _alone(request: IrradianceRequest) -> xr.Dataset:
    import numpy as np

    import openswim
    from openswim.films.whereabouts import told_of_times
    from openswim.scene import Scene
    from openswim.scene.atmosphere import AerosolProfile, Atmosphere
    from openswim.stations import Series

    found = _aeronet(request)
    column = {} if found is None else found.single
    lat = column.get("latitude") if request.lat is None else request.lat
    lon = column.get("longitude") if request.lon is None else request.lon
    if lat is None or lon is None:
        raise UserError("place missing: give --lat and --lon in degrees")
    scene: Any
    if request.clear:
        ground = column.get("height_m", 0.0) if request.ground_m is None else request.ground_m
        if found is None:
            aerosol = AerosolProfile(0.05 if request.aod is None else request.aod, base_height_m=ground)
        else:
            aerosol = found.aerosol(ground)
        scene = Scene.clear(
            lat, lon, Atmosphere.us_standard(column.get("ozone_du", 300.0), aerosol),
            0.2 if request.albedo is None else request.albedo, ground,
            water_vapour_cm=column.get("water_vapour_cm"),
        )  # fmt: skip
        times = _times(request, None)
    else:
        scene = Series.open(request.files, around=(lat, lon), member=request.member)
        own = scene.times if scene.times.size > 1 else np.array([scene.scene(0).time], "datetime64[ms]")
        times = _times(request, None if np.isnat(own).any() else own)
        _tell(scene, lat, lon, times, request)
        tell_notes(filter(None, [told_of_times(own, list(times))]))
    return openswim.irradiance(scene, lat, lon, times, **_options(request))


def _tell(series: Series, lat: float, lon: float, times: np.ndarray, request: IrradianceRequest) -> None:
    """What the scenes lack, and what their light will take."""
    from openswim.cli.estimate import Pictured, estimate
    from openswim.lights import sun_position
    from openswim.stations.through_time import WAVELENGTHS_NM, solves

    count = solves(series, lat, lon, times)
    scene = series.scene(next(number for number, _ in series.weights(times)))
    tell_notes(scene.notes)
    wavelengths = _options(request).get("wavelengths_nm", WAVELENGTHS_NM)
    sun = sun_position(times[times.size // 2], lat, lon)  # over the place that is asked for: a flat scene may have none
    one = estimate(
        scene, Pictured((8, 8), request.height_m), request.solver, wavelengths,
        sun_deg=sun.lit_altitude_deg,
    )  # fmt: skip
    click.echo(f"light is solved {count} time{'s' if count > 1 else ''}, each: {one}", err=True)


def _aeronet(request: IrradianceRequest) -> Sunphotometer | None:
    """What the files of AERONET say of the times asked for, or of all that they have; told in a line."""
    if not request.aeronet:
        return None
    from openswim.stations.aeronet import read_aeronet

    found = read_aeronet(list(request.aeronet), request.start, None if request.start is None else request.end)
    tell_notes(found.notes)
    lacking = "" if found.albedo else "; its single-scattering albedo is not in them: .95"
    click.echo(f"aerosol by AERONET: optical depth {found.depth_at(550.0):.3f} at 550 nm{lacking}", err=True)
    return found


def _options(request: IrradianceRequest) -> dict[str, Any]:
    options: dict[str, Any] = {"solver": request.solver, "height_m": request.height_m}
    if request.planes:
        options["planes"] = [_numbers("--plane", text, 2) for text in request.planes]
    if request.wavelengths is not None:
        options["wavelengths_nm"] = _numbers("--wavelengths", request.wavelengths, None)
    if request.vapour_cm is not None:
        options["water_vapour_cm"] = request.vapour_cm
    return options


def _numbers(option: str, text: str, count: int | None) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or count not in (None, len(found)):
        raise UserError(f"{option} {text}: give {count or 'some'} numbers divided by commas")
    return found


def _times(request: IrradianceRequest, model: np.ndarray | None) -> np.ndarray:
    """From --start to --end, or from the model's first time to its last, each of them without --every."""
    import numpy as np

    from openswim.scene.times import interval_s, parse_time

    if request.start is None:
        if model is None or request.end is not None:
            raise UserError("times missing: give --start, and --end with --every, in UTC")
        if request.every is None:
            return model
        start, end = model[0], model[-1]
    else:
        start = parse_time(request.start)
        end = start if request.end is None else parse_time(request.end)
    assert start is not None
    assert end is not None
    step = np.timedelta64(round(1e3 * interval_s("--every", request.every or "1min")), "ms")
    if end < start:
        raise UserError(f"--start {request.start} --end {request.end}: give an end after the start")
    count = int((end - start) / step) + 1
    if count > _MOST_TIMES:
        told = f"{count} times from {start} to {end}"
        raise UserError(f"--every {request.every or '1min'}: {told}; {_MOST_TIMES} are the most: choose longer steps")
    return start + step * np.arange(count)


def _beside_station(request: IrradianceRequest) -> tuple[xr.Dataset, xr.Dataset, np.ndarray | None]:
    """The model and the station at the same times, and which of these had a clear sky."""
    import openswim
    from openswim.stations import Series
    from openswim.stations.checks import check_clock, checked, sun_of
    from openswim.stations.files import read_station

    assert request.station is not None
    station = read_station(request.station, request.lat, request.lon, request.ground_m)
    if "note" in station.attrs:
        click.echo(f"note: {request.station}: {station.attrs['note']}", err=True)
    station = _within(request, station)
    try:
        check_clock(station)
    except UserError as error:
        raise UserError(f"{request.station}: {error}") from None
    station, failed = checked(station)
    _tell_checks(failed, station.sizes["time"])
    if request.clear:
        return _clear_beside(request, station)
    lat, lon = station.attrs["latitude"], station.attrs["longitude"]
    scenes = Series.open(request.files, around=(lat, lon), member=request.member)
    station = station.isel(time=_thinned(request, station))
    if scenes.times.size > 1:
        station = station.sel(time=slice(scenes.times[0], scenes.times[-1]))
    if not station.sizes["time"]:
        raise UserError(f"{request.station}: no values within the model's times")
    _tell(scenes, lat, lon, station.time.values, request)
    model = openswim.irradiance(scenes, lat, lon, station.time.values, **_options(request))
    up = sun_of(station).refracted_altitude_deg > 0
    if up.any():
        _print(model, station, up, "sun above the horizon")
    else:
        click.echo(f"note: {request.station}: the sun is down at all times: nothing to compare", err=True)
    return model, station, None


def _clear_beside(request: IrradianceRequest, station: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset, np.ndarray]:
    """Under a clear sky. Whether it was clear is told by all that was measured, before times are left out."""
    import numpy as np

    import openswim
    from openswim.stations.checks import sun_of
    from openswim.stations.clear_day import fit_aerosol, scene_over
    from openswim.stations.clear_sky import WINDOW_MINUTES, clear_times, minutes_apart

    place, options = (station.attrs["latitude"], station.attrs["longitude"]), _options(request)
    found = _aeronet(request)
    column = {} if found is None else found.single
    aerosol = None if found is None else found.aerosol(station.attrs["height_m"])
    scene = scene_over(station, aerosol, column.get("ozone_du", 300.0), request.albedo)
    if "water_vapour_cm" in column and request.vapour_cm is None:
        options["water_vapour_cm"] = column["water_vapour_cm"]
    assert scene.atmosphere is not None
    if request.aod is not None:
        scene = replace(scene, atmosphere=scene.atmosphere.with_aerosol_depth(request.aod))
    model = openswim.irradiance(scene, *place, station.time.values, **options)
    measured = {name: station[name].values for name in ("ghi", "dni", "dhi") if name in station}
    clear = clear_times(station.time.values, measured, {name: model[name].values for name in measured})
    kept, apart = _thinned(request, station), minutes_apart(station.time.values)
    station, model, clear = station.isel(time=kept), model.isel(time=kept), clear[kept]
    high = sun_of(station).refracted_altitude_deg > _LOWEST_SUN_DEG
    clear &= high
    click.echo(f"clear sky at {clear.sum()} of {high.sum()} times with the sun above {_LOWEST_SUN_DEG:g} degrees")
    if not clear.any():
        what = "nothing to compare with a clear sky"
        if apart > WINDOW_MINUTES / 2:
            what = f"its values are {apart:g} minutes apart: that it is steady is told by several within ten; {what}"
        what = f"{request.station}: clear sky at no time: {what}"
        if request.fit is not None or (request.output is None and request.plot is None):
            raise UserError(f"{what}: give a model's FILES for --clear")
        click.echo(f"note: {what}; what is written is the clear sky's", err=True)
        return model, station, clear
    told = clear
    if request.fit is not None:
        used = clear.copy()
        if request.fit != "beam":
            rank = np.cumsum(clear) - 1
            used &= (rank < clear.sum() // 2) == (request.fit == "first-half")
            told = clear & ~used
        fit = fit_aerosol(station, used, scene)
        click.echo(f"aerosol optical depth at 550 nm by {fit.times} values of DNI: {fit.optical_depth:.3f}")
        assert scene.atmosphere is not None
        scene = replace(scene, atmosphere=scene.atmosphere.with_aerosol_depth(fit.optical_depth))
        model = openswim.irradiance(scene, *place, station.time.values, **options)
    _print(model, station, told, "clear" if told is clear else "clear, not used for the fit")
    return model, station, clear


def _tell_checks(failed: dict[str, int], count: int) -> None:
    """What the tests of Long and Dutton (2002) found."""
    words = {
        "impossible": "left out, being impossible", "rare": "beyond what is rare, and kept",
        "disagree": "where global and its parts disagree, and kept",
    }  # fmt: skip
    for name, number in failed.items():
        what, _, test = name.partition("_")
        if number:
            click.echo(f"{what}: {number} of {count} values {words[test]} (Long and Dutton 2002)", err=True)


def _within(request: IrradianceRequest, station: xr.Dataset) -> xr.Dataset:
    """From --start to --end."""
    from openswim.scene.times import parse_time

    found = station.sel(time=slice(parse_time(request.start), parse_time(request.end)))
    if not found.sizes["time"]:
        raise UserError(f"{request.station}: no values between --start and --end")
    return found


def _thinned(request: IrradianceRequest, station: xr.Dataset) -> np.ndarray:
    """Which of the station's times --every leaves: the first of each step, counted from the first time."""
    import numpy as np

    from openswim.scene.times import interval_s

    if request.every is None:
        return np.arange(station.sizes["time"])
    since_s = (station.time.values - station.time.values[0]) / np.timedelta64(1, "s")
    steps = np.floor((since_s + _SAME_TIME_S) / interval_s("--every", request.every))
    return np.unique(steps, return_index=True)[1]


def _print(model: xr.Dataset, station: xr.Dataset, rows: np.ndarray, which: str) -> None:
    from openswim.stations.comparison import differences

    click.echo(f"{'model - measured':18}{'bias':>8}{'RMSE':>8}{'mean':>8}  W/m2   ({which})")
    for name, one in differences(model, station, rows).items():
        share = 100 * one.bias / one.mean if one.mean else float("nan")
        click.echo(f"{name:18}{one.bias:+8.1f}{one.rmse:8.1f}{one.mean:8.1f}  {share:+6.1f} %   n = {one.n}")


def _write(model: xr.Dataset, path: Path) -> None:
    from openswim.scene.cf import save_netcdf
    from openswim.scene.files import written_whole

    if path.suffix.lower() == ".nc":
        save_netcdf(model, path)
        return
    import numpy as np

    columns: dict[str, Any] = {}
    for name in map(str, model.data_vars):
        values = model[name]
        if "wavelength" in values.dims:
            for wavelength in model.wavelength.values:
                columns[f"{name}_{wavelength:g}nm"] = values.sel(wavelength=wavelength).values
        elif "plane" in values.dims:
            for plane in range(model.sizes["plane"]):
                tilt, azimuth = (float(model[key][plane]) for key in ("plane_tilt", "plane_azimuth"))
                columns[f"{name}_{tilt:g}_{azimuth:g}"] = values.isel(plane=plane).values
        else:
            columns[name] = values.values
    whole = bool((model.time.values == model.time.values.astype("datetime64[s]")).all())
    times = np.datetime_as_string(model.time.values, "s" if whole else "ms")
    with written_whole(path) as partial, partial.open("w", encoding="utf-8") as file:
        file.write(",".join(["utc", *columns]) + "\n")
        for row, time in enumerate(times):
            file.write(",".join([f"{time}Z", *(f"{column[row]:.6g}" for column in columns.values())]) + "\n")
