"""The linear core's light as a field that cameras look at: solver "linear" alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from openswim.options import Options
from openswim.scene.rays import Rays
from openswim.transport.field import Field, FieldEye
from openswim.transport.linear.of_matter import SceneCore
from openswim.transport.linear.operator import State
from openswim.transport.view.seen import View


@dataclass(frozen=True, eq=False)
class LinearEye(FieldEye):
    """An eye in a `LinearField`: radiance is the core's."""

    core: SceneCore
    state: State

    def view(self, rays: Rays) -> View:
        found = super().view(rays)
        return replace(found, radiance=self.core.seen(self.state, rays).T.astype(np.float32))

    def of_others(self, rays: Rays) -> LinearEye:
        other = super().of_others(rays)
        return LinearEye(other.packs, other.terms, self.core, self.state)


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearField(Field):
    """A field whose radiance is the core's; where its rays end, and what shines through to there, is told by packs that
    `fast` has lit loosely."""

    core: SceneCore
    state: State
    options: Options

    @property
    def solver(self) -> Options:
        return self.options

    @property
    def quality(self) -> str:
        return self.solver.quality

    def viewpoint(self, rays: Rays) -> LinearEye:
        eye = super().viewpoint(rays)
        return LinearEye(eye.packs, eye.terms, self.core, self.state)


def fast_around(options: Options) -> Options:
    """Options by which a `LinearField` learns where rays end."""
    return Options("fast", "preview", tolerance=1.0, step=options.step, detail=False, paper_phases=options.paper_phases)


def linear_field(options: Options, around: Field, core: SceneCore) -> LinearField:
    """The field of a core, solved as its scene fills it."""
    _, state = core.forward(core.extinction, core.albedo)
    return LinearField(around.packs, around.terms, around.plan, core=core, state=state, options=options)
