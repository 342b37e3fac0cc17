"""What an analysis may change: names, units and bounds of control variables."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from openswim.arguments import check_kind, shown
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.variables import DIRECT_PREFIX, HYDROMETEORS, LEVEL_DIMS, SURFACE_DIMS

Kind = Literal["extinction", "content", "effective_radius", "number", "factor", "albedo", "scale"]

ALIASES = {"cloud_liquid": "liquid_content", "cloud_ice": "ice_content", "albedo": "surface_albedo",
           "aerosol": "aerosol_extinction", "scale": "camera_scale"}  # fmt: skip
_SIZES = ("content", "effective_radius", "number")
_OF_PARTICLES = ("aerosol_extinction", *(f"{species}_content" for species in HYDROMETEORS))


@dataclass(frozen=True)
class Variable:
    """A control: its name in a state, what kind it is, the species that it tells of, its dimensions and unit."""

    name: str
    kind: Kind
    species: str
    dims: tuple[str, ...]
    units: str

    @property
    def on_levels(self) -> bool:
        """Whether it is a field of what scatters: it has a floor, and a softplus makes it."""
        return self.kind in ("extinction", "content")


def variable_of(name: str) -> Variable:
    """The control of a name, or of its short name; raises UserError."""
    name = ALIASES.get(name, name)
    if name == "surface_albedo":
        return Variable(name, "albedo", "", ("wavelength", *SURFACE_DIMS), "1")
    if name == "camera_scale":
        return Variable(name, "scale", "", ("camera", "wavelength"), "1")
    if name == "aerosol_factor":
        return Variable(name, "factor", "aerosol", (), "1")
    if name == "aerosol_extinction":
        return Variable(name, "extinction", "aerosol", LEVEL_DIMS, "m-1")
    if name.startswith(DIRECT_PREFIX) and len(name) > len(DIRECT_PREFIX):
        return Variable(name, "extinction", name.removeprefix(DIRECT_PREFIX), LEVEL_DIMS, "m-1")
    units: dict[Any, str] = {"content": "kg m-3", "effective_radius": "m", "number": "m-3"}
    for species in HYDROMETEORS:
        for kind, unit in units.items():
            if name == f"{species}_{kind}":
                return Variable(name, kind, species, LEVEL_DIMS, unit)
    known = [*ALIASES, *ALIASES.values(), "aerosol_factor", *(f"{s}_{k}" for s in HYDROMETEORS for k in _SIZES)]
    near = difflib.get_close_matches(name, known, n=1)
    remedy = f"did you mean {near[0]}?" if near else "such as cloud_liquid, albedo or extinction_cloud"
    raise UserError(f"control {shown(name)} is unknown: {remedy}")


def variables_of(scene: Scene, controls: Sequence[str]) -> tuple[Variable, ...]:
    """The controls of a scene, checked: each once, and each of something that the scene has."""
    if isinstance(controls, str):
        controls = (controls,)
    check_kind("controls", controls, (list, tuple), "name them in a list, such as cloud_liquid, albedo")
    found = tuple(variable_of(str(name)) for name in controls)
    names = [each.name for each in found]
    if not found or len(set(names)) < len(names):
        raise UserError(f"controls {', '.join(names) or 'are missing'}: name each once, such as cloud_liquid, albedo")
    if {"aerosol_factor", "aerosol_extinction"} <= set(names):
        raise UserError("controls: aerosol_factor and aerosol_extinction change the same thing: leave one out")
    for each in found:
        content = f"{each.species}_content"
        if each.kind in _SIZES and content not in scene.data:
            raise UserError(f"control {each.name}: the scene has no {content}; {_instead(scene)}")
        if each.kind in ("effective_radius", "number") and each.name not in scene.data:
            raise UserError(f"control {each.name}: the scene has no such field: put one in, as a first guess")
        if each.kind in ("effective_radius", "number") and not (scene.data[each.name] > 0).any():
            raise UserError(f"control {each.name}: the scene's is nowhere above 0: put a first guess in")
        if each.kind == "number" and f"{each.species}_effective_radius" in scene.data:
            raise UserError(f"control {each.name}: the scene's {each.species}_effective_radius goes before it")
        own = "aerosol_extinction" if each.kind == "factor" else each.name
        if each.kind in ("extinction", "factor") and own not in scene.data:
            raise UserError(f"control {each.name}: the scene has no {own}; {_instead(scene)}")
    return found


def _instead(scene: Scene) -> str:
    """What of particles in a scene can be a control, and what always can."""
    names = map(str, scene.data.data_vars)
    there = [name for name in names if name.startswith(DIRECT_PREFIX) or name in _OF_PARTICLES]
    return f"controls that it has: {', '.join([*there, 'albedo'])}"
