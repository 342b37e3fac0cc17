"""The sun's disc: limb darkening and its share of a pixel."""

import numpy as np

# Neckel (2005), Solar Physics 229, 13: coefficients of sum_k mu^k (a + b / lambda + c / lambda^5), lambda in
# um, one law in each of three ranges.
_RANGES_UM = ((0.300, 0.37298), (0.385, 0.42257), (0.42257, 1.100))
_COEFFICIENTS = np.array([
    [[0.35601, -0.085217, 0], [1.11529, 0.085217, -0.001871], [-0.67237, 0, 0.003589],
     [0.18696, 0, -0.002415], [0.00038, 0, 0.000897], [0.01373, 0, -0.000200]],
    [[0.09900, 0.010643, 0], [1.96884, -0.010643, -0.009166], [-2.80511, 0, 0.024873],
     [3.32780, 0, -0.029317], [-2.17878, 0, 0.018273], [0.58825, 0, -0.004663]],
    [[0.75267, -0.265577, 0], [0.93874, 0.265577, -0.004095], [-1.89287, 0, 0.012582],
     [2.42234, 0, -0.017117], [-1.71150, 0, 0.011977], [0.49062, 0, -0.003347]],
])  # fmt: skip
_PIXEL_SIGMA = (
    1.2  # width of the pixel's Gaussian in half-pixels: a sum over any pixel grid is then right to .3 %
)
_REACH = 5.0  # the Gaussian ends at so many sigma
_GOLDEN = (5**0.5 - 1) / 2


def _polynomial(wavelength_nm: np.ndarray) -> np.ndarray:
    """Coefficients (6, nwl) of the powers of mu, normalised to 1 at the disc's centre."""
    wavelength_um = np.clip(np.asarray(wavelength_nm, dtype=float) / 1000.0, 0.300, 1.100)
    edges, values = [], []
    for (low, high), law in zip(_RANGES_UM, _COEFFICIENTS, strict=True):
        inside = np.clip(wavelength_um, low, high)
        values.append(law[:, :1] + law[:, 1:2] / inside + law[:, 2:] / inside**5)
        edges.append(high)
    between = np.clip(
        (wavelength_um - edges[0]) / (_RANGES_UM[1][0] - edges[0]), 0, 1
    )  # the gap at 373-385 nm
    blue = values[0] * (1 - between) + values[1] * between
    return np.where(wavelength_um <= edges[1], blue, values[2])


def disc_profile(r_over_radius: float | np.ndarray, wavelength_nm: float | np.ndarray) -> np.ndarray:
    """Radiance over the mean radiance of the disc at a distance r from its centre; zero beyond the limb.

    Shape: that of `r_over_radius` followed by that of `wavelength_nm`.  Neckel (2005), 300-1100 nm, about 1 %
    of the centre for r/R < .97; wavelengths beyond are clamped.
    """
    radius = np.asarray(r_over_radius, dtype=float)
    wavelength = np.asarray(wavelength_nm, dtype=float)
    coefficients = _polynomial(wavelength.ravel())
    mu = np.sqrt(np.clip(1.0 - radius**2, 0.0, 1.0))
    powers = mu[..., None] ** np.arange(6) * (radius <= 1.0)[..., None]
    mean = 2.0 / (np.arange(6) + 2.0) @ coefficients  # 2 int_0^1 mu^k mu dmu
    return (powers @ (coefficients / mean)).reshape(radius.shape + wavelength.shape)


def disc_points(count: int, wavelengths_nm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) on the disc in its radii, right and up, and the share (n, nwl) of its light that each stands for.

    Each stands for as much of the disc, and no two are equally high: above any height there lies the share of
    the light that is there, within 1/n.  Shares sum to 1 exactly.
    """
    table = np.linspace(-1.0, 1.0, 20_001)
    below = 0.5 + (table * np.sqrt(1 - table**2) + np.arcsin(table)) / np.pi
    number = np.arange(count)
    up = np.interp((number + 0.5) / count, below, table)
    right = (2 * ((0.5 + number * _GOLDEN) % 1.0) - 1) * np.sqrt(1 - up**2)
    share = disc_profile(np.hypot(right, up), np.atleast_1d(wavelengths_nm))
    return np.stack([right, up], axis=-1), share / share.sum(axis=0)


def _scaled_bessel(x: np.ndarray) -> np.ndarray:
    """e^-x I_0(x), to 1e-7."""
    small, large = np.minimum(x, 30.0), np.maximum(x, 30.0)
    asymptotic = (1 + (1 + (9 + 75 / (8 * large)) / (16 * large)) / (8 * large)) / np.sqrt(2 * np.pi * large)
    return np.where(x < 30.0, np.i0(small) * np.exp(-small), asymptotic)


def disc_coverage(
    distance_deg: np.ndarray, half_width_deg: np.ndarray, sun_radius_deg: float, wavelengths_nm: np.ndarray
) -> np.ndarray:
    """Solar-relative radiance L' (n, nwl) of the bare disc in pixels `distance_deg` (n,) from its centre.

    The limb-darkened disc is smoothed by a Gaussian as wide as the pixel (`half_width_deg`, (n,) or scalar),
    so its edge is anti-aliased and its integral over the solid angle of the pixels is 4 pi, the whole
    sunbeam, to .3 % however large the pixels are (L' = 4 pi L / E_TOA, Albers et al. 2020, Eq. 2).  Multiply
    by the transmittance.
    """
    distance = np.atleast_1d(np.asarray(distance_deg, dtype=float))
    sigma = _PIXEL_SIGMA * np.broadcast_to(np.asarray(half_width_deg, dtype=float), distance.shape)
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, dtype=float))
    result = np.zeros((distance.size, wavelengths.size))
    near = np.flatnonzero(distance < sun_radius_deg + _REACH * sigma)
    d, s = distance[near, None], sigma[near, None]

    # Convolution of two round functions: radial quadrature over the part of the disc that the Gaussian
    # reaches. Nodes in mu keep the limb's square root smooth.
    low = np.clip(d - _REACH * s, 0.0, sun_radius_deg)
    high = np.clip(d + _REACH * s, 0.0, sun_radius_deg)
    mu_from, mu_to = (np.sqrt(1.0 - (r / sun_radius_deg) ** 2) for r in (high, low))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    mu = mu_from + (mu_to - mu_from) * (nodes + 1) / 2
    r = sun_radius_deg * np.sqrt(1.0 - mu**2)
    area = sun_radius_deg**2 * mu * weights * (mu_to - mu_from) / 2  # r dr
    kernel = area / s**2 * np.exp(-0.5 * ((r - d) / s) ** 2) * _scaled_bessel(r * d / s**2)
    solid_angle_sr = np.pi * np.radians(sun_radius_deg) ** 2
    result[near] = (
        4
        * np.pi
        / solid_angle_sr
        * np.einsum("nq,nqw->nw", kernel, disc_profile(r / sun_radius_deg, wavelengths))
    )
    return result
