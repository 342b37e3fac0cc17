"""Make src/openswim/optics/data/mie_water.npz: Mie phase functions of cloud droplets and rain.

    python tools/make_mie_tables.py segelstein81_index.txt

Needs miepython (`pip install 'openswim[mie]'`); takes some twenty minutes. Not part of the package; run it only to
change the sizes, wavelengths or angles below. Wavelengths that the table already has are kept as they are there.

Water: refractive index of the IAPWS formulation R9-97 at 10 C, absorption of Pope & Fry (1997) to 700 nm and of
Segelstein (1981) beyond, whose table is to be named. Sizes: gamma distributions (Hansen & Travis 1974): droplets of
effective variance .1; rain of 1/3 (exponential), drops up to 3 mm. The rain's phase functions are averaged over the
solar disc (0.533 degrees), since their peaks and bows are finer than any image; beyond 700 nm rain has those of 700 nm.

Albedo and efficiency stand every 20 nm beyond 700 nm, since absorption has bands; phase functions at the wavelengths
`liquid_wavelength_nm` and `rain_wavelength_nm`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from openswim.optics.spheres import gamma_sizes, scattering_angles, scattering_by_spheres

VISIBLE_NM = np.array([400.0, 450.0, 500.0, 546.0, 580.0, 615.0, 660.0, 700.0])
PHASE_NM = {
    "liquid": np.r_[VISIBLE_NM, 780.0, 870.0, 960.0, 1060.0, 1160.0, 1270.0, 1370.0, 1450.0, 1530.0, 1610.0, 1700.0],
    "rain": VISIBLE_NM,
}
WAVELENGTH_NM = np.r_[VISIBLE_NM, np.arange(720.0, 1701.0, 20.0)]
ABSORPTION_PER_M = np.array([0.00663, 0.00922, 0.0204, 0.0553, 0.0896, 0.2678, 0.410, 0.624])
RADIUS_UM = {
    "liquid": np.array([2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0, 25.0, 30.0, 40.0]),
    "rain": np.array([125.0, 250.0, 750.0]),
}
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


def fine_angles():
    """Angles that resolve the rings of millimetre drops where the disc average needs it."""
    parts = [
        [0.0],
        np.geomspace(1e-5, 1.0, 500),
        np.arange(1.0, 12, 0.02),
        np.arange(12.0, 130, 0.1),
        np.arange(125.0, 146, 0.03),
        np.arange(146, 178, 0.1),
        180.0 - np.geomspace(1e-4, 2.0, 200),
        [180.0],
    ]
    return np.unique(np.concatenate(parts))


def droplet_angles():
    """Twice as fine where the rings of the corona and the dark side of the bow curve most."""
    base = scattering_angles(0.02)
    middle = 0.5 * (base[1:] + base[:-1])
    curved = ((middle > 3) & (middle < 12)) | ((middle > 60) & (middle < 120))
    return np.union1d(base, middle[curved])


def index_of_water(wavelength_nm, segelstein):
    """n - ik of water; ``segelstein`` (2, n): wavelength in um and k."""
    if wavelength_nm <= VISIBLE_NM[-1]:
        absorption = ABSORPTION_PER_M[np.flatnonzero(wavelength_nm == VISIBLE_NM)[0]]
        return complex(water_index(wavelength_nm), -absorption * wavelength_nm * 1e-9 / (4 * np.pi))
    k = np.exp(np.interp(np.log(wavelength_nm * 1e-3), np.log(segelstein[0]), np.log(segelstein[1])))
    return complex(water_index(wavelength_nm), -k)


def sizes_of(kind, radius_um, droplet_count=1500):
    if kind == "liquid":
        return gamma_sizes(radius_um, 0.1, radius_um / 12, radius_um * 4, droplet_count)
    return gamma_sizes(radius_um, 1 / 3, radius_um / 7.5, min(radius_um * 4, 3000.0), 60)


def phase_of(kind, angle, radius_um, wavelength_nm, index):
    """Its logarithm at ``angle``, and the mean, which is to be 1."""
    fine = angle if kind == "liquid" else fine_angles()
    found = scattering_by_spheres(sizes_of(kind, radius_um), index, wavelength_nm, fine)
    value = found.value if kind == "liquid" else disc_average(angle, found.angle_deg, found.value)
    return np.log(value), 0.5 * np.trapezoid(value * np.sin(np.radians(angle)), np.radians(angle))


def main() -> None:
    segelstein = np.loadtxt(sys.argv[1], skiprows=4).T[[0, 2]]
    old = dict(np.load(OUT)) if OUT.exists() else {}
    tables: dict[str, np.ndarray] = {"wavelength_nm": WAVELENGTH_NM}
    for kind, phase_nm in PHASE_NM.items():
        radii = RADIUS_UM[kind]
        angle = droplet_angles() if kind == "liquid" else scattering_angles(0.05)
        log_value = np.empty((phase_nm.size, radii.size, angle.size), np.float32)
        bulk = np.empty((2, WAVELENGTH_NM.size, radii.size))
        known = list(old.get(f"{kind}_wavelength_nm", old.get("wavelength_nm", [])))
        for w, wavelength in enumerate(phase_nm):
            if wavelength in known:
                log_value[w] = old[f"{kind}_log_value"][known.index(wavelength)]
                continue
            for r, radius in enumerate(radii):
                index = index_of_water(wavelength, segelstein)
                log_value[w, r], mean = phase_of(kind, angle, radius, wavelength, index)
                print(f"{kind} {radius:g} um, {wavelength:.0f} nm: mean {mean:.4f}", flush=True)
        known = list(old.get("wavelength_nm", []))
        for w, wavelength in enumerate(WAVELENGTH_NM):
            if wavelength in known:
                bulk[:, w] = [old[f"{kind}_{name}"][known.index(wavelength)] for name in ("albedo", "efficiency")]
                continue
            for r, radius in enumerate(radii):
                sizes, index = sizes_of(kind, radius, 300), index_of_water(wavelength, segelstein)
                found = scattering_by_spheres(sizes, index, wavelength, np.array([0.0, 180.0]))
                bulk[:, w, r] = found.single_scattering_albedo, found.efficiency
        tables |= {f"{kind}_radius_um": radii, f"{kind}_angle_deg": angle, f"{kind}_log_value": log_value}
        tables |= {f"{kind}_wavelength_nm": phase_nm, f"{kind}_albedo": bulk[0], f"{kind}_efficiency": bulk[1]}
    np.savez_compressed(OUT, **tables)
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
