"""A scene with some of its species of particles alone: clouds without aerosol, or one kind by itself."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.scene import Scene
from openswim.scene.variables import DIRECT_PREFIX, HYDROMETEORS

CLOUDS, AEROSOL = "clouds", "aerosol"


def only(scene: Scene, *names: str) -> Scene:
    """The scene, and the wider ones around it, with the species that are named; gases and ground stay.

    "clouds" stands for all that is not aerosol, "aerosol" for all that is, its background included, which otherwise
    goes.
    """
    present = {name: _is_aerosol(scene, name) for level in scene.levels for name in level.species}
    background = scene.atmosphere is not None and bool(scene.atmosphere.layers)
    groups = {
        CLOUDS: [name for name, aerosol in present.items() if not aerosol],
        AEROSOL: [name for name, aerosol in present.items() if aerosol],
    }
    for name in names:
        if name not in present and not groups.get(name) and not (name == AEROSOL and background):
            there = [*present, *(group for group, members in groups.items() if members and group not in present)]
            there += [AEROSOL] * (background and AEROSOL not in there)
            raise UserError(f"--only {shown(name)}: the scene has {', '.join(there) or 'no particles'}")
    kept = {member for name in names for member in (name, *groups.get(name, ()))}
    return _with(scene, kept, AEROSOL in names, f"only {', '.join(names)} of its particles, as chosen")


def _is_aerosol(scene: Scene, name: str) -> bool:
    optics = next((level.optics[name] for level in scene.levels if name in level.optics), None)
    return name == AEROSOL or (optics is not None and optics.kind == AEROSOL)


def _with(scene: Scene, kept: set[str], background: bool, note: str) -> Scene:
    gone = [name for name in scene.species if name not in kept]
    parts = ("content", "effective_radius", "number")
    fields = [f"{name}_{part}" for name in gone if name in HYDROMETEORS for part in parts]
    fields += [f"{DIRECT_PREFIX}{name}" for name in gone] + ["aerosol_extinction"] * (AEROSOL in gone)
    out = copy(scene)
    out.data = scene.data.drop_vars([name for name in fields if name in scene.data])
    out.optics = {name: optics for name, optics in scene.optics.items() if name not in gone}
    if not background and scene.atmosphere is not None:
        out.atmosphere = replace(scene.atmosphere, aerosol=None)
    out.notes = [*scene.notes, note]
    out.wider = None if scene.wider is None else _with(scene.wider, kept, background, note)
    return out
