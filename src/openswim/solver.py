"""The face of transport: from a scene and a sun to a field of light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, numbers, shown, takes
from openswim.errors import UserError
from openswim.ground.surface import settled, surface_of
from openswim.lights.eclipses import MoonShadow
from openswim.optics.limits import check_wavelengths
from openswim.optics.matter import Matter, matter_of
from openswim.options import Options
from openswim.scene.rays import Rays
from openswim.scene.scene import Scene
from openswim.transport import EarlierLight, Field, ReferenceField, solve
from openswim.transport.medium.plan import lit_in_parts
from openswim.transport.plan import Plan

if TYPE_CHECKING:
    from openswim.transport.linear.field import LinearField
    from openswim.transport.linear.of_matter import SceneCore

F64 = NDArray[np.float64]

_NOT_UNIT = 0.1  # off a length of 1: people write unit vectors with a digit or two
NADIR = np.array([0.0, 0.0, -1.0])  # a sun there lights nothing


@dataclass(frozen=True)  # for an __init__ of its own: Python's messages have the name of it
class Solver(Options):
    """How light is solved for: see `Options`, which name all that may be chosen."""

    def solve(
        self,
        scene: Scene,
        sun_direction: ArrayLike,
        wavelengths_nm: ArrayLike = (615.0, 546.0, 450.0),
        plan: Plan | None = None,
        shadow: MoonShadow | None = None,
        earlier: EarlierLight | None = None,
        light: str = "sun",
    ) -> Field | ReferenceField:
        """Solve the field of light of ``scene`` lit from ``sun_direction`` (unit vector in the scene frame).

        plan: the `Field.plan` of a scene like it, so that only values differ: nothing is decided anew. shadow: the
        moon's in an eclipse of the sun. Solver linear takes neither. earlier: what a like scene's solve by the same
        ``light`` has left, from which `fast` begins; see `openswim.light`.
        """
        wavelengths, sun = _checked(wavelengths_nm), _checked_direction(sun_direction)
        scene = settled(scene)
        if self.name == "linear":
            if plan is not None or shadow is not None:
                raise UserError("solver linear takes no plan and knows no eclipse of the sun: take fast")
            return self._linear(scene, sun, wavelengths)
        matter = self._matter(scene, wavelengths, plan)
        surface = surface_of(scene, matter.wavelengths_nm)
        return solve(self, matter, surface, sun, plan, shadow, earlier, light)

    def solve_starlit(
        self, scene: Scene, wavelengths_nm: ArrayLike = (615.0, 546.0, 450.0), lamps: F64 | None = None,
        earlier: EarlierLight | None = None,
    ) -> Field | ReferenceField:
        """The field of light of ``scene`` under an even sky of L' = 1 beyond its air, without a sun.

        lamps (nw,): L' of the ground where it shines with 1 nW cm-2 sr-1 (`ground.cities`); None: it is dark.
        """
        if self.name in ("reference", "linear"):
            raise UserError(f"solver {self.name} follows no light from the night's sky: take fast")
        wavelengths = _checked(wavelengths_nm)
        scene = settled(scene)
        matter = self._matter(scene, wavelengths, None).starlit()
        surface = surface_of(scene, matter.wavelengths_nm)
        each = None if lamps is None else np.asarray(lamps, float)[matter.terms.which]
        return solve(self, matter, replace(surface, lamps=each), NADIR, None, None, earlier, "starlight")

    @takes
    def linear_core(
        self,
        scene: Scene,
        sun_direction: ArrayLike,
        wavelengths_nm: ArrayLike = (615.0, 546.0, 450.0),
        views: Rays | Sequence[Rays] = (),
        points: ArrayLike | None = None,
        tolerance: float | None = None,
        lean: bool = False,
        single: bool = False,
    ) -> SceneCore:
        """The light of ``scene`` as a function of what its nodes are filled with, with tangent linear and adjoint
        (docs/linear.md).

        Of the solver only the quality, for its ordinates, and the step count, whatever its name is; and the tolerance
        where that is "linear".

        views: rays of an eye each, in the scene frame (`Camera.rays`); points (n, 2): latitude and longitude of
        pyranometers, in flat scenes y and x, m. tolerance: of the diffuse light, by default the solver's, or .001.
        lean: 26 ordinates and 16 moments of the diffuse light, in place of 50 and 25 of them. single: sweeps in single
        precision, twice as fast.
        """
        from openswim.transport.linear.of_matter import core_of

        eyes = [views] if isinstance(views, Rays) else list(views)
        for eye in eyes:
            check_kind("a view", eye, Rays, "give Rays, as camera.rays(scene_frame(scene), ground_height_m) makes them")
        wavelengths, sun = _checked(wavelengths_nm), _checked_direction(sun_direction)
        scene = settled(scene)
        matter = matter_of(scene, wavelengths)
        surface = surface_of(scene, matter.wavelengths_nm)
        element = np.float32 if single else np.float64
        if tolerance is None and self.name == "linear":
            tolerance = self.tolerance
        return core_of(self, matter, surface, sun, eyes, points, tolerance, lean=lean, element=element)

    def _linear(self, scene: Scene, sun: F64, wavelengths: F64) -> LinearField:
        from openswim.transport.linear.field import fast_around, linear_field
        from openswim.transport.linear.of_matter import core_of

        matter = matter_of(scene, wavelengths)
        surface = surface_of(scene, matter.wavelengths_nm)
        core = core_of(self, matter, surface, sun, tolerance=self.tolerance)
        around = solve(fast_around(self), matter, surface, sun)
        assert isinstance(around, Field)
        return linear_field(self, around, core)

    def _matter(self, scene: Scene, wavelengths: F64, plan: Plan | None) -> Matter:
        large = self.name != "reference" and lit_in_parts(scene.grid, "cloud_area_fraction" in scene.data)
        return matter_of(scene, wavelengths, not large, () if plan is None else plan.species)


def _checked(wavelengths_nm: ArrayLike) -> F64:
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    check_wavelengths(wavelengths)
    return wavelengths


def _checked_direction(sun_direction: ArrayLike) -> F64:
    sun = numbers("sun_direction", sun_direction).astype(float)
    if sun.shape != (3,) or not abs(np.linalg.norm(sun) - 1) < _NOT_UNIT:
        raise UserError(f"sun_direction is {shown(sun_direction)}: give a unit vector toward it, in the scene frame")
    return sun
