"""Make src/openswim/optics/data/mie_water.npz: Mie phase functions of cloud droplets and rain.

Needs miepython (`pip install miepython`); takes a few minutes. Not part of the package; run it only to change
the sizes, wavelengths or angles below.

Water: refractive index of the IAPWS formulation R9-97 at 10 C, absorption of Pope & Fry (1997). Sizes: gamma
distribution n(r) ~ r^((1-3v)/v) exp(-r/(r_eff v)) (Hansen & Travis 1974): droplets r_eff 10 um, v .1; rain
r_eff 750 um, v 1/3 (exponential), drops of 0.1 to 3 mm radius. The rain table is averaged over the solar disc
(0.533 degrees), since its peak and bows are finer than any image.
"""

from __future__ import annotations

import os
from pathlib import Path

os.environ["MIEPYTHON_USE_JIT"] = "1"

import miepython
import numpy as np

WAVELENGTH_NM = np.array([400.0, 450.0, 500.0, 546.0, 580.0, 615.0, 660.0, 700.0])
ABSORPTION_PER_M = np.array([0.00663, 0.00922, 0.0204, 0.0553, 0.0896, 0.2678, 0.410, 0.624])
SOLAR_RADIUS_DEG = 0.2665
OUT = Path(__file__).parents[1] / "src/openswim/optics/data/mie_water.npz"


def water_index(wavelength_nm: float, temperature_k: float = 283.15, density: float = 0.9997) -> float:
    """Refractive index of liquid water in air (IAPWS R9-97; Harvey et al. 1998)."""
    t, w2 = temperature_k / 273.15, (wavelength_nm / 589.0) ** 2
    right = (
        0.244257733
        + 9.74634476e-3 * density
        - 3.73234996e-3 * t
        + 2.68678472e-4 * w2 * t
        + 1.58920570e-3 / w2
        + 2.45934259e-3 / (w2 - 0.2292020**2)
        + 0.900704920 / (w2 - 5.432937**2)
        - 1.66626219e-2 * density**2
    ) * density
    return float(np.sqrt((1 + 2 * right) / (1 - right)) / 1.00028)


def scattering_of_sizes(index, radius_um, weight, wavelength_nm, angle_deg):
    """Mean intensity per unit cross section at `angle_deg`, and the single-scattering albedo, of a size
    mixture."""
    mu = np.cos(np.radians(angle_deg))
    intensity, scattered, lost = np.zeros_like(mu), 0.0, 0.0
    for radius, share in zip(radius_um, weight, strict=True):
        x = 2 * np.pi * radius / (wavelength_nm * 1e-3)
        extinction, scattering, _, _ = miepython.efficiencies_mx(index, x)
        s1, s2 = miepython.S1_S2(index, x, mu, norm="qsca")
        area = share * np.pi * radius**2
        intensity += area * (np.abs(s1) ** 2 + np.abs(s2) ** 2) / 2
        scattered += area * scattering
        lost += area * extinction
    return 4 * np.pi * intensity / scattered, scattered / lost


def gamma_sizes(effective_radius, variance, smallest, largest, count, logarithmic):
    """Radii and their share of the number of particles."""
    edges = (
        np.geomspace(smallest, largest, count + 1)
        if logarithmic
        else np.linspace(smallest, largest, count + 1)
    )
    radius = np.sqrt(edges[1:] * edges[:-1]) if logarithmic else 0.5 * (edges[1:] + edges[:-1])
    density = radius ** ((1 - 3 * variance) / variance) * np.exp(-radius / (effective_radius * variance))
    return radius, density * np.diff(edges)


def angles(smallest_deg):
    """Scattering angles: logarithmic through the forward peak, fine at bows and glory."""
    peak = np.geomspace(smallest_deg, 10.0, 130)
    return np.unique(
        np.concatenate(
            [
                [0.0],
                peak,
                np.arange(10.5, 60, 1.0),
                np.arange(60, 120, 1.5),
                np.arange(120.0, 145, 0.5),
                np.arange(145, 172, 1.0),
                np.arange(172, 180.01, 0.2),
            ]
        )
    )


def disc_average(angle_deg, fine_deg, fine_value, radius_deg=SOLAR_RADIUS_DEG):
    """Mean of a function of the angle over a disc of `radius_deg` centred at each of `angle_deg`."""
    a = np.radians(radius_deg)
    t, value = np.radians(fine_deg), fine_value
    averaged = []
    for theta in np.radians(angle_deg):
        with np.errstate(all="ignore"):
            cosine = (np.cos(a) - np.cos(theta) * np.cos(t)) / (np.sin(theta) * np.sin(t))
        inside = np.cos(t - theta) >= np.cos(a)
        fraction = np.where(inside & np.isfinite(cosine), np.arccos(np.clip(cosine, -1, 1)) / np.pi, inside)
        kernel = fraction * np.sin(t)
        averaged.append(np.trapezoid(kernel * value, t) / np.trapezoid(kernel, t))
    return np.array(averaged)


def droplets(wavelength_nm, index):
    angle = angles(0.02)
    radius, weight = gamma_sizes(10.0, 0.1, 0.5, 45.0, 1500, logarithmic=False)
    value, albedo = scattering_of_sizes(index, radius, weight, wavelength_nm, angle)
    return angle, value, albedo


def rain(wavelength_nm, index):
    fine = np.unique(
        np.concatenate(
            [
                [0.0],
                np.geomspace(1e-5, 1.0, 500),
                np.arange(1.0, 12, 0.02),
                np.arange(12.0, 130, 0.1),
                np.arange(125.0, 146, 0.03),
                np.arange(146, 178, 0.1),
                180.0 - np.geomspace(1e-4, 2.0, 200),
                [180.0],
            ]
        )
    )
    radius, weight = gamma_sizes(750.0, 1 / 3, 100.0, 3000.0, 60, logarithmic=True)
    value, albedo = scattering_of_sizes(index, radius, weight, wavelength_nm, fine)
    angle = angles(0.05)
    return angle, disc_average(angle, fine, value), albedo


def main() -> None:
    tables: dict[str, np.ndarray] = {"wavelength_nm": WAVELENGTH_NM}
    for kind, make in (("liquid", droplets), ("rain", rain)):
        values, albedos = [], []
        for wavelength, absorption in zip(WAVELENGTH_NM, ABSORPTION_PER_M, strict=True):
            index = complex(water_index(wavelength), -absorption * wavelength * 1e-9 / (4 * np.pi))
            angle, value, albedo = make(wavelength, index)
            values.append(np.log(value))
            albedos.append(albedo)
            mean = 0.5 * np.trapezoid(value * np.sin(np.radians(angle)), np.radians(angle))
            print(
                f"{kind} {wavelength:.0f} nm: n = {index:.5g}, mean {mean:.4f}, albedo {albedo:.7f}",
                flush=True,
            )
        tables[f"{kind}_angle_deg"] = angle
        tables[f"{kind}_log_value"] = np.array(values, np.float32)
        tables[f"{kind}_albedo"] = np.array(albedos)
    np.savez_compressed(OUT, **tables)
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
