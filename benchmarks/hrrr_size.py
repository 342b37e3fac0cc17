"""A file of HRRR's size with made-up weather, to measure on: `python benchmarks/hrrr_size.py OUT.grib2 [SAMPLE.grib2]`.

The grid is HRRR's (1799 x 1059, Lambert, 3 km; the definition is taken from a real message where one is given), with 50
hybrid levels of pressure, height, temperature, humidity and four species, packed as NCEP packs them. The weather is
fractal noise shaped by hand: a cyclone's front, stratocumulus off California, cumulus, thunderstorms with anvils, and
cirrus. About 230 MB in a minute and a half; never committed.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from numpy.typing import NDArray

F32 = NDArray[np.float32]
NX, NY, NZ, STEP_M = 1799, 1059, 50, 3000.0
TOP_M, GAS, GRAVITY = 25_000.0, 287.05, 9.80665
HRRR = {
    "gridType": "lambert", "shapeOfTheEarth": 6, "Nx": NX, "Ny": NY, "latitudeOfFirstGridPoint": 21138123,
    "longitudeOfFirstGridPoint": 237280472, "resolutionAndComponentFlags": 8, "LaD": 38500000, "LoV": 262500000,
    "Dx": 3000000, "Dy": 3000000, "projectionCentreFlag": 0, "scanningMode": 64, "Latin1": 38500000,
    "Latin2": 38500000, "latitudeOfSouthernPole": 0, "longitudeOfSouthernPole": 0,
}  # fmt: skip
CODES = {
    "pressure": (0, 3, 0, 14), "height": (0, 3, 5, 17), "temperature": (0, 0, 0, 12), "humidity": (0, 1, 0, 12),
    "liquid": (0, 1, 22, 10), "ice": (0, 1, 82, 10), "rain": (0, 1, 24, 10), "snow": (0, 1, 25, 10),
    "land": (2, 0, 0, 1),
}  # fmt: skip


def noise(rng: np.random.Generator, slope: float, largest: float, smallest: float = 0.0, stretch: float = 1.0) -> F32:
    """Fractal noise (NY, NX) of mean 0 and deviation 1: spectrum k^-slope between wavelengths in cells."""
    shape = (1152, 2048)
    ky, kx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None]
    k = np.hypot(kx * stretch, ky)
    amplitude = np.where(k > 1 / largest, np.maximum(k, 1e-9) ** (-slope / 2 - 0.5), 0) * np.exp(-((k * smallest) ** 2))
    phases = np.exp(2j * np.pi * rng.random(k.shape)) * rng.rayleigh(size=k.shape)
    field = np.fft.irfft2(amplitude * phases, shape)[:NY, :NX]
    return ((field - field.mean()) / field.std()).astype(np.float32)


def ramp(x: Any, low: float, high: float) -> Any:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


class Weather:
    """What the made-up clouds are made from, and their contents (kg/kg) at a height."""

    def __init__(self, lat: NDArray[Any], lon: NDArray[Any], land: F32, terrain: F32) -> None:
        rng = np.random.default_rng(20)
        y, x = np.mgrid[0:NY, 0:NX].astype(np.float32)
        self.terrain = terrain
        big, mid, small = noise(rng, 3.2, 700, 4), noise(rng, 2.8, 200, 2.5), noise(rng, 2.4, 60, 2.5)
        self.texture = 0.7 * mid + 0.4 * small
        # all shapes are drawn on a crumpled map
        xw = x + 45 * noise(rng, 3.2, 500, 4) + 16 * noise(rng, 2.8, 120, 3) + 5 * small
        yw = y + 45 * noise(rng, 3.2, 500, 4) + 16 * noise(rng, 2.8, 120, 3) + 5 * mid
        # a cyclone over the Great Lakes: cold front trailing to Texas, comma head, warm front
        away = xw - 1180 + 0.0013 * np.maximum(760 - yw, 0) ** 2
        cold = np.exp(-((away / np.where(away > 0, 75, 22)) ** 2)) * ramp(yw, 180, 330) * (1 - ramp(yw, 740, 800))
        r, angle = np.hypot(xw - 1150, yw - 760), np.arctan2(yw - 760, xw - 1150) % (2 * np.pi)
        head = np.exp(-(((r - 50 - 26 * angle) / 42) ** 2)) * (1 - ramp(angle, 3.6, 5.2))
        warm = np.exp(-(((xw - 1340) / 190) ** 2) - ((yw - 835) / 70) ** 2)
        self.front = ramp(np.maximum(np.maximum(cold, head), warm) + 0.10 * self.texture, 0.25, 0.95)
        self.front_top = 5000 + 4500 * ramp(self.front + 0.15 * mid, 0.2, 1.1)
        # stratocumulus over the cold Pacific, in closed cells that break up toward the south-west
        sea = (1 - ramp(land, 0.2, 0.8)) * (1 - ramp(lon, -125.5, -116.5)) * ramp(lat, 20, 24)
        cells = 1 - np.abs(noise(rng, 1.2, 20, 3.5))
        self.deck = ramp(0.55 * cells + 0.45 * big + 0.25 * mid + 0.75, 0.0, 1.6) * sea
        # cumulus by day over the humid south-east
        humid = ramp(lon, -102, -92) * (1 - ramp(lat, 36, 41)) * land
        grown = 0.8 * noise(rng, 1.0, 14, 3.0) + 0.5 * mid + 0.3 * big - 1.5 + 0.7 * humid
        self.cumulus = ramp(grown, 0.0, 1.6) * (0.25 + 0.75 * humid) * (1 - ramp(self.front, 0, 0.3))
        # thunderstorms: a line ahead of the cold front, clusters elsewhere, anvils blown to the east-north-east
        self.core, self.anvil = np.zeros((NY, NX), np.float32), np.zeros((NY, NX), np.float32)
        groups = [(900, 330, 120, 60), (1350, 130, 150, 50), (560, 330, 90, 110), (1500, 420, 60, 80)]
        for n in range(90):
            if n < 35:
                py = rng.uniform(260, 620)
                px = 1180 - 0.0013 * (760 - py) ** 2 + 75 + 10 * rng.normal()
            else:
                mx, my, sx, sy = groups[rng.choice(4, p=[0.25, 0.3, 0.25, 0.2])]
                px, py = mx + sx * rng.normal(), my + sy * rng.normal()
            size = rng.lognormal(1.0, 0.5)
            d = np.hypot(xw - px, yw - py) / size
            self.core = np.maximum(self.core, ramp(1.3 - 0.55 * d, 0, 0.9))
            along, across = (xw - px) * 0.94 + (yw - py) * 0.34, (yw - py) * 0.94 - (xw - px) * 0.34
            far = np.hypot((along - 4.5 * size) / (9 * size), across / (4.5 * size))
            self.anvil = np.maximum(self.anvil, ramp(1.1 - far + 0.12 * self.texture, 0, 1.0))
        # cirrus in streaks along the jet
        streak = noise(rng, 2.4, 160, 2.0, 3.0)
        self.cirrus = ramp(0.7 * streak + 0.9 * big - 0.6, 0, 2.2)

    def at(self, z: F32, temperature: F32) -> dict[str, F32]:
        """Mixing ratios at heights z (NY, NX) above sea level."""
        above = z - self.terrain
        shift = int(np.median(z) // 900)
        lumps = np.roll(self.texture, (shift, 2 * shift), (0, 1))
        water = np.zeros_like(z)

        def layer(base: Any, top: Any, soft: float) -> Any:
            return ramp(z, base - soft, base + soft) * (1 - ramp(z, top - soft, top + soft))

        deck_top = 600 + 250 * self.deck
        water += 2.6e-4 * self.deck * ramp(above, 300, 500) * (1 - ramp(above, deck_top, deck_top + 200))
        top = 1400 + 2200 * self.cumulus
        water += 4e-4 * ramp(self.cumulus, 0, 0.8) * ramp(above, 900, 1150) * (1 - ramp(above, top - 300, top))
        front = self.front * ramp(0.8 + 0.5 * lumps + 1.6 * self.front, 0.4, 1.6) * layer(1200, self.front_top, 500)
        core = self.core * layer(900 + self.terrain, 11_800 + 900 * self.core, 500)
        anvil = self.anvil * layer(10_300 - 900 * self.anvil, 11_900, 500)
        cirrus = self.cirrus * layer(8800 + 500 * lumps, 10_200 + 500 * lumps, 400)
        frozen = ramp(273.0 - temperature, 2, 32)
        total = 2.5e-4 * front * (1 - 0.6 * frozen) + 1.6e-3 * core
        ice = total * frozen * 0.45 + 9e-5 * anvil + 1.2e-5 * cirrus
        snow = 1.8e-4 * front * frozen + 9e-4 * core * frozen + 2e-5 * anvil
        rain = (2e-4 * front + 1.5e-3 * core) * (1 - frozen) * (1 - ramp(above, 3500, 5000))
        found = {"liquid": water + total * (1 - frozen), "ice": ice, "rain": rain, "snow": snow}
        return {name: np.where(values > 1e-7, values, 0).astype(np.float32) for name, values in found.items()}


def write(path: Path, sample: Path | None = None) -> None:
    import eccodes as ec

    if sample is not None:
        with sample.open("rb") as file:
            first = ec.codes_grib_new_from_file(file)
    else:
        first = ec.codes_grib_new_from_samples("GRIB2")
        ec.codes_set(first, "centre", 7)
        ec.codes_set(first, "generatingProcessIdentifier", 83)
        for name, value in HRRR.items():
            ec.codes_set(first, name, value)
        ec.codes_set(first, "numberOfDataPoints", NX * NY)
    lat, lon = (ec.codes_get_array(first, name).reshape(NY, NX) for name in ("latitudes", "longitudes"))
    lon = (lon + 180) % 360 - 180
    from openswim.ground.earth import water_fraction

    land = 1 - np.asarray(water_fraction(lat.ravel(), lon.ravel())).reshape(NY, NX).astype(np.float32)
    rng = np.random.default_rng(3)
    ridges = 1 - np.abs(noise(rng, 2.4, 120, 2.0))
    rockies = ramp(lon, -124, -117) * (1 - ramp(lon, -105.8, -99)) * ramp(lat, 24, 31)
    appalachians = np.exp(-(((lon + 80.5 - 0.85 * (lat - 37)) / 1.6) ** 2)) * ramp(lat, 32, 35)
    terrain = land * (60 + 1500 * rockies + 900 * rockies * ridges + 500 * appalachians * (0.6 + 0.5 * ridges))
    terrain = np.maximum(terrain, 0).astype(np.float32)
    weather = Weather(lat, lon, land, terrain)
    eta = np.linspace(0, 1, NZ)
    heights = 8 + TOP_M * (0.13 * eta + 0.87 * eta**2.1)
    with path.open("wb") as out:

        def put(name: str, level: tuple[int, int], values: Any) -> None:
            *code, bits = CODES[name]
            message = ec.codes_clone(first)
            ec.codes_set(message, "productDefinitionTemplateNumber", 0)
            keys = ("discipline", "parameterCategory", "parameterNumber")
            for key, value in zip(keys, code, strict=True):
                ec.codes_set(message, key, value)
            ec.codes_set(message, "typeOfFirstFixedSurface", level[0])
            ec.codes_set(message, "scaleFactorOfFirstFixedSurface", 0)
            ec.codes_set(message, "scaledValueOfFirstFixedSurface", level[1])
            ec.codes_set(message, "typeOfSecondFixedSurface", 255)
            ec.codes_set(message, "dataDate", 20240621)
            ec.codes_set(message, "dataTime", 1800)
            ec.codes_set(message, "packingType", "grid_complex_spatial_differencing")
            ec.codes_set(message, "bitsPerValue", bits)
            ec.codes_set_values(message, np.asarray(values, float).ravel())
            out.write(ec.codes_get_message(message))
            ec.codes_release(message)

        put("height", (1, 0), terrain)
        put("land", (1, 0), land)
        for k, z0 in enumerate(heights):
            z = (z0 + terrain * (1 - z0 / (TOP_M + 8)) ** 2).astype(np.float32)
            temperature = np.maximum(294 - 0.0065 * z + 4 * np.cos(np.radians(3 * (lat - 22))), 215).astype(np.float32)
            pressure = 101_325 * np.exp(-z * GRAVITY / (GAS * 0.5 * (temperature + 294)))
            celsius = temperature - 273.15
            vapour = 0.6 * 611.2 * np.exp(17.67 * celsius / (celsius + 243.5))
            fields = {"pressure": pressure, "height": z, "temperature": temperature}
            fields["humidity"] = 0.622 * vapour / pressure
            for name, values in {**fields, **weather.at(z, temperature)}.items():
                put(name, (105, k + 1), values)
            print(f"level {k + 1} of {NZ}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    assert pyproj  # before ecCodes: see openswim.readers.grib.file
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path, metavar="OUT.grib2")
    parser.add_argument("sample", type=Path, nargs="?", metavar="SAMPLE.grib2", help="a message of the real grid")
    chosen = parser.parse_args()
    write(chosen.out, chosen.sample)
