"""An aerosol of one's choice in place of what a scene has."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.optics.aerosol import NAMES, aerosol_profile, stratospheric_layer
from openswim.optics.climatology import climatological_depth
from openswim.optics.layers import ground_of_place_m
from openswim.scene.aerosol import ABOVE_PLACE, DEFAULT_DEPTH, AerosolProfile
from openswim.scene.particles import check_number
from openswim.scene.scene import Scene
from openswim.scene.variables import DIRECT_PREFIX

CLIMATOLOGY, NONE = "climatology", "none"
CHOICES = (*NAMES, CLIMATOLOGY, NONE)


def with_aerosol(
    scene: Scene, kind: str | None = None, optical_depth: float | None = None, time: Any = None,
    place: tuple[float, float] | None = None,
) -> Scene:
    """The scene with a background aerosol of one's choice.

    kind: one of `CHOICES`; default: "continental". optical_depth: at 550 nm above the ground of the place; default:
    .05, or of "climatology" that of the place (latitude, longitude; the scene's by default) and day (of the light; the
    scene's time by default). Whatever aerosol the file gives as the whole of it is left out; smoke and others that a
    file adds to the background stay.
    """
    if kind is not None and kind not in CHOICES:
        raise UserError(f"--aerosol {shown(kind)}: choose one of {', '.join(CHOICES)}")
    if optical_depth is not None:
        check_number("aerosol optical depth (--aod)", optical_depth, 0.0, 100.0)
    if scene.atmosphere is None:
        raise UserError("the scene has no air, and so no background aerosol: leave out --aerosol and --aod")
    if kind == NONE:
        if optical_depth:
            raise UserError("--aerosol none has no optical depth: leave out --aod")
        return _replaced(scene, None, "no aerosol, as chosen")
    named, source = kind or "continental", ""
    if kind == CLIMATOLOGY:
        named = "continental"
        if optical_depth is None:
            when = scene.time if time is None else time
            if when is None:
                raise UserError("--aerosol climatology goes by the day of the year: give the light's time (--sun TIME)")
            optical_depth = climatological_depth(*(place or scene.place), when, ground_of_place_m(scene))
            source = " of the climatology of Linke turbidity"
    layer = aerosol_profile(named, DEFAULT_DEPTH if optical_depth is None else float(optical_depth))
    said = f"{named}, optical depth {layer.optical_depth:.3g}{source} at 550 nm {ABOVE_PLACE}"
    return _replaced(scene, layer, f"background aerosol as chosen: {said}")


def with_stratosphere(scene: Scene, name: str, optical_depth: float | None = None) -> Scene:
    """The scene with aerosol in its stratosphere besides what it has: see `stratospheric_layer`. "none" takes away what
    was chosen before."""
    if scene.atmosphere is None:
        raise UserError("the scene has no air, and so no stratosphere: leave out --stratosphere")
    layer = None if name == NONE else stratospheric_layer(name, optical_depth)
    out = copy(scene)
    kept = [each for each in scene.atmosphere.layers if each.name != "stratosphere"]
    out.atmosphere = replace(scene.atmosphere, aerosol=kept if layer is None else [*kept, layer])
    if layer is not None:
        said = f"aerosol in the stratosphere as chosen: {name}, optical depth {layer.optical_depth:.3g} at 550 nm"
        out.notes = [*scene.notes, said]
    out.wider = None if scene.wider is None else with_stratosphere(scene.wider, name, optical_depth)
    return out


def _replaced(scene: Scene, layer: AerosolProfile | None, note: str) -> Scene:
    out = copy(scene)
    assert scene.atmosphere is not None
    added = [each for each in scene.atmosphere.layers if each.beyond]
    if layer is None:
        left = {name for name, own in scene.optics.items() if own.kind == "aerosol"} | {"aerosol"}
    elif len(added) == len(scene.atmosphere.layers):  # the file's is all there is
        left = {each.name for each in added}
    else:
        left = set()
    fields = {name: "aerosol_extinction" if name == "aerosol" else DIRECT_PREFIX + name for name in left}
    fields = {name: field for name, field in fields.items() if field in scene.data}
    if fields:
        out.data = scene.data.drop_vars(list(fields.values()))
        out.optics = {name: own for name, own in scene.optics.items() if name not in fields}
        note += "; the file's own is left out"
    out.notes = [*(line for line in scene.notes if not line.startswith("gas and aerosol background")), note]
    chosen = [] if layer is None else [layer, *(each for each in added if each.name not in left)]
    out.atmosphere = replace(scene.atmosphere, aerosol=chosen)
    out.wider = None if scene.wider is None else _replaced(scene.wider, layer, note)
    return out
