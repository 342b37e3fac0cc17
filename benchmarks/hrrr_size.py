"""A file of HRRR's size with made-up weather, to measure on: `python benchmarks/hrrr_size.py OUT.grib2 [SAMPLE.grib2]`.

The grid is HRRR's (1799 x 1059, Lambert, 3 km; the definition is taken from a real message where one is given), with 50
hybrid levels of pressure, height, temperature, humidity and four species, packed as NCEP packs them. The weather is
fractal noise shaped by hand: a cyclone's front, stratocumulus off California, cumulus, thunderstorms with anvils, and
cirrus. About 700 MB in five minutes; never committed.
"""

from __future__ import annotations

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
        big, mid = noise(rng, 3.2, 700, 4), noise(rng, 2.8, 200, 1.0)
        fine = noise(rng, 2.2, 50)
        self.texture = 0.6 * mid + 0.5 * fine
        # a cyclone over the Great Lakes, its cold front trailing to Texas, its comma wrapped around
        cx, cy = 1150.0, 760.0
        r, angle = np.hypot(x - cx, y - cy), np.arctan2(y - cy, x - cx)
        arm = (angle + np.pi * 0.62 + np.log(np.maximum(r, 20) / 420) * 0.75 + 0.10 * big) % (2 * np.pi) - np.pi
        near = np.abs((arm + np.pi) % (2 * np.pi) - np.pi)
        width = 0.16 + 35 / np.maximum(r, 60)
        self.front = ramp(1 - near / (2.1 * width) + 0.22 * self.texture, 0, 0.7) * ramp(r, 20, 90) * (1 - ramp(r, 620, 850))
        self.front_top = 5500 + 4000 * ramp(self.front + 0.1 * mid, 0.2, 1.0)
        # stratocumulus over the cold Pacific, in closed cells that break up toward the south-west
        sea = (1 - ramp(land, 0.2, 0.8)) * (1 - ramp(lon, -125.5, -116.5)) * ramp(lat, 20, 24)
        cells = 1 - np.abs(noise(rng, 1.2, 14, 3.0))
        self.deck = ramp(0.75 * cells + 0.5 * big + 0.25 * mid + 0.5, 0.0, 0.8) * sea
        # cumulus by day over the humid south-east, streets in the noise
        humid = ramp(lon, -102, -92) * (1 - ramp(lat, 36, 41)) * land
        self.cumulus = ramp(noise(rng, 0.8, 12, 1.0) + 0.6 * mid + 0.35 * big - 1.3 + 0.8 * humid, 0.0, 1.0) * (0.15 + humid)
        self.cumulus *= 1 - ramp(self.front, 0, 0.3)
        # thunderstorms: cores in clusters, anvils blown to the east-north-east
        self.core, self.anvil = np.zeros((NY, NX), np.float32), np.zeros((NY, NX), np.float32)
        for _ in range(70):
            group = rng.choice(4, p=[0.35, 0.3, 0.2, 0.15])
            mx, my, sx, sy = [(900, 330, 170, 80), (1350, 130, 160, 60), (560, 330, 110, 130), (1500, 420, 70, 90)][group]
            px, py, size = mx + sx * rng.normal(), my + sy * rng.normal(), rng.lognormal(1.7, 0.5)
            wobble = 0.5 * mid + 0.3 * fine
            d = np.hypot(x - px, y - py) / size
            self.core = np.maximum(self.core, ramp(1.0 - 0.55 * d + 0.3 * wobble, 0, 0.6))
            along, across = (x - px) * 0.94 + (y - py) * 0.34, (y - py) * 0.94 - (x - px) * 0.34
            far = np.hypot((along - 2.2 * size) / (4.6 * size), across / (2.3 * size))
            self.anvil = np.maximum(self.anvil, ramp(1.15 - far + 0.16 * mid + 0.08 * fine, 0, 0.9))
        # cirrus in streaks along the jet
        streak = noise(rng, 2.4, 160, 0.5, 3.0)
        self.cirrus = ramp(streak + 0.9 * big - 0.9, 0, 1.6)

    def at(self, z: F32, temperature: F32) -> dict[str, F32]:
        """Mixing ratios at heights z (NY, NX) above sea level."""
        above = z - self.terrain
        shift = int(np.median(z) // 900)
        lumps = np.roll(self.texture, (shift, 2 * shift), (0, 1))
        water = np.zeros_like(z)

        def layer(base: Any, top: Any, soft: float) -> Any:
            return ramp(z, base - soft, base + soft) * (1 - ramp(z, top - soft, top + soft))

        water += 2.8e-4 * self.deck * ramp(above, 300, 500) * (1 - ramp(above, 600 + 250 * self.deck, 800 + 250 * self.deck))
        top = 1400 + 2200 * self.cumulus
        water += 5e-4 * (self.cumulus > 0) * ramp(self.cumulus, 0, 0.5) * ramp(above, 900, 1150) * (1 - ramp(above, top - 300, top))
        front = self.front * ramp(0.8 + 0.5 * lumps + 1.6 * self.front, 0.4, 1.6) * layer(1200, self.front_top, 500)
        core = self.core * layer(900 + self.terrain, 11_800 + 900 * self.core, 500)
        anvil = self.anvil * layer(10_300 - 900 * self.anvil, 11_900, 500)
        cirrus = self.cirrus * layer(8800 + 500 * lumps, 10_200 + 500 * lumps, 400)
        frozen = ramp(273.0 - temperature, 2, 32)
        total = 4.5e-4 * front * (1 - 0.6 * frozen) + 1.6e-3 * core
        ice = total * frozen * 0.45 + 1.6e-4 * anvil + 1.3e-5 * cirrus
        snow = 3.5e-4 * front * frozen + 9e-4 * core * frozen + 5e-5 * anvil
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
    ridges = 1 - np.abs(noise(rng, 2.4, 120))
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
            fields = {"pressure": pressure, "height": z, "temperature": temperature, "humidity": 0.622 * vapour / pressure}
            for name, values in {**fields, **weather.at(z, temperature)}.items():
                put(name, (105, k + 1), values)
            print(f"level {k + 1} of {NZ}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    assert pyproj  # before ecCodes: see openswim.readers.grib_file
    write(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
