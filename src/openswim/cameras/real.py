"""Constructors of real cameras: lenses as they are, maps, and rays."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from openswim.arguments import numbers, shown, takes
from openswim.cameras import given
from openswim.cameras.checks import require
from openswim.cameras.lenses import Lens
from openswim.cameras.optics import Optics
from openswim.cameras.sizes import Size, shape_of


class RealCameras:
    """What `Camera` has these constructors from; each returns a `Camera`."""

    @classmethod
    @takes
    def fisheye(
        cls: Any,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        size: Size = 800,
        lens: str | Lens = "equidistant",
        fov_deg: float = 180.0,
        *,
        focal_px: float | None = None,
        coefficients: Sequence[float] = (),
        centre: tuple[float, float] | None = None,
        rotation_deg: float = 0.0,
        tilt_deg: float = 0.0,
        tilt_azimuth_deg: float = 0.0,
        mirrored: bool = False,
        affine: Sequence[float] = (1.0, 0.0, 0.0),
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> Any:
        """A fisheye lens looking up, north on top and east on the left unless turned (`openswim.cameras.Optics`).

        `lens`: a model of `openswim.cameras.lenses.FISHEYES` with its `focal_px` (pixels per radian near the axis;
        by default the field of view just fits the shorter side) and `coefficients`.  `centre`: (row, column) of the
        axis, which may lie outside of the frame (default the middle).  `fov_deg`: what is farther than half of it
        from the axis is outside.
        """
        shape, coefficients = shape_of(size), _row("coefficients", coefficients)
        if isinstance(lens, str):
            if focal_px is None:
                require(0 < fov_deg <= 360, f"field of view {fov_deg:g} degrees is not above 0 and up to 360")
                unit = Lens(lens, 1.0, ()).radius_px(np.radians(fov_deg / 2))
                require(not coefficients, f"lens {lens}: coefficients need its focal_px too")
                require(bool(np.isfinite(unit)), f"lens {lens}: does not see {fov_deg:g} degrees")
                focal_px = float(min(shape) / 2 / unit)
            lens = Lens(lens, focal_px, coefficients)
        axis, chip = _axis(centre, shape), _row("affine", affine)
        optics = Optics(
            lens, *axis, rotation_deg, tilt_deg, tilt_azimuth_deg, mirrored, chip, fov_deg,  # type: ignore[arg-type]
        )  # fmt: skip
        return cls("fisheye", shape, lat, lon, x_m, y_m, height_m, fov_deg=fov_deg, lens_optics=optics)

    @classmethod
    @takes
    def pinhole(
        cls: Any,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        azimuth_deg: float = 180.0,
        altitude_deg: float = 10.0,
        size: Size = (600, 900),
        roll_deg: float = 0.0,
        *,
        focal_px: float,
        coefficients: Sequence[float] = (),
        centre: tuple[float, float] | None = None,
        mirrored: bool = False,
        affine: Sequence[float] = (1.0, 0.0, 0.0),
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> Any:
        """A photographer's camera as it is: `coefficients` k1, k2, p1, p2, k3 of Brown and Conrady, as of OpenCV.

        `perspective` is the ideal one.
        """
        shape = shape_of(size, lambda columns: max(1, round(columns / 1.5)))
        lens = Lens("pinhole", focal_px, _row("coefficients", coefficients))
        optics = Optics.pointing(
            lens, _axis(centre, shape), azimuth_deg, altitude_deg, roll_deg,
            mirrored=mirrored, affine=_row("affine", affine),
        )  # fmt: skip
        return cls("pinhole", shape, lat, lon, x_m, y_m, height_m, lens_optics=optics)

    @classmethod
    @takes
    def from_map(
        cls: Any,
        azimuth_deg: ArrayLike,
        zenith_deg: ArrayLike,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> Any:
        """A camera whose calibration says of each pixel where it looks: maps (rows, columns), NaN outside."""
        pixels = given.from_map(azimuth_deg, zenith_deg)
        shape = shape_of(pixels.pixels.inside.shape)
        return cls("map", shape, lat, lon, x_m, y_m, height_m, given=pixels)

    @classmethod
    @takes
    def from_rays(
        cls: Any,
        direction: ArrayLike | None = None,
        lat: float | None = None,
        lon: float | None = None,
        height_m: float = 2.0,
        *,
        towards: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
        width_deg: float | None = None,
        above: Literal["ground", "sea level"] = "ground",
        x_m: float | None = None,
        y_m: float | None = None,
    ) -> Any:
        """Any rays from one place: `direction` (n, 3) or (rows, columns, 3), east, north and up there.

        Or `towards` = (latitude, longitude, height above sea level) of what is looked at, (x, y, height) in a flat
        scene, arrays of (n,) or (rows, columns).  `width_deg`: what a ray stands for (a list of rays: .1).
        """
        require((direction is None) != (towards is None), "rays: give either direction or towards")
        if towards is None:
            assert direction is not None
            pixels = given.from_directions(direction, width_deg)
        else:
            place = (lat, lon) if x_m is None else (y_m, x_m)
            pixels = given.from_places(towards, place, height_m, x_m is None, width_deg)
        shape = shape_of(pixels.pixels.inside.shape)
        return cls("rays", shape, lat, lon, x_m, y_m, height_m, above, given=pixels)


def _axis(centre: Any, shape: tuple[int, int]) -> tuple[float, float]:
    """Row and column of a lens's axis, which is in the middle unless something else is given."""
    if centre is None:
        return (shape[0] - 1) / 2, (shape[1] - 1) / 2
    found = _row("centre", centre)
    require(len(found) == 2, f"camera: centre {shown(centre)}: give (row, column)")
    return found[0], found[1]


def _row(what: str, values: Any) -> tuple[float, ...]:
    """Numbers, as a tuple."""
    return tuple(map(float, numbers(f"camera: {what}", values).ravel()))
