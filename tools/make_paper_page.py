"""Make the pictures of docs/paper.md: figures of Albers et al. (2020), or the like of them from other data.

    python tools/make_paper_page.py                         those that need no data but our own (Figure 4)
    python tools/make_paper_page.py ../shared/data [name ...]    the others too; names as in FIGURES
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.dates import DateFormatter

import openswim
from openswim import Camera, Solver, open_scene, render
from openswim.colour import save
from openswim.optics.aerosol import aerosol_type
from openswim.optics.choosing import only as alone
from openswim.readers.domain.neighbourhood import Neighbourhood, reach_m
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.procedural import demo_scene

TARGET = Path(__file__).parents[1] / "docs/images"
LAT, LON, SUN = 40.0, -105.3, (180.0, 40.0)
TYPES = {"colorado_dust": "Colorado dust", "saudi_dust_pollution": "Saudi dust and pollution"}
SMOKE, SPECIES = "hrrr2d/hrrr_20260301t00z_MASSDEN_8m.grib2", "gefs.chem.20240309t00z.a2d_0p25.f000.subset.grib2"
GULF, GLOBE = "wrfout_katrina_2005-08-28.nc", "gfs_2011-10-08_f072.grib1"


def panorama(name: str) -> xr.Dataset:
    """Figure 4a and b: an aerosol of optical depth .1 alone in the air, all round."""
    air = Atmosphere.us_standard(aerosol=openswim.optics.aerosol_profile(name, 0.1))
    scene = Scene.clear(LAT, LON, air)
    camera = Camera.panorama(LAT, LON, size="960x240", altitude_range_deg=(0.0, 90.0))
    return render(scene, camera, sun=SUN)


def phase_functions(path: Path) -> None:
    """Figure 4c: both at 615, 546 and 450 nm."""
    angle = np.concatenate([np.geomspace(0.3, 10, 80), np.linspace(10, 180, 120)])
    figure, axes = plt.subplots(figsize=(7.2, 4.2), layout="constrained")
    for (name, label), dash in zip(TYPES.items(), ("-", "--"), strict=True):
        phase = aerosol_type(name).phase
        for wavelength, colour in ((615.0, "#c0392b"), (546.0, "#2e8b57"), (450.0, "#2c5aa0")):
            each = phase[wavelength] if isinstance(phase, dict) else phase
            value = each.value(np.cos(np.radians(angle)))
            axes.semilogy(angle, value, dash, color=colour, label=f"{label}, {wavelength:.0f} nm")
    axes.set(xlabel="scattering angle (degrees)", ylabel="phase function (mean 1)", xlim=(0, 180))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def irradiance(data: Path, path: Path) -> None:
    """Figure 2: GHI by integrals of all-sky pictures, beside a pyranometer, on a clear morning."""
    from openswim.stations.clear_day import fit_aerosol, scene_over
    from openswim.stations.files import read_station

    file = data / "sky/irradiance/midc_raw_20181018.txt"
    station = read_station(file, lat=32.23, lon=-110.955, height_m=786.0)  # Tucson
    station = station.sel(time=slice("2018-10-18T14:00", "2018-10-18T18:00"))
    scene = scene_over(station)
    assert scene.atmosphere is not None
    depth = fit_aerosol(station, station.dni.values > 0, scene).optical_depth
    scene = replace(scene, atmosphere=scene.atmosphere.with_aerosol_depth(depth))
    print(f"irradiance: fitted aerosol {depth:.3f}")
    times = station.time.values[::15]
    camera = Camera.allsky(32.23, -110.955, size=96)
    modelled = [float(render(scene, camera, time=t).attrs["global_horizontal_irradiance_w_m2"]) for t in times]
    figure, axes = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
    axes.plot(station.time, station.ghi, color="#2e8b57", label="pyranometer")
    axes.plot(times, modelled, color="#c0392b", label="OpenSWIm, of pictures")
    axes.set(ylabel="GHI (W m$^{-2}$)", xlabel="2018-10-18, UTC", ylim=(0, None))
    axes.xaxis.set_major_formatter(DateFormatter("%H:%M"))
    beside = axes.twinx()
    beside.plot(times, np.array(modelled) - station.ghi.values[::15], "o", color="#2c5aa0", ms=4)
    beside.set(ylabel="difference (W m$^{-2}$)", ylim=(-60, 60))
    beside.axhline(0, color="#2c5aa0", lw=0.5)
    axes.legend(loc="upper left")
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def from_space(path: Path, lat: float, lon: float, height_m: float, light: str, fov_deg: float | None = None,
               *only: str, quality: str = "standard") -> xr.Dataset:  # fmt: skip
    scene = open_scene(path, around=Neighbourhood(lat, lon, reach_m(height_m), if_large=True))
    camera = Camera.satellite(lat, lon, height_m=height_m, size=(400, 400), fov_deg=fov_deg)
    return render(alone(scene, *only) if only else scene, camera, Solver("fast", quality=quality), time=light)


def cloud_and_smoke() -> xr.Dataset:
    """Figure 7: the demo's clouds in smoke, from 4 km."""
    scene = demo_scene(160, 160, 48, spacing_m=150.0)
    assert scene.atmosphere is not None
    smoky = replace(scene, atmosphere=replace(scene.atmosphere, aerosol=openswim.optics.aerosol_profile("smoke", 0.5)))
    camera = Camera.panorama(*scene.place, height_m=4000.0, size="720x240", altitude_range_deg=(-50.0, 40.0))
    return render(smoky, camera, sun=(220.0, 40.0))


