"""Eye rays in the frame of the scene."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Rays:
    """n rays away from the observer, in the scene frame.

    `origin_m` is one point (3,) or a point per ray (n, 3), metres; `direction` one unit vector (3,), a
    parallel view, or one per ray (n, 3).  At least one of them has n rows. `width_rad`: the side of
    what a ray stands for, one number or (n,).  `image` (ny, nx): which ray is a pixel's, -1 where none is, of rays
    that make a picture which may be seen by fewer, and how much `alike` neighbours are then
    (`transport/view/sparse.py`), with the light `beside` (n,) that they have anyhow; parts of them make none.
    """

    origin_m: np.ndarray
    direction: np.ndarray
    width_rad: float | np.ndarray = 0.0
    image: np.ndarray | None = None
    alike: float = 0.0
    beside: np.ndarray | None = None

    def __post_init__(self) -> None:
        self.origin_m = np.asarray(self.origin_m, dtype=float)
        self.direction = np.asarray(self.direction, dtype=float)
        if self.origin_m.shape[-1:] != (3,) or self.direction.shape[-1:] != (3,):
            raise ValueError(
                f"rays need vectors of three, got {self.origin_m.shape} and {self.direction.shape}"
            )
        if self.origin_m.ndim == 1 and self.direction.ndim == 1:
            self.direction = self.direction[None]

    def __len__(self) -> int:
        return len(self.origin_m) if self.origin_m.ndim == 2 else len(self.direction)

    def __getitem__(self, part: slice | np.ndarray) -> "Rays":
        """Some of the rays: `rays[i:j]`, or those of an index array."""
        origin = self.origin_m[part] if self.origin_m.ndim == 2 else self.origin_m
        direction = self.direction[part] if self.direction.ndim == 2 else self.direction
        width = self.width_rad if np.ndim(self.width_rad) == 0 else np.asarray(self.width_rad)[part]
        return Rays(origin, direction, width)

    def origins(self) -> np.ndarray:
        """Origins (n, 3), repeated where common (a view, not a copy)."""
        return np.broadcast_to(self.origin_m, (len(self), 3))

    def directions(self) -> np.ndarray:
        """Directions (n, 3), repeated where common (a view, not a copy)."""
        return np.broadcast_to(self.direction, (len(self), 3))
