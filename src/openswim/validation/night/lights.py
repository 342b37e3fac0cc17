"""How bright moon, zodiacal light, Milky Way and airglow are, and how the air bends rays, against tables."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.colour.cie import standard_observer
from openswim.heavens.bent_rays import bent_rays
from openswim.lights.airglow import LAYER_M, RED_LAYER_M, airglow_radiance, airglow_zenith
from openswim.lights.milky_way import starlight_s10
from openswim.lights.moonlight import MEAN_SOLID_ANGLE_SR, disc_reflectance
from openswim.lights.spectrum import solar_irradiance
from openswim.lights.zodiacal import zodiacal_s10
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, groups
from openswim.validation.reference.metrics import in_marks, score
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]


def is_moonlight_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("source", "phase_angle_deg", "disk_reflectance", "value")


def compare_moonlight(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row per source: irradiance and illuminance at 1 au and 384 400 km, of LIME between 5 and 95 degrees of phase
    angle, of Miller & Turner from 95 to 150."""
    source, quantity = (reference.column(name).astype(str) for name in ("source", "quantity"))
    phase = reference.column("phase_angle_deg").astype(float)
    for name, low, high in (("LIME", 5, 95), ("ROLO", 5, 95), ("Miller", 95.1, 150)):
        watch = Stopwatch()
        rows = [n for n in range(len(source)) if source[n].startswith(name) and low <= phase[n] <= high
                and quantity[n] != "V magnitude"]  # fmt: skip
        with watch.running():
            found = [_moonlight(reference, n, quantity[n]) for n in rows]
        true = reference.column("value").astype(float)[rows]
        off = score(np.array(found) / true, np.ones(len(rows)))
        yield reference.row("lights", f"moonlight over {name}'s, {low:.0f}-{high} degrees", off, watch.lap())


def _moonlight(reference: Reference, n: int, quantity: str) -> float:
    phase = float(reference.column("phase_angle_deg")[n])
    branch = {"waxing": phase, "waning": -phase}.get(str(reference.column("branch")[n]), 0.0)
    scale = MEAN_SOLID_ANGLE_SR / np.pi
    if quantity != "illuminance":
        wl = float(reference.column("wavelength_nm")[n])
        return float(disc_reflectance(wl, phase, subsolar_lon_deg=branch) * solar_irradiance(wl) * scale)
    nodes, matching = standard_observer()
    spectrum = disc_reflectance(nodes, phase, subsolar_lon_deg=branch) * solar_irradiance(nodes, 5.0) * scale
    return float(683.002 * (spectrum * matching[:, 1]).sum() * (nodes[1] - nodes[0]))


def is_zodiacal_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("sun_relative_ecliptic_longitude_deg", "ecliptic_latitude_deg", "S10")