def dusty_gulf(data: Path, height_m: float, bottom_deg: float) -> xr.Dataset:
    """Figure 9: clouds of a hurricane's outer bands in desert dust over a gulf, from 4 km and from 20 m."""
    lat, lon, when = 25.3, -89.6, "2005-08-28T18:00"
    scene = open_scene(data / "nwp" / GULF, time=when, around=Neighbourhood(lat, lon, reach_m(height_m), if_large=True))
    assert scene.atmosphere is not None
    dust = openswim.optics.aerosol_profile("saudi_dust_pollution", 0.4)
    dusty = replace(scene, atmosphere=replace(scene.atmosphere, aerosol=dust))
    seen_deg = bottom_deg, bottom_deg + 90
    camera = Camera.panorama(lat, lon, height_m=height_m, size="720x240", altitude_range_deg=seen_deg)
    return render(dusty, camera, time="2005-08-28T21:00")


FIGURES: dict[str, Callable[[Path], xr.Dataset]] = {
    "smoke": lambda data: from_space(data / "nwp" / SMOKE, 35.5, -94.0, 4e7, "2026-03-01T20:00", 1.2),
    "aerosol": lambda data: from_space(data / "nwp" / SPECIES, 10.0, 25.0, 1.5e9, "2024-03-09T10:00", None, "aerosol"),
    "smoke_and_cloud": lambda data: cloud_and_smoke(),
    "dust_4_km": lambda data: dusty_gulf(data, 4000.0, -60.0),
    "dust_20_m": lambda data: dusty_gulf(data, 20.0, -15.0),
    "globe": lambda data: from_space(data / "nwp" / GLOBE, -7.0, -95.0, 1.5e9, "2011-10-11T18:00", quality="high"),
}


def main(data: Path | None, *names: str) -> None:
    if not names:
        phase_functions(TARGET / "paper_phases.png")
        for name in TYPES:
            save(panorama(name), TARGET / f"paper_{name}.jpg", exposure=1.0, caption="none")
    if data is None:
        return
    if not names or "irradiance" in names:
        irradiance(data, TARGET / "paper_irradiance.png")
    for name, figure in FIGURES.items():
        if not names or name in names:
            save(figure(data), TARGET / f"paper_{name}.jpg", caption="none")
            print(f"paper_{name}.jpg", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None, *sys.argv[2:])
