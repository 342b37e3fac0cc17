"""Fixed grids of geostationary imagers: scan angles on the ellipsoid.

GOES-R Product Definition and User's Guide, Vol. 4, Sect. 7.1.2.8; CGMS LRIT/HRIT global specification, Sect. 4.4.3.2.
Imagers that sweep along x (ABI) turn by x about the axis that y has turned; the others (AHI, SEVIRI, FCI) the other
way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers, shown
from openswim.errors import UserError

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FixedGrid:
    """Scan angles x (nx), east, and y (ny), north, in radians of pixel centres.

    lon_0 : longitude below the satellite, degrees; height_m : of the satellite above the equator; semi_major_m,
    semi_minor_m : of the ellipsoid; sweep : the axis of "sweep_angle_axis" (CF).
    """

    x: F64
    y: F64
    lon_0: float
    height_m: float = 35_786_023.0
    semi_major_m: float = 6_378_137.0
    semi_minor_m: float = 6_356_752.31414
    sweep: Literal["x", "y"] = "x"

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            values = numbers(f"grid: {name}", getattr(self, name)).astype(float)
            if values.ndim != 1 or values.size < 2 or not (np.isfinite(values) & (np.abs(values) < 0.5)).all():
                raise UserError(f"grid: {name} must be scan angles in radians of two pixels or more")
            object.__setattr__(self, name, values)
        for name in ("lon_0", "height_m", "semi_major_m", "semi_minor_m"):
            number(f"grid: {name}", getattr(self, name))
        if self.sweep not in ("x", "y"):
            raise UserError(f"grid: sweep {shown(self.sweep)} must be 'x' or 'y'")

    @classmethod
    def of_cf(cls, x: ArrayLike, y: ArrayLike, mapping: Mapping[str, Any]) -> FixedGrid:
        """From the attributes of a CF grid mapping "geostationary"; x and y in radians."""
        return cls(
            np.asarray(x, float), np.asarray(y, float), float(mapping["longitude_of_projection_origin"]),
            float(mapping["perspective_point_height"]), float(mapping["semi_major_axis"]),
            float(mapping["semi_minor_axis"]), "x" if str(mapping.get("sweep_angle_axis", "y")) == "x" else "y",
        )  # fmt: skip

    def to_cf(self) -> dict[str, Any]:
        """Attributes of the CF grid mapping."""
        return {
            "grid_mapping_name": "geostationary", "longitude_of_projection_origin": self.lon_0,
            "latitude_of_projection_origin": 0.0, "perspective_point_height": self.height_m,
            "semi_major_axis": self.semi_major_m, "semi_minor_axis": self.semi_minor_m,
            "sweep_angle_axis": self.sweep,
        }  # fmt: skip

    def part(self, rows: slice, columns: slice) -> FixedGrid:
        """Some rows and columns."""
        return FixedGrid(self.x[columns], self.y[rows], self.lon_0, self.height_m, self.semi_major_m,
                         self.semi_minor_m, self.sweep)  # fmt: skip

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.y.size, self.x.size

    @property
    def _distance_m(self) -> float:
        """Of the satellite from the Earth's centre."""
        return self.height_m + self.semi_major_m

    def _direction(self) -> F64:
        """(ny, nx, 3) away from the satellite; axes: to the Earth's centre, east, north."""
        x, y = np.meshgrid(self.x, self.y)
        if self.sweep == "x":
            parts = np.cos(x) * np.cos(y), np.sin(x), np.cos(x) * np.sin(y)
        else:
            parts = np.cos(x) * np.cos(y), np.sin(x) * np.cos(y), np.sin(y)
        return np.stack(parts, axis=-1)

    def latlon(self) -> tuple[F64, F64]:
        """Geodetic latitude and longitude (ny, nx) in degrees of what pixels see at sea level; NaN beside the Earth."""
        d, far = self._direction(), self._distance_m
        flat = (self.semi_major_m / self.semi_minor_m) ** 2
        a = d[..., 0] ** 2 + d[..., 1] ** 2 + flat * d[..., 2] ** 2
        b, c = -2 * far * d[..., 0], far**2 - self.semi_major_m**2
        with np.errstate(invalid="ignore"):
            reach = (-b - np.sqrt(b**2 - 4 * a * c)) / (2 * a)
        toward = reach[..., None] * d
        out, east, north = far - toward[..., 0], toward[..., 1], toward[..., 2]
        lat = np.degrees(np.arctan2(flat * north, np.hypot(out, east)))
        lon = self.lon_0 + np.degrees(np.arctan2(east, out))
        return lat, (lon + 180.0) % 360.0 - 180.0

    def _place(self, lat: ArrayLike, lon: ArrayLike) -> tuple[F64, F64, F64]:
        """Out of the Earth toward the satellite, east and north (m) of places at sea level."""
        phi, away = np.radians(np.asarray(lat, float)), np.radians(np.asarray(lon, float) - self.lon_0)
        flat = (self.semi_minor_m / self.semi_major_m) ** 2
        normal = self.semi_major_m / np.sqrt(np.cos(phi) ** 2 + flat * np.sin(phi) ** 2)
        return normal * np.cos(phi) * np.cos(away), normal * np.cos(phi) * np.sin(away), normal * flat * np.sin(phi)

    def index(self, lat: ArrayLike, lon: ArrayLike) -> tuple[F64, F64]:
        """Row and column, with fractions, of places at sea level in a grid of even steps; NaN where they are hidden."""
        out, east, north = self._place(lat, lon)
        ahead, up = self._distance_m - out, north
        reach = np.sqrt(ahead**2 + east**2 + up**2)
        if self.sweep == "x":
            x, y = np.arcsin(east / reach), np.arctan2(up, ahead)
        else:
            x, y = np.arctan2(east, ahead), np.arcsin(up / reach)
        hidden = self.view(lat, lon)[0] > 90.0
        row = (y - self.y[0]) / (self.y[-1] - self.y[0]) * (self.y.size - 1)
        column = (x - self.x[0]) / (self.x[-1] - self.x[0]) * (self.x.size - 1)
        return np.where(hidden, np.nan, row), np.where(hidden, np.nan, column)

    def view(self, lat: ArrayLike, lon: ArrayLike) -> tuple[F64, F64]:
        """Zenith angle and azimuth (clockwise from north) of the satellite at places on the ellipsoid, degrees."""
        out, east, north = self._place(lat, lon)
        phi, away = np.radians(np.asarray(lat, float)), np.radians(np.asarray(lon, float) - self.lon_0)
        to = np.stack([self._distance_m - out, -east, -north], axis=-1)
        to /= np.linalg.norm(to, axis=-1, keepdims=True)
        outward = to[..., 0] * np.cos(away) + to[..., 1] * np.sin(away)  # from the Earth's axis
        up = outward * np.cos(phi) + to[..., 2] * np.sin(phi)
        n = to[..., 2] * np.cos(phi) - outward * np.sin(phi)
        e = to[..., 1] * np.cos(away) - to[..., 0] * np.sin(away)
        return np.degrees(np.arccos(np.clip(up, -1, 1))), np.degrees(np.arctan2(e, n)) % 360.0
