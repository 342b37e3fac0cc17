"""The light of one scene at one place through time: beam and diffuse, over that above the atmosphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.lighting import light
from openswim.lights import SunTrack
from openswim.pictures.viewpoint import LitScene, Viewpoint
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.stations.clear import ClearLight
from openswim.stations.planes import Planes, relative_diffuse

F64 = NDArray[np.float64]

DARK_DEG = -8.0  # the sun below it: less than .02 W/m2
_FINENESS, _CLEAR_FINENESS = 32, 12  # of the quadrature under clouds, and of a clear sky


@dataclass(frozen=True)
class Place:
    """Where irradiance is wanted, as a camera says it: latitude and longitude, or metres in a flat scene."""

    camera: Camera
    track: SunTrack


@dataclass(frozen=True)
class Light:
    """Over E_TOA: the beam's light (nt, nw), diffuse light (nt, 1 + 2 planes, nw) as of `relative_diffuse`; the gases
    above the place. `visible` (nt,): share of the sun's disc in sight; `open` (nt, nw): transmittance toward that, or
    toward the lowest sky above a hidden sun; `altitude_deg` (nt,): of the light that arrives, or of that sky."""

    beam: F64
    visible: F64
    open: F64
    altitude_deg: F64
    diffuse: F64
    gases: dict[str, float]


def even(scene: Scene) -> bool:
    """Whether the light depends on the sun's altitude alone."""
    return scene.grid is None and scene.ground is None


def of_clear_sky(
    scene: Scene, places: list[Place], planes: Planes, solver: Solver, wavelengths_nm: F64
) -> tuple[list[Light], int]:
    """The light at all places of a scene that is `even`, and how many solves it took."""
    kept: dict[str, Viewpoint] = {}
    lat, lon = scene.place
    camera = Camera.allsky(lat, lon, places[0].camera.height_m, size=2)

    def solve(altitude_deg: float, about_sun: Planes) -> F64:
        lit = light(scene, solver, list(wavelengths_nm), sun=(0.0, altitude_deg))
        kept["any"] = viewpoint = lit.viewpoint(camera)
        return relative_diffuse(viewpoint, about_sun, _CLEAR_FINENESS)

    up = np.concatenate([_lit(place.track) for place in places])
    curve = None
    if not up.size:
        kept["any"] = _by_day(scene, solver, wavelengths_nm).viewpoint(camera)
    else:
        curve = ClearLight(solve, (float(up.min()), float(up.max())), planes)
    found = []
    for place in places:
        track, day = place.track, place.track.lit_altitude_deg > DARK_DEG
        diffuse = np.zeros((day.size, 1 + 2 * len(planes), np.size(wavelengths_nm)))
        if curve is not None:
            diffuse[day] = curve.diffuse(track.lit_altitude_deg[day], track.azimuth_deg[day], planes)
        found.append(Light(*beam_through_time(kept["any"], track, np.flatnonzero(day)), diffuse, kept["any"].gases))
    return found, 1 if curve is None else curve.solves


