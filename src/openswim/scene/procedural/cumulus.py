"""Procedural fair-weather cumulus on a regular horizontal grid.

A population of clouds with a power law of sizes; each cloud is a cluster of rising turrets on one flat base,
roughened by turbulence that grows with height. The shapes are our own invention; contents and radii follow
the sources named below.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.scene.procedural.noise import FloatArray, fractal_noise, lattice_noise, sample, smoothstep

_WATER_DENSITY = 1000.0
_NOTHING = -1.0e4  # distance to the nearest cloud where none is near, m


def adiabatic_content_gradient(pressure_pa: float, temperature_k: float) -> float:
    """Growth of adiabatic liquid water content with height above cloud base, kg m-3 per m.

    (rho c_p / L_v) (dry minus moist adiabatic lapse rate); about 2 g m-3 per km in a summer boundary layer,
    within 10 % over the first 2 km (Albrecht, Fairall, Thomson, White, Snider and Schubert 1990, Geophys.
    Res. Lett. 17, 89).
    """
    gravity, heat, gas, gas_vapour = 9.81, 1004.0, 287.05, 461.5  # SI, per kg
    celsius = temperature_k - 273.15
    latent = 2.5e6 - 2370.0 * celsius
    vapour_pa = 611.2 * np.exp(17.62 * celsius / (243.12 + celsius))  # Magnus, WMO coefficients
    mixing = 0.622 * vapour_pa / (pressure_pa - vapour_pa)
    dry = gravity / heat
    moist = dry * (1 + latent * mixing / (gas * temperature_k))
    moist /= 1 + latent**2 * mixing / (heat * gas_vapour * temperature_k**2)
    return float(pressure_pa / (gas * temperature_k) * heat / latent * (dry - moist))


def cumulus_field(
    x_m: NDArray,
    y_m: NDArray,
    height_m: NDArray,
    *,
    seed: int = 0,
    base_m: float = 2100.0,
    top_m: float = 4000.0,
    cover: float = 0.35,
    base_pressure_pa: float = 79_000.0,
    base_temperature_k: float = 282.0,
    droplets_per_m3: float = 4.5e8,
    preference: NDArray | None = None,
    shear_per_s: float = 0.15,
) -> tuple[FloatArray, FloatArray]:
    """Liquid water content (kg m-3) and effective radius (m) of broken cumulus, both (nz, ny, nx).

    `x_m`, `y_m`, `height_m` are uniform horizontal node coordinates and the heights (nz,), ascending.
    `base_m` is the condensation level, `top_m` about the highest top. `cover` is the fraction of columns with
    cloud. `preference` (ny, nx) raises the density of clouds by its exponential (hills up, lakes down).
    `shear_per_s` leans the clouds toward +x, in metres per metre of height.

    Content is the adiabatic one times a dilution that grows with height and toward the edges, as measured by
    Warner (1955, Tellus 7, 449). The effective radius is that of undiluted cloud at constant droplet number,
    since mixing mostly removes droplets: r_e^3 = r_v^3 / 0.67 over land (Martin, Johnson and Spice 1994, J.
    Atmos. Sci. 51, 1823), limited to 5..14 um. Cloud diameters D follow N(D) ~ D^-2 between 350 m and a
    seventh of the domain, at most 4.5 km (Neggers, Jonker and Siebesma 2003, J. Atmos. Sci. 60, 1060: -1.7,
    and steeper above 1 km).
    """
    rng = np.random.default_rng(seed)
    z = np.asarray(height_m, float)
    first, last = np.searchsorted(z, [base_m - 200.0, top_m + 500.0])
    layer = slice(max(first, 0), max(last, first + 1))
    axes = (z[layer], np.asarray(y_m, float), np.asarray(x_m, float))
    turrets = _turrets(rng, axes[2], axes[1], top_m - base_m, cover, preference)
    inside_m, strength = _distance_inside(turrets, axes, base_m)
    inside_m = _soften(_roughen(rng, inside_m, strength, axes, base_m, shear_per_s))
    content = np.zeros((len(z), len(y_m), len(x_m)), np.float32)

    edge_m = 2.1 * float(axes[2][1] - axes[2][0])
    inside_m -= np.float32(np.quantile(inside_m.max(axis=0), 1 - cover) - min(0.5 * edge_m, 105.0))
    above_m = (axes[0][:, None, None] - base_m).astype(np.float32) - 60.0 * np.tanh(
        0.6 * lattice_noise(rng, axes[1:], 400.0)
    )
    gradient = adiabatic_content_gradient(base_pressure_pa, base_temperature_k)
    core = 0.45 + 0.55 * smoothstep(inside_m, 0.0, 500.0)
    dilution = strength * core / (1 + np.maximum(above_m, 0) / 1500.0)
    rim = smoothstep(inside_m, 0.0, edge_m * (1.6 - 0.8 * strength))  # soft over two cells, more where weak
    content[layer] = gradient * np.maximum(above_m, 0) * dilution * rim

    adiabatic = gradient * np.maximum(z - base_m, 0.0)
    volume_radius = np.cbrt(3 * adiabatic / (4 * np.pi * _WATER_DENSITY * droplets_per_m3))
    radius = np.clip(volume_radius / np.cbrt(0.67), 5.0e-6, 14.0e-6).astype(np.float32)
    return content, np.broadcast_to(radius[:, None, None], content.shape).copy()


def _soften(field: FloatArray) -> FloatArray:
    """`field` (nz, ny, nx) with a fifth of each node shared with each neighbour of its level."""
    for axis in (1, 2):
        levels = np.moveaxis(field, axis, 0)
        shared = np.float32(0.6) * levels
        shared[1:] += np.float32(0.2) * levels[:-1]
        shared[:-1] += np.float32(0.2) * levels[1:]
        field = np.moveaxis(shared, 0, axis)
    return np.ascontiguousarray(field)


def _turrets(
    rng: np.random.Generator,
    x_m: NDArray,
    y_m: NDArray,
    depth_m: float,
    cover: float,
    preference: NDArray | None,
) -> NDArray:
    """Rising turrets, rows of (x, y, radius, top above base, strength): metres; share of adiabatic water."""
    step, extent = float(x_m[1] - x_m[0]), min(np.ptp(x_m), np.ptp(y_m))
    smallest, largest = max(350.0, 3.5 * step), max(min(4500.0, extent / 7), 5.0 * step)
    density = 0.7 * fractal_noise(rng, (y_m, x_m), 2500.0, 1200.0, gain=0.7)
    density = np.exp(density + (0.0 if preference is None else preference)).ravel()
    density /= density.sum()

    remaining, diameters = 1.6 * cover * np.ptp(x_m) * np.ptp(y_m), []
    while remaining > 0:
        diameters.append(1 / rng.uniform(1 / largest, 1 / smallest))
        remaining -= 0.55 * diameters[-1] ** 2
    diameters.sort(reverse=True)
    cells = rng.choice(density.size, (len(diameters), 6), p=density)
    places = np.stack([x_m[cells % len(x_m)], y_m[cells // len(x_m)]], axis=-1)
    centres = _keep_apart(places, np.array(diameters))
    rows = [_cluster(rng, centre, d, depth_m) for centre, d in zip(centres, diameters, strict=True)]
    return np.concatenate(rows)


def _keep_apart(candidates_m: NDArray, diameters_m: NDArray) -> NDArray:
    """One centre (n, 2) for each cloud, largest first, out of its candidates (n, k, 2), all in m.

    Air sinks around a cloud, so clouds over 1 km take the first candidate that is clear of earlier ones.
    Where none is clear, clouds merge.
    """
    centres = candidates_m[:, 0].copy()
    for number in range(1, int((diameters_m > 1000.0).sum())):
        apart = candidates_m[number, :, None] - centres[:number]
        needed = 0.55 * (diameters_m[number] + diameters_m[:number])
        clear = (np.hypot(apart[..., 0], apart[..., 1]) > needed).all(axis=1)
        centres[number] = candidates_m[number, int(np.argmax(clear))]
    return centres


def _cluster(rng: np.random.Generator, centre: NDArray, diameter_m: float, limit_m: float) -> NDArray:
    """Turrets of one cloud: rows as in `_turrets`. Tall ones stand near the middle.

    Depth goes with diameter to the power 0.6; a cloud 4.5 km wide has the depth `limit_m`.
    """
    count = 2 + rng.poisson(2.2 * (diameter_m / 800.0) ** 1.5)
    radius = 0.5 * diameter_m * min(1.0, (diameter_m / 400.0) ** -0.5)
    turn, aspect = rng.random() * np.pi, rng.uniform(0.45, 1.0)
    lobes = rng.standard_normal((1 + count // 5, 2)) * 0.26 * diameter_m
    offset = lobes[rng.integers(len(lobes), size=count)] + rng.standard_normal((count, 2)) * 0.17 * diameter_m
    offset[0] = 0.0
    far = np.clip(np.hypot(*offset.T) / (0.75 * diameter_m), 0, 0.95)
    offset = offset * [1.0, aspect] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    radii = radius * rng.uniform(0.65, 1.15, count) * (1 - 0.45 * far)
    depth_m = limit_m * (diameter_m / 4500.0) ** 0.6 * rng.lognormal(0.0, 0.2)
    tops = np.clip(depth_m * np.sqrt(1 - far**2) * rng.uniform(0.55, 1.05, count), 0.9 * radii, limit_m)
    strength = np.full(count, np.clip(rng.normal(0.50, 0.14) + 0.06 * diameter_m / 1000.0, 0.25, 0.85))
    return np.column_stack([centre + offset, radii, tops, strength])


def _distance_inside(
    turrets: NDArray, axes: tuple[NDArray, ...], base_m: float
) -> tuple[FloatArray, FloatArray]:
    """Depth inside the union of turrets (m, negative outside) and strength of the nearest, both (nz, ny, nx).

    A turret is a round column from below the base, a little narrower at its foot, with a spherical head.
    """
    z, y, x = axes
    inside = np.full((len(z), len(y), len(x)), _NOTHING, np.float32)
    strength = np.zeros_like(inside)
    for x0, y0, radius, top, vigour in turrets:
        reach = radius + 450.0
        kz = slice(0, int(np.searchsorted(z, base_m + top + 450.0)))
        ky, kx = (slice(*np.searchsorted(axis, [at - reach, at + reach])) for axis, at in ((y, y0), (x, x0)))
        foot = np.clip((z[kz] - base_m) / max(top, 1.0), 0, 1)
        rise = np.maximum(z[kz] - (base_m + top - radius), 0).astype(np.float32)
        across = np.hypot(y[ky, None] - y0, x[kx] - x0).astype(np.float32)
        width = (radius * (0.88 + 0.12 * foot)).astype(np.float32)
        depth = width[:, None, None] - np.hypot(rise[:, None, None], across)
        here = inside[kz, ky, kx]
        nearer = depth > here
        here[nearer] = depth[nearer]
        strength[kz, ky, kx][nearer] = vigour
    return inside, strength


def _roughen(
    rng: np.random.Generator,
    inside_m: FloatArray,
    strength: FloatArray,
    axes: tuple[NDArray, ...],
    base_m: float,
    shear_per_s: float,
) -> FloatArray:
    """Turbulent outline: lean and swirl clouds, push their surface in and out, end them at the sides.

    Vigorous clouds get round knobs, weak ones frayed edges.
    """
    z, y, x = axes
    step = float(x[1] - x[0])
    above = np.clip(z - base_m, 0, None).astype(np.float32)[:, None, None]
    swirl = [(40.0 + 0.08 * above) * lattice_noise(rng, axes, 450.0) / step for _ in range(3)]
    swirl[2] *= step / np.gradient(z).astype(np.float32)[:, None, None]
    index = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in inside_m.shape), indexing="ij", sparse=True)
    lean = shear_per_s * above / step
    inside_m = sample(inside_m, (index[0] + swirl[2], index[1] + swirl[0], index[2] + swirl[1] - lean))

    smallest = 1.2 * step
    knobs = fractal_noise(rng, axes, max(480.0, smallest), smallest, gain=0.6, billow=True)
    inside_m += (45.0 + 55.0 * smoothstep(above, 0.0, 700.0)) * 2.0 * np.tanh(knobs / 2.0)
    frayed = fractal_noise(rng, axes, max(260.0, smallest), smallest, gain=0.7)
    inside_m += (15.0 + 220.0 * np.maximum(0.75 - strength, 0)) * frayed
    to_edge = np.minimum.outer(np.minimum(y - y[0], y[-1] - y), np.minimum(x - x[0], x[-1] - x)) / step
    shore = to_edge - 1.0 - 3.0 * np.abs(lattice_noise(rng, axes[1:], 900.0))
    inside_m -= 1200.0 * np.square(1 - smoothstep(shore, 0.0, 6.0))
    return inside_m