def compare_zodiacal(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    watch = Stopwatch()
    with watch.running():
        found = zodiacal_s10(
            *(reference.column(n) for n in ("sun_relative_ecliptic_longitude_deg", "ecliptic_latitude_deg"))
        )
    off = in_marks(found / reference.column("S10") - 1, 0.05)
    yield reference.row("lights", "zodiacal light, in marks of 5 %", off, watch.lap())


def is_milky_way_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("l_centre_deg", "b_centre_deg", "S10_V_fainter_than_6p5")


def compare_milky_way(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Means of cells of ten degrees."""
    watch = Stopwatch()
    ticks = np.arange(-4.75, 5, 0.5)
    with watch.running():
        found = []
        for lon_deg, lat_deg in zip(reference.column("l_centre_deg"), reference.column("b_centre_deg"), strict=True):
            lat, lon = np.meshgrid(lat_deg + ticks, lon_deg + ticks, indexing="ij")
            found.append(np.average(starlight_s10(lon, lat), weights=np.cos(np.radians(lat))))
    off = in_marks(np.array(found) / reference.column("S10_V_fainter_than_6p5") - 1, 0.30)
    yield reference.row("lights", "Milky Way, cells of 10 degrees, in marks of 30 %", off, watch.lap())


def is_airglow_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("quantity", "value", "unit") and any(
        str(each).startswith("airglow") for each in reference.column("quantity")
    )


def compare_airglow(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Continuum, solar cycle and van Rhijn's factors."""
    found: dict[str, list[tuple[float, float]]] = {}
    watch = Stopwatch()
    for text, true in zip(reference.column("quantity"), reference.column("value").astype(float), strict=True):
        numbers = [float(each) for each in re.findall(r"\d+(?:\.\d+)?", str(text))]
        with watch.running():
            if str(text).startswith("airglow spectral radiance, median"):
                found.setdefault("continuum", []).append((_continuum(numbers[0]), true))
            elif str(text).startswith("airglow factor"):
                at, usual = (airglow_zenith(550.0, flux)[0] for flux in (numbers[0], 130.0))
                found.setdefault("solar cycle", []).append((float(at / usual), true))
            elif str(text).startswith("van Rhijn") and numbers[0] * 1e3 in (LAYER_M, RED_LAYER_M):
                found.setdefault("van Rhijn's factor", []).append((_van_rhijn(*numbers), true))
    for name, pairs in found.items():
        model, values = np.array(pairs).T
        yield reference.row("lights", f"airglow, {name}", score(model, values), watch.lap())


def _continuum(wavelength_nm: float) -> float:
    """Between the lines."""
    from openswim.lights.airglow import _CONTINUUM, _CONTINUUM_NM

    return float(np.interp(wavelength_nm, _CONTINUUM_NM, _CONTINUUM))


def _van_rhijn(layer_km: float, zenith_deg: float) -> float:
    z = np.radians([zenith_deg, 0.0])
    direction = np.stack([np.sin(z), 0 * z, np.cos(z)], axis=-1)
    line = 636.4 if layer_km * 1e3 == RED_LAYER_M else 450.0
    here = np.array([0.0, 0.0, EARTH_RADIUS_M])
    seen = airglow_radiance(here, direction, [line])[:, 0]
    if layer_km * 1e3 == RED_LAYER_M:  # without the layer below
        low, _ = airglow_zenith([line])
        of_low = airglow_radiance(here, direction, [450.0])[:, 0]
        seen = seen - of_low / of_low[1] * low[0]
    return float(seen[0] / seen[1])


def is_refraction_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("apparent_altitude_deg", "refraction_deg", "airmass_rayleigh")


def compare_refraction(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Refraction in marks, and the three airmasses of the table."""
    air, levels = Atmosphere.us_standard(), np.arange(0.0, 1e5, 100.0)
    pressure, temperature, _ = air.at(levels)
    profiles = {
        "airmass_rayleigh": pressure / temperature,
        "airmass_ozone_gauss_22_5km": np.exp(-0.5 * ((levels - 22e3) / 5e3) ** 2),
        "airmass_aerosol_exp_1p5km": np.exp(-levels / 1.5e3),
    }
    watch = Stopwatch()
    height, wl, apparent = (
        reference.column(n).astype(float) for n in ("observer_height_m", "wavelength_nm", "apparent_altitude_deg")
    )
    lifted, airmass = np.empty(len(height)), {name: np.empty(len(height)) for name in profiles}
    with watch.running():
        for (h, w), rows in groups(height, wl):
            rays = bent_rays(air, [*apparent[rows], 90.0], h, w)
            lifted[rows] = rays.refraction_deg[:-1]
            for name, profile in profiles.items():
                depth: Any = rays.depth(levels, profile)
                airmass[name][rows] = depth[:-1] / depth[-1]
    cpu = watch.lap()
    off = lifted - reference.column("refraction_deg").astype(float)
    for words, some, mark in (("above 2 degrees, in marks of .005", apparent >= 2, 0.005),
                              ("below 2 degrees, in marks of .02", apparent < 2, 0.02)):  # fmt: skip
        yield reference.row("lights", f"refraction {words}", in_marks(off[some], mark), cpu)
    for name, found in airmass.items():
        yield reference.row("lights", name.replace("_", " "), score(found, reference.column(name).astype(float)), cpu)