def of_scene(
    scene: Scene,
    times: NDArray[np.datetime64],
    wanted: NDArray[np.bool_],
    places: list[Place],
    planes: Planes,
    solver: Solver,
    wavelengths_nm: F64,
    step_minutes: float,
) -> tuple[list[Light], int]:
    """The light at all places of any scene at those `times` (nt,) that are `wanted`, and how many solves it took.

    The sun moves; the scene stands. Diffuse light is solved for at most `step_minutes` apart and is linear in time
    between; the beam is followed at every time.
    """
    nt, nw = times.size, np.size(wavelengths_nm)
    high = np.max([place.track.lit_altitude_deg for place in places], axis=0)
    day = np.flatnonzero(wanted & (high > DARK_DEG))
    found = []
    minutes = _minutes(times)
    nodes = _nodes(minutes[day], step_minutes)
    at_nodes: list[list[F64]] = [[] for _ in places]
    viewpoints: list[Viewpoint] = []
    if not day.size:
        lit = _by_day(scene, solver, wavelengths_nm)
        viewpoints = [lit.viewpoint(place.camera) for place in places]
    for node in nodes:
        when = times[0] + np.timedelta64(round(6e4 * float(node)), "ms")
        lit = light(scene, solver, list(wavelengths_nm), time=when)
        viewpoints = [lit.viewpoint(place.camera) for place in places]
        for each, viewpoint in zip(at_nodes, viewpoints, strict=True):
            each.append(relative_diffuse(viewpoint, planes, _FINENESS))
    for number, (place, viewpoint) in enumerate(zip(places, viewpoints, strict=True)):
        dark = place.track.lit_altitude_deg <= DARK_DEG
        diffuse = np.zeros((nt, 1 + 2 * len(planes), nw))
        if day.size:
            values = np.stack(at_nodes[number])
            diffuse[day] = _linear(minutes[day], nodes, values)
            diffuse[dark] = 0.0
        found.append(Light(*beam_through_time(viewpoint, place.track, day), diffuse, viewpoint.gases))
    return found, max(len(nodes), 1)


def _by_day(scene: Scene, solver: Solver, wavelengths_nm: F64) -> LitScene:
    """Where it is dark all the time only the gases are wanted, and a night is the dearest light to solve for."""
    return light(scene, solver, list(wavelengths_nm), sun=(0.0, 10.0))


def _lit(track: SunTrack) -> F64:
    return track.lit_altitude_deg[track.lit_altitude_deg > DARK_DEG]


def beam_through_time(viewpoint: Viewpoint, track: SunTrack, rows: NDArray[np.intp]) -> tuple[F64, F64, F64, F64]:
    """The first fields of `Light`, of the disc at its apparent place at some rows; none of it at others."""
    nt, nw = track.azimuth_deg.size, viewpoint.lit.field.wavelengths_nm.size
    beam, visible, clear, altitude = np.zeros((nt, nw)), np.zeros(nt), np.zeros((nt, nw)), track.lit_altitude_deg.copy()
    if rows.size:
        found = viewpoint.beams(
            *(a[rows] for a in (track.azimuth_deg, track.lit_altitude_deg, track.angular_radius_deg))
        )
        for row, each in zip(rows, found, strict=True):
            beam[row], visible[row], clear[row], altitude[row] = each.direct, each.visible, each.open, each.altitude_deg
    return beam, visible, clear, altitude


def solves_of_scene(
    times: NDArray[np.datetime64], wanted: NDArray[np.bool_], tracks: list[SunTrack], step_minutes: float
) -> int:
    """How many solves `of_scene` takes for places with these tracks of the sun."""
    high = np.max([track.lit_altitude_deg for track in tracks], axis=0)
    return max(_nodes(_minutes(times)[wanted & (high > DARK_DEG)], step_minutes).size, 1)


def _minutes(times: NDArray[np.datetime64]) -> F64:
    return np.asarray((times - times[0]) / np.timedelta64(1, "ms") / 6e4)


def _nodes(minutes: F64, step: float) -> F64:
    """The times themselves, or fewer, at most a step apart."""
    unique = np.unique(minutes)
    if not unique.size:
        return unique
    even_steps = np.linspace(unique[0], unique[-1], int(np.ceil((unique[-1] - unique[0]) / step)) + 1)
    return unique if unique.size <= even_steps.size else even_steps


def _linear(at: F64, nodes: F64, values: F64) -> F64:
    """Values (n, ...) at nodes, linear between them."""
    if nodes.size == 1:
        return np.broadcast_to(values[0], (at.size, *values.shape[1:]))
    left = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, nodes.size - 2)
    share = ((at - nodes[left]) / (nodes[left + 1] - nodes[left])).reshape(-1, *(1,) * (values.ndim - 1))
    return (1 - share) * values[left] + share * values[left + 1]
