"""What an eye can be asked, whichever solver's light it is in."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rays import Rays
from openswim.transport.view.seen import View
from openswim.transport.view.sight import Sight

Transmission = tuple[NDArray[np.floating], NDArray[np.bool_]]


class Eye(Protocol):
    """The eye of some rays, at all wavelengths; it may be used from several threads at once."""

    @property
    def sees_outlines(self) -> bool:
        """Whether pixels on outlines are worth several rays."""

    def view(self, rays: Rays) -> View:
        """Radiance along rays of the eye."""

    def sight(self, rays: Rays) -> Sight:
        """What rays of the eye look at, and how far away it is; UserError where the solver cannot tell."""

    def of_others(self, rays: Rays) -> Eye:
        """That of other rays from the same place."""

    def summed(self, rays: Rays) -> View:
        """Radiance along other rays from the same place, of which the sum counts."""

    def through(self, rays: Rays) -> Transmission:
        """Transmittance (n, nw) along other rays from the same place, and whether they end on the ground (n,)."""
