"""Where a grid's columns stand, and a chart that finds them from a place."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.frame import Frame
from openswim.scene.grid import Grid
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_CHART_NODES = 161
_CHART_MARGIN = 1.35  # the chart reaches this many half-widths of the domain
_MOST_DEGREES = 200.0  # of longitude


def fixed_to_earth(frame: Frame, place: F64) -> F64:
    """Places in metres from the Earth's centre, in axes that turn with it."""
    if not frame.curved:
        return place
    lat, lon, _ = frame.latlon(place)
    return Frame(frame.radius_m, 0.0, 0.0).position(lat, lon, 0.0) + np.array([0.0, 0.0, frame.radius_m])


def before_drift(frame: Frame, place: F64, drift_m: tuple[float, float]) -> F64:
    """Places as `fixed_to_earth` has them from which clouds have drifted so far to the east and north, without being
    drawn out: turned about the Earth's centre as the middle of the frame is."""
    if not any(drift_m):
        return place
    if not frame.curved:
        return place - np.array([*drift_m, 0.0])
    from scipy.spatial.transform import Rotation

    east, north, up = Frame(frame.radius_m, 0.0, 0.0).enu(frame.lat, frame.lon)
    way = drift_m[0] * east + drift_m[1] * north
    return np.asarray(Rotation.from_rotvec(-np.cross(up, way) / frame.radius_m).apply(place.reshape(-1, 3))).reshape(
        place.shape
    )


def columns_on(grid: Grid, frame: Frame, some: Any) -> tuple[F32, F64]:
    """Axes and sea-level points of some of the nodes (ny, nx) of a grid on the Earth."""
    _, ny, nx = grid.shape
    rows, columns = np.broadcast_arrays(np.arange(ny)[:, None], np.arange(nx))
    return _columns_at(grid, frame, columns[some].astype(float), rows[some].astype(float))


def finer_columns(grid: Grid, frame: Frame, fineness: int) -> tuple[F32, F64]:
    """Axes and sea-level points of the columns."""
    _, ny, nx = grid.shape
    last = 0 if grid.periodic else fineness - 1  # beyond the last node only the next period begins
    ny, nx = fineness * ny - last, fineness * nx - last
    iy, ix = np.mgrid[0:ny, 0:nx] / fineness
    if not frame.curved:
        place = np.stack([grid.x[0] + ix * grid.step[0], grid.y[0] + iy * grid.step[1], 0 * ix], axis=-1)
        return np.broadcast_to(np.eye(3, dtype=FLOAT), (ny, nx, 3, 3)).copy(), place
    return _columns_at(grid, frame, ix, iy)


def _columns_at(grid: Grid, frame: Frame, ix: F64, iy: F64) -> tuple[F32, F64]:
    """`finer_columns` at fractional indices on the Earth."""

    def at(i: F64, j: F64) -> F64:
        lon, lat = grid.lonlat(i, j)
        return frame.position(lat, lon, 0.0)

    place = at(ix, iy)
    up = place + np.array([0, 0, frame.radius_m])
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    along = at(ix + 0.5, iy) - at(ix - 0.5, iy)
    along = np.where(np.isfinite(along), along, np.array([1.0, 0.0, 0.0]))  # the map ends here
    along -= (along * up).sum(-1, keepdims=True) * up
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    return np.stack([along, np.cross(up, along), up], axis=-2).astype(FLOAT), place


def chart_of(grid: Grid, frame: Frame) -> tuple[float, float, F64]:
    """Table of fractional grid indices on Lambert's azimuthal equal-area map around the origin of the frame."""
    _, ny, nx = grid.shape
    if not frame.curved:
        # linear, so two nodes are exact; extent beyond the domain for distances to it
        x0, y0 = grid.x[0], grid.y[0]
        dx, dy = grid.step
        half = 50.0 * max(nx * dx, ny * dy, abs(x0), abs(y0))
        u = np.array([-half, half])
        chart = np.stack(np.meshgrid((u - x0) / dx, (u - y0) / dy), axis=-1)
        return -half, 1 / (2 * half), chart
    corners = np.array([[0, 0], [nx - 1, 0], [0, ny - 1], [nx - 1, ny - 1], [0, ny / 2], [nx - 1, ny / 2], [nx / 2, 0],
                        [nx / 2, ny - 1]], float)  # fmt: skip
    radius = frame.radius_m
    lon, lat = grid.lonlat(corners[:, 0], corners[:, 1])
    p = frame.position(lat, lon, 0.0)
    flat = p[:, :2] * np.sqrt(2 * radius / np.maximum(2 * radius + p[:, 2:3], 1e-3 * radius))
    half = min(_CHART_MARGIN * np.nanmax(np.abs(flat)), 2 * radius)
    u = np.linspace(-half, half, _CHART_NODES)
    uu, vv = np.meshgrid(u, u)
    square = (uu**2 + vv**2) / (2 * radius**2)  # 1 - cosine of the angle from the origin
    known = square < 1.99
    square = np.where(known, square, 0)
    shrink = np.sqrt(1 - 0.5 * square)
    lat, lon, _ = frame.latlon(np.stack([uu * shrink, vv * shrink, -radius * square], axis=-1))
    chart = np.where(known[..., None], np.stack(grid.index(lon, lat), axis=-1), -1e9)
    return -half, (_CHART_NODES - 1) / (2 * half), np.nan_to_num(chart, nan=-1e9, posinf=1e9, neginf=-1e9)


def check_span(grid: Grid) -> None:
    """Longitudes that go half round the Earth have a seam, or a pole, that no chart can hide."""
    if grid.in_degrees and grid.x[-1] - grid.x[0] > _MOST_DEGREES:
        raise UserError(
            f"the grid spans {grid.x[-1] - grid.x[0]:.0f} degrees of longitude: open the file with around=(lat, lon) "
            "and radius_km, which resamples what a view needs, up to a hemisphere"
        )
