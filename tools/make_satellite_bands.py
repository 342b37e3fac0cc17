"""Reduce the agencies' spectral responses to the few wavelengths and weights that a band needs.

    python tools/make_satellite_bands.py FOLDER

FOLDER has text files of spectral responses (wavelength in um or nm, response), one per imager, with a line that names
each band. Reflectance over a band is the mean of f over response R times solar irradiance E. The wavelengths
and weights are the Gauss rule of the measure E R: n wavelengths are exact for polynomials of degree 2 n - 1. As many
are taken as bring the worst of some spectra of the sky within .3 per cent, eight at the most, and that worst error is
written beside them. Bands between 400 and 1700 nm; absorption by lines of gases is not among the spectra.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from openswim.lights.spectrum import solar_irradiance
from openswim.optics.ozone import ozone_cross_section_m2
from openswim.optics.rayleigh import rayleigh_cross_section_m2

TARGET = Path(__file__).parents[1] / "src/openswim/satellites/data/bands.json"
WITHIN, MOST = 0.003, 8
LOW_NM, HIGH_NM = 400.0, 1700.0
STEP_NM = 715.0  # where leaves turn bright
AIR_PER_M2, OZONE_PER_M2 = 2.15e29, 8.06e22  # columns at sea level, 300 DU
IMAGERS = {
    "goes-16 abi": ("GOES16_ABI_1nm", "NOAA, PFM spectral response curves"),
    "goes-17 abi": ("GOES17_ABI_1nm", "NOAA, FM2 spectral response curves"),
    "goes-18 abi": ("GOES18_ABI_1nm", "NOAA, FM3 spectral response curves"),
    "goes-19 abi": ("GOES19_ABI_1nm", "NOAA, FM4 spectral response curves"),
    "himawari-8 ahi": ("H08_AHI", "JMA, AHI-8 spectral responsivity"),
    "himawari-9 ahi": ("H09_AHI", "JMA, AHI-9 spectral responsivity"),
    "meteosat-8 seviri": ("MSG1_SEVIRI", "EUMETSAT, MSG calibration"),
    "meteosat-9 seviri": ("MSG2_SEVIRI", "EUMETSAT, MSG calibration"),
    "meteosat-10 seviri": ("MSG3_SEVIRI", "EUMETSAT, MSG calibration"),
    "meteosat-11 seviri": ("MSG4_SEVIRI", "EUMETSAT, MSG calibration"),
    "mtg-i1 fci": ("MTG-I1_FCI", "EUMETSAT, FCI spectral responses 2021-09-13"),
    "terra modis": ("Terra_MODIS", "NASA, terra_modis_RSR"),
    "aqua modis": ("Aqua_MODIS", "NASA, aqua_modis_RSR"),
    "suomi-npp viirs": ("SUOMI-NPP_VIIRS", "NASA and NOAA, NG VIIRS filtered, October 2011"),
    "noaa-20 viirs": ("JPSS-1_VIIRS", "NASA and NOAA, JPSS-1 VIIRS"),
    "noaa-21 viirs": ("JPSS-2_VIIRS", "NASA and NOAA, JPSS-2 VIIRS"),
}
ABI = {"CH047": "C01", "CH064": "C02", "CH086": "C03", "CH138": "C04", "CH161": "C05", "CH225": "C06"}
# the collection numbers MODIS bands by wavelength
MODIS = {str(n + 1): str(name) for n, name in enumerate([8, 9, 3, 10, 11, 12, 4, 1, 13, 14, 15, 2, 16, 5, 6, 7])}


def responses(path: Path) -> dict[str, np.ndarray]:
    """Bands by name: (n, 2) wavelength in nm and response."""
    found: dict[str, list[tuple[float, float]]] = {}
    name = ""
    for line in path.read_text("latin-1").splitlines():
        if (match := re.search(r"\bband\s+(.+?)\s*$", line, re.IGNORECASE)) and line[:1] in "#;":
            name = re.sub(r"^band\s+", "", match.group(1), flags=re.IGNORECASE)
        elif name and line.strip()[:1].isdigit():
            wavelength, response = re.split(r"[\s,]+", line.strip())[:2]
            to_nm = 1000 if float(wavelength) < 50 else 1  # um or nm
            found.setdefault(name, []).append((to_nm * float(wavelength), float(response)))
    return {name: np.array(sorted(rows)) for name, rows in found.items()}


def gauss(x: np.ndarray, weight: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights (summing to one) of the Gauss rule of a discrete measure: Stieltjes, then Golub and Welsch."""
    middle, half = (x @ weight) / weight.sum(), np.ptp(x) / 2
    t, w = (x - middle) / half, weight / weight.sum()
    before, now, last = np.zeros_like(t), np.ones_like(t), 1.0
    a, b = [], []
    for order in range(n):
        size = w @ now**2
        a.append(w @ (t * now**2) / size)
        if order:
            b.append(size / last)
        before, now, last = now, (t - a[-1]) * now - (b[-1] if order else 0.0) * before, size
    matrix = np.diag(a) + np.diag(np.sqrt(b), 1) + np.diag(np.sqrt(b), -1)
    nodes, vectors = np.linalg.eigh(matrix)
    return middle + half * nodes, vectors[0] ** 2


