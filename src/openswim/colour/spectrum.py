"""A full spectrum from radiance at a few wavelengths: Albers et al. 2020, Sect. 3.8 (corrected)."""


import numpy as np

from openswim.tables import csv_columns

SMALLEST = 1e-4  # of the pixel's largest value: what a zero counts as in the logarithm
MOST_POLYNOMIAL = 3  # wavelengths through which a polynomial passes; more take a spline
LEAST_GREEN = 0.2  # ln by which a canopy's green has to stand out at three wavelengths that are to tell it
MOST_GREEN = 2.0  # times as green as the typical canopy: what more stands out is not leaves
# Sunlight reddened on its way to molecules that scatter it stands out in the green by D = .29 - .59 r at most (clear
# skies under any sun by .27 - .59 r), r: ln of green over red
REDDENED, SKY_GREEN, LEAF_GREEN = 0.59, 0.26, 0.32


def extension_matrix(wavelengths_nm: np.ndarray, target_nm: np.ndarray) -> np.ndarray:
    """The matrix (n_target, nwl) that carries values at `wavelengths_nm` to `target_nm`.

    Up to three wavelengths: the polynomial through them; more: the natural cubic spline; in both cases in
    the logarithm of the wavelength and along the tangent beyond the ends.  Applied to ln L', where power
    laws are straight: the colour of a Rayleigh sky comes out exactly, that of the sun through 5 airmasses
    within .5 % and through 20 within 3 % (in linear sRGB, of the largest component).
    """
    nodes = np.log(np.asarray(wavelengths_nm, dtype=float))
    target = np.log(np.asarray(target_nm, dtype=float))
    if len(np.unique(nodes)) != len(nodes):
        raise ValueError(f"wavelengths {wavelengths_nm} nm are not distinct")
    inside = np.clip(target, nodes.min(), nodes.max())
    curve = _polynomial if len(nodes) <= MOST_POLYNOMIAL else _spline
    value, slope = curve(nodes, inside)
    return value + (target - inside)[:, None] * slope


def _polynomial(nodes: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope at `target` of the polynomial through all nodes, as matrices on the values there."""
    power = np.arange(len(nodes))
    from_values = np.linalg.inv((nodes - nodes[0])[:, None] ** power)
    away = (target - nodes[0])[:, None]
    return away**power @ from_values, power * away ** np.maximum(power - 1, 0) @ from_values


def _spline(nodes: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope at `target` of the natural cubic spline, as matrices on the values at the nodes."""
    order = np.argsort(nodes)
    x, value = nodes[order], np.eye(len(nodes))[order]
    h = np.diff(x)[:, None]
    chord = np.diff(value, axis=0) / h
    system = np.diag(np.r_[1, 2 * (h[1:, 0] + h[:-1, 0]), 1]) + np.diag(np.r_[h[:-1, 0], 0], -1)
    system += np.diag(np.r_[0, h[1:, 0]], 1)
    bend = np.linalg.solve(system, np.pad(6 * np.diff(chord, axis=0), ((1, 1), (0, 0))))  # second derivatives

    i = np.clip(np.searchsorted(x, target) - 1, 0, len(x) - 2)
    a, b, step = (x[i + 1] - target)[:, None], (target - x[i])[:, None], h[i]
    spline = (bend[i] * (a**3 / step - a * step) + bend[i + 1] * (b**3 / step - b * step)) / 6
    spline += (value[i] * a + value[i + 1] * b) / step
    slope = (bend[i + 1] * (3 * b**2 / step - step) - bend[i] * (3 * a**2 / step - step)) / 6 + chord[i]
    return spline, slope


def green_canopy() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (n,), 400-780 nm, and the reflectance (n,) of typical green land, by PROSAIL."""
    wavelengths, reflectance = csv_columns("colour", "green_canopy")
    return wavelengths, reflectance


class Extension:
    """L' at a few wavelengths extended to many, ready for a large number of pixels.

    A parabola through three cannot tell that leaves are dark until 500 nm, steeply green at 520 and no
    darker at 700 than at 650: it makes land emerald.  What green stands out by, in ln L', over the power law
    between blue and red, and over red, is therefore drawn in the shape that it has in a typical canopy's
    spectrum, and only the rest as a parabola; but not where reddened skylight stands out as much.

    Beyond the given wavelengths ln L' stays within its range at them widened by 1 + the range, so that
    strange colours (a black channel between bright ones) cannot blow up.
    """

    def __init__(self, wavelengths_nm: np.ndarray, target_nm: np.ndarray):
        matrix = extension_matrix(wavelengths_nm, target_nm)
        self.matrix = matrix.T.astype(np.float32)  # (nwl, n_target)
        self.green = _green_of(np.asarray(wavelengths_nm, float), np.asarray(target_nm, float), matrix)

    def __call__(self, radiance: np.ndarray) -> np.ndarray:
        """L' (n, nwl) to (n, n_target), float32; NaN stays NaN, nothing below zero."""
        return self.columns(np.asarray(radiance, np.float32).T).T

    def columns(self, values: np.ndarray) -> np.ndarray:
        """The same for float32 values (nwl, n), as (n_target, n): long rows are quicker."""
        largest = values.max(axis=0)
        logarithm = np.log(np.maximum(values, np.maximum(SMALLEST * largest, np.float32(1e-30))))
        high, low = logarithm.max(axis=0), logarithm.min(axis=0)
        margin = 1 + (high - low)
        if self.green is None:
            curve = self.matrix.T @ logarithm
        else:
            curve = self.matrix.T @ logarithm + self.green.shape[:, None] * self.green.of(logarithm)
        np.clip(curve, low - margin, high + margin, out=curve)
        np.exp(curve, out=curve)
        dark = ~(largest > 0)
        if dark.any():
            curve[:, dark] = largest[dark] * 0
        return curve


class _Green:
    """What leaves add at three wavelengths that tell them; ``shape`` (n_target,): to ``matrix``'s curve."""

    def __init__(self, nodes: np.ndarray, target: np.ndarray, matrix: np.ndarray):
        self.order = np.argsort(nodes)
        blue, middle, red = np.log(np.asarray(nodes)[self.order])
        self.share = np.float32((middle - blue) / (red - blue))
        known_nm, reflectance = green_canopy()
        canopy = np.log(np.interp(nodes, known_nm, reflectance))
        self.typical = float(min(self._stands_out(canopy)))
        curve = np.log(np.interp(target, known_nm, reflectance))
        self.shape = ((curve - matrix @ canopy) / max(self.typical, LEAST_GREEN)).astype(np.float32)

    def _stands_out(self, logarithm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far green is above the power law between blue and red, and above red."""
        blue, middle, red = logarithm[self.order]
        return middle - blue - self.share * (red - blue), middle - red

    def of(self, logarithm: np.ndarray) -> np.ndarray:
        """How much of ln L' (3, n) is leaves', (n,)."""
        above, over_red = self._stands_out(logarithm)
        sure = np.clip((above + REDDENED * over_red - SKY_GREEN) / (LEAF_GREEN - SKY_GREEN), 0, 1)
        return sure * np.clip(np.minimum(above, over_red), 0, MOST_GREEN * self.typical)


def _green_of(nodes: np.ndarray, target: np.ndarray, matrix: np.ndarray) -> _Green | None:
    """None where these wavelengths do not tell leaves."""
    green = _Green(nodes, target, matrix) if len(nodes) == 3 else None
    return green if green is not None and green.typical > LEAST_GREEN else None
