"""The user's own ground."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from openswim.arguments import number
from openswim.errors import UserError

PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Ground:
    """The user's own ground, for `openswim.open_scene(..., ground=...)`.

    albedo : one or more images in any projection (GeoTIFF, or Blue Marble tiles as NASA has them); the finest that
        shows a place is used. Floating-point and 16-bit images are reflectance (16-bit: in 1/10000 unless the file
        states a scale). 8-bit colour pictures with pixels of 100 m and more are taken to be Blue Marble; finer
        ones (aerial photographs) are texture, and lend their contrast and colour to what is known more coarsely.
        Of pictures whose names carry a month, those of the month nearest to the scene's time are used.
    height : one or more digital elevation models, metres above sea level.
    chlorophyll_mg_m3 : of all water; by default .2 in the sea and 2 in lakes.
    mountains : whether those of the default Earth stand beyond the domain, where they are known (docs/ground.md).
    lights : one or more images of the lights of towns in nW cm-2 sr-1, such as annual composites of VIIRS; beyond
        them a coarse map of all the Earth (docs/night.md).

    Model latitudes are taken as geodetic ones of WGS 84, as models' own ground data are.
    """

    albedo: PathLike | Sequence[PathLike] = ()
    height: PathLike | Sequence[PathLike] = ()
    chlorophyll_mg_m3: float | None = None
    mountains: bool = True
    lights: PathLike | Sequence[PathLike] = ()

    def __post_init__(self) -> None:
        given = self.chlorophyll_mg_m3
        if given is not None and not 0.0 < number("chlorophyll_mg_m3", given) <= 100.0:
            raise UserError(f"chlorophyll of {given} mg/m3: give above 0, at most 100")