def rules(grid: np.ndarray, weight: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Gauss rules of more and more wavelengths: of the whole band, and of parts below and above the leaves' step."""
    for n in range(1, MOST + 1):
        yield gauss(grid, weight, n)
        red = grid < STEP_NM
        for first in range(1, n):
            sides = ((red, first), (~red, n - first))
            parts = [gauss(grid[side], weight[side], k) for side, k in sides if side.sum() > k]
            if len(parts) == 2:
                shares = [weight[part].sum() / weight.sum() for part in (red, ~red)]
                nodes = np.concatenate([part[0] for part in parts])
                yield nodes, np.concatenate([share * part[1] for share, part in zip(shares, parts, strict=True)])


def spectra() -> list[Callable[[np.ndarray], np.ndarray]]:
    """What f may look like: blue air over a dark sea, cloud below ozone, leaves (a step at 715 nm), soil, snow."""
    air = lambda wl: 1 - np.exp(-1.5 * AIR_PER_M2 * rayleigh_cross_section_m2(wl))  # noqa: E731
    ozone = lambda wl: np.exp(-3 * OZONE_PER_M2 * ozone_cross_section_m2(wl))  # noqa: E731
    return [
        lambda wl: 0.5 * air(wl) + 0.01,
        lambda wl: 0.7 * ozone(wl),
        lambda wl: 0.5 * air(wl) + 0.06 + 0.35 / (1 + np.exp(-(wl - STEP_NM) / 12.0)),
        lambda wl: 0.3 * air(wl) + 0.1 + 0.2 * (wl - 400.0) / 1300.0,
        lambda wl: 0.9 * ozone(wl) / (1 + np.exp((wl - 1300.0) / 120.0)) + 0.05,
    ]


def reduced(response: np.ndarray) -> dict[str, object] | None:
    grid = np.arange(np.ceil(response[0, 0]), np.floor(response[-1, 0]) + 1.0)
    weight = np.interp(grid, *response.T) * np.where(grid < 4000, solar_irradiance(grid), 0.0)
    weight[np.interp(grid, *response.T) < 0.002 * response[:, 1].max()] = 0.0
    grid, weight = grid[weight > 0], weight[weight > 0]
    if not grid.size:
        return None
    centre = float(grid @ weight / weight.sum())
    if not LOW_NM <= centre <= HIGH_NM:
        return None
    exact = np.array([weight @ f(grid) / weight.sum() for f in spectra()])
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for nodes, shares in rules(grid, weight):
        error = float(np.max(np.abs([shares @ f(nodes) for f in spectra()] / exact - 1)))
        if best is None or error < best[0]:
            best = error, nodes, shares
        if error < WITHIN:
            break
    assert best is not None
    error, nodes, shares = best
    return {
        "centre_nm": round(centre, 1),
        "wavelength_nm": [round(float(wl), 1) for wl in nodes],
        "weight": [round(float(share), 4) for share in shares],
        "error": round(error, 4),
    }


def main(folder: Path) -> None:
    out: dict[str, object] = {}
    for imager, (file, source) in IMAGERS.items():
        bands = {}
        for name, response in responses(folder / f"{file}.txt").items():
            if (found := reduced(response)) is not None:
                bands[(MODIS if "modis" in imager else ABI).get(name, name)] = found
        out[imager] = {"source": source, "bands": bands}
    narrow = (443.0, 551.0, 680.0, 780.0)
    epic = {f"{wl:g}": {"centre_nm": wl, "wavelength_nm": [wl], "weight": [1.0], "error": 0.0} for wl in narrow}
    out["dscovr epic"] = {"source": "NASA, EPIC band centres (widths 2 to 3 nm)", "bands": epic}
    lines = [
        f' {json.dumps(name)}: {{"source": {json.dumps(one["source"])}, "bands": {{\n'  # type: ignore[index]
        + ",\n".join(f"  {json.dumps(band)}: {json.dumps(found)}" for band, found in one["bands"].items())  # type: ignore[index]
        + "\n }}"
        for name, one in out.items()
    ]
    TARGET.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    print(f"{TARGET}: {sum(len(one['bands']) for one in out.values())} bands")  # type: ignore[index]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
