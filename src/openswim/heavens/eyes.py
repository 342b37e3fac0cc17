"""An eye in several lights at once: what each sends to it is added."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rays import Rays
from openswim.transport import Field
from openswim.transport.view.eye import Eye, Transmission
from openswim.transport.view.seen import View
from openswim.transport.view.sight import Sight

F64 = NDArray[np.float64]
_PROBES = 256  # rays that tell which light is the brightest


@dataclass(frozen=True, eq=False)
class LitBy:
    """A scene's field in one light, whose solar-relative radiance counts ``strength`` (nw,)."""

    name: str
    field: Field
    strength: F64


@dataclass(frozen=True, eq=False)
class Eyes:
    """One eye in each light's field: used as one is."""

    every: tuple[Eye, ...]
    strength: tuple[F64, ...]
    sees_outlines = True

    @classmethod
    def of(cls, lights: tuple[LitBy, ...], rays: Rays) -> Eyes:
        """The eye of some rays, which share their origin or their direction."""
        return cls(tuple(light.field.viewpoint(rays) for light in lights), tuple(light.strength for light in lights))

    def view(self, rays: Rays) -> View:
        """Radiance along rays from the eye, in all lights. Of a picture by fewer rays the brightest is seen first, and
        the others need the fewer beside it."""
        picture = rays.image is not None
        radiance: F64 = np.zeros(())
        views: list[View] = []
        for n in self._brightest_first(rays) if picture else range(len(self.every)):
            own = replace(rays, beside=_in_units_of(self.strength[n], radiance)) if picture and views else rays
            views.append(self.every[n].view(own))
            radiance = radiance + views[-1].radiance * self.strength[n]
        return replace(views[0], radiance=np.asarray(radiance, np.float32), samples=sum(view.samples for view in views))

    def _brightest_first(self, rays: Rays) -> list[int]:
        """Numbers of the lights, by what some of the rays see."""
        some = rays[:: max(1, len(rays) // _PROBES)]
        light = [float((eye.view(some).radiance * s).mean()) for eye, s in zip(self.every, self.strength, strict=True)]
        return sorted(range(len(light)), key=lambda n: -light[n])

    def sight(self, rays: Rays) -> Sight:
        """What rays look at, whatever the light."""
        return self.every[0].sight(rays)

    def of_others(self, rays: Rays) -> Eyes:
        """That of other rays from the same eye."""
        return replace(self, every=tuple(eye.of_others(rays) for eye in self.every))

    def summed(self, rays: Rays) -> View:
        return self.of_others(rays).view(rays)

    def through(self, rays: Rays) -> Transmission:
        return self.every[0].through(rays)


def _in_units_of(strength: F64, radiance: F64) -> F64:
    """(n,): how much of a light of a ``strength`` (nw,) radiance (n, nw) is, at the wavelength at which it is least."""
    shining = strength > 0
    least = (radiance[:, shining] / strength[shining]).min(axis=-1, initial=1e30)
    return np.where(least < 1e30, least, 0.0)
