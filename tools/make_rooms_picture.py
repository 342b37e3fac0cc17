"""Make docs/images/rooms.svg and transport.svg: the rooms of the code, and which imports which (docs/architecture.md).

    python tools/make_rooms_picture.py [folder]

Rooms and arrows are those that tests/test_rooms.py finds. Where each is drawn is said below; an arrow that would not
point down, or a room without a place, ends in an error. An arrow that others imply is not drawn.
"""

from __future__ import annotations

import ast
import runpy
import sys
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "docs/images"
# which any room may use; their arrows are not drawn
FOUNDATION = ("errors", "switches", "progress", "system", "arguments", "tables", "srgb")
CONDUCTORS = "solve · solve_grid · plan · field · tiled"  # the files of transport beside its rooms


class Place(NamedTuple):
    """A room in a picture: row from the top, column of its middle, width in columns, and what it does."""

    row: float
    column: float
    width: float
    about: str


HOUSE = {
    "cli": Place(-0.75, 4.4, 1.5, "the command line"),
    "validation": Place(0.88, 1.55, 1.5, "how far off we are"),
    "assimilation": Place(0.0, 3.5, 1.7, "clouds by what is seen"),
    "comparison": Place(0.88, 3.45, 1.6, "frames beside skies"),
    "stations": Place(1.75, 4.75, 1.3, "light through time"),
    "films": Place(0.88, 9.75, 1.2, "skies in motion"),
    "batches": Place(0.88, 5.05, 1.3, "pictures by plan"),
    "satellites": Place(0.88, 8.3, 1.5, "imagers in space"),
    "observations": Place(1.75, 2.9, 1.6, "cameras by their frames"),
    "rendering": Place(0.88, 6.6, 1.5, "openswim.render"),
    "lighting": Place(2.3, 6.6, 1.5, "openswim.light"),
    "kept_light": Place(3.85, 8.9, 1.35, "light on disk"),
    "pictures": Place(3.05, 5.5, 1.6, "a camera in the light"),
    "colour": Place(4.75, 2.3, 1.2, "what an eye sees"),
    "fluxes": Place(4.75, 3.9, 1.35, "W m⁻² on a plane"),
    "heavens": Place(3.85, 5.5, 1.5, "moon, stars, night"),
    "solver": Place(4.75, 8.9, 1.35, "asks transport"),
    "readers": Place(6.1, 4.55, 1.3, "files to scenes"),
    "transport": Place(6.1, 7.35, 3.4, "how light travels"),
    "lights": Place(7.6, 0.95, 1.5, "sun, its spectrum"),
    "cameras": Place(7.6, 2.75, 1.5, "pixels to rays"),
    "optics": Place(8.5, 4.8, 1.5, "matter in light"),
    "ground": Place(7.6, 6.65, 1.5, "maps, reflectance"),
    "options": Place(7.6, 8.5, 1.5, "what one may ask"),
    "scene": Place(9.4, 4.72, 9.4, "grid, fields, air, phase functions, rays: what the world is"),
    "foundation": Place(10.25, 4.72, 9.4, "every room may use these"),
}
# Arrows that would run behind rooms go down between them, at this column.
BETWEEN = {
    ("cli", "validation"): 2.4,
    ("validation", "cameras"): 3.08, ("validation", "readers"): 3.18, ("kept_light", "lights"): 3.3,
    ("observations", "cameras"): 3.05, ("observations", "lights"): 1.53,
    ("kept_light", "readers"): 4.75, ("ice", "engine"): 0.4,
}  # fmt: skip
TRANSPORT = {
    "linear": Place(0, 3.0, 1.9, "a linear twin of fast, its adjoint"),
    CONDUCTORS: Place(1, 3.0, 4.7, "conduct the rooms below, and are what the solver asks for"),
    "montecarlo": Place(2, 4.6, 1.9, "paths of photons: the reference"),
    "view": Place(3, 3.0, 1.9, "from light to what an eye sees"),
    "ice": Place(4, 1.2, 1.5, "rays through crystals"),
    "swim": Place(4, 3.0, 1.9, "the paper's own estimate"),
    "lit": Place(5.6, 3.0, 1.9, "solved light, without an eye"),
    "columns": Place(6.6, 1.6, 1.9, "each column by itself"),
    "diffuse": Place(7.1, 4.4, 1.9, "sweeps: scattered many times"),
    "beam": Place(7.6, 1.6, 1.9, "the sun's beam in the grid"),
    "ground_light": Place(8.6, 1.6, 1.9, "light on the ground, its shape"),
    "medium": Place(10, 3.0, 1.9, "the plan, and its grid"),
    "air": Place(11, 3.0, 1.9, "the clear sky in shells"),
    "march": Place(12, 3.0, 1.9, "along an eye ray"),
    "engine": Place(13, 3.0, 1.9, "packs, threads, scratch"),
}


class Wall(NamedTuple):
    """A line between rows that arrows cross downward only, and its name."""

    row: float
    first: float
    last: float
    text: str


HOUSE_WALLS = [Wall(7.12, 5.5, 9.4, "wall: optics | transport")]
TRANSPORT_WALLS = [
    Wall(4.82, 0.1, 5.5, "wall: lit grid | viewer"),
    Wall(9.32, 0.1, 5.5, "wall: plan | values"),
]
INK, FAINT, PAPER, WALL = "#22303c", "#5b6b78", "#fffdf8", "#b4552d"
COLOURS = ("#dcebf7", "#e7f1e1", "#fbeed3")  # of rooms that users meet, of those that light passes, of what is given
USERS = {"cli", "observations", "comparison", "assimilation", "stations", "films", "batches", "satellites",
         "validation", "rendering", "lighting", "kept_light", "pictures", "solver", "heavens", CONDUCTORS}  # fmt: skip
GIVEN = {"ground", "optics", "options", "cameras", "lights", "scene", "readers", "foundation", "medium", "air", "march",
         "engine"}  # fmt: skip
BOX = 46  # px, height of a room


def reduced(arrows: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """Those arrows which no others imply."""

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        left = list(arrows.get(start, ()))
        while left:
            node = left.pop()
            if node not in found:
                found.add(node)
                left += arrows.get(node, ())
        return found

    return {a: {b for b in to if not any(b in reached(c) for c in to - {b})} for a, to in sorted(arrows.items())}


def imports(found: Mapping[str, Any]) -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Arrows between rooms, and between those of transport, by what is imported and by names asked of the package."""
    homes = runpy.run_path(str(ROOT / "src/openswim/__init__.py"))["_HOME"]
    between: dict[str, set[str]] = {}
    for name, others in found["imports"]().items():
        asked = {
            homes[node.attr]
            for node in ast.walk(found["trees"]()[name])
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "openswim"
            if node.attr in homes
        }
        for other in others | asked:
            between.setdefault(name, set()).add(other)
    house: dict[str, set[str]] = {room: set() for room in found["ORDER"] if room not in ("__main__", *FOUNDATION)}
    inside: dict[str, set[str]] = {room: set() for room in (CONDUCTORS, *found["TRANSPORT"])}
    for name, others in between.items():
        for other in others:
            a, b = name.split(".")[1:3], other.split(".")[1:3]
            if a[0] in house and b[0] in house and a[0] != b[0]:
                house[a[0]].add(b[0])
            if a[0] == b[0] == "transport" and len(a) == len(b) == 2:
                one, two = (room if room in inside else CONDUCTORS for room in (a[1], b[1]))
                inside[one] |= {two} - {one}
    return reduced(house), reduced(inside)


def drawn(
    places: Mapping[str, Place], arrows: Mapping[str, set[str]], walls: list[Wall], step: tuple[float, float],
    title: str,
) -> str:  # fmt: skip
    """An SVG of rooms, arrows and walls; step: pixels of a column and of a row."""
    missing = {room for room, to in arrows.items() for room in (room, *to)} - places.keys()
    if missing:
        raise SystemExit(f"tools/make_rooms_picture.py: give {sorted(missing)} a place")
    dx, dy = step
    left, top = 18.0, 62.0 - dy * min(p.row for p in places.values())
    width = left * 2 + dx * max(p.column + p.width / 2 for p in places.values())
    height = top + dy * max(p.row for p in places.values()) + BOX + 20
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="Helvetica, Arial, DejaVu Sans, sans-serif">',
        f"<title>{escape(title)}</title>",
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 1 L10 5 L0 9 z" fill="{FAINT}"/></marker></defs>',
        f'<rect width="100%" height="100%" rx="12" fill="{PAPER}"/>',
        f'<text x="{left}" y="34" font-size="19" font-weight="bold" fill="{INK}">{escape(title)}</text>',
    ]
    middle = {room: left + dx * p.column for room, p in places.items()}
    upper = {room: top + dy * p.row for room, p in places.items()}
    for wall in walls:
        x1, x2, y = left + dx * wall.first, left + dx * wall.last, top + dy * wall.row
        out.append(f'<path d="M{x1:.1f} {y:.1f} H{x2:.1f}" stroke="{WALL}" stroke-width="2.5" stroke-dasharray="9 5"/>')
    enters = {room: sorted((middle[a], a) for a, to in arrows.items() if room in to) for room in places}
    leaves = {room: sorted((middle[b], b) for b in arrows.get(room, ())) for room in places}
    for a, to in arrows.items():
        for b in sorted(to):
            if upper[a] + BOX >= upper[b]:
                raise SystemExit(f"tools/make_rooms_picture.py: {a} imports {b}, which is not drawn below it")
            x1 = _port(middle[a], places[a].width * dx, leaves[a], b)
            x2 = _port(middle[b], places[b].width * dx, enters[b], a)
            if places[b].width > 3:  # straight down where there is room
                x2 = min(max(x1, middle[b] - places[b].width * dx / 2 + 20), middle[b] + places[b].width * dx / 2 - 20)
            y1, y2 = upper[a] + BOX, upper[b] - 2
            path = f"M{x1:.1f} {y1:.1f}"
            if (a, b) in BETWEEN:
                x = left + dx * BETWEEN[a, b]
                over = max((upper[r] + BOX for r in places if r in arrows and upper[r] + BOX < y2 - 8), default=y1)
                under = min(y1 + 0.45 * dy, over)
                path += _curve(x1, y1, x, under) + f" V{over:.1f}"
                x1, y1 = x, over
            out.append(
                f'<path d="{path}{_curve(x1, y1, x2, y2)}" '
                f'fill="none" stroke="{FAINT}" stroke-width="1.5" marker-end="url(#tip)"/>'
            )
    for room, p in places.items():
        if room != "foundation" and room not in arrows:
            continue
        fill = COLOURS[0 if room in USERS else 2 if room in GIVEN else 1]
        name = " · ".join(FOUNDATION) if room == "foundation" else room
        x, y = middle[room], upper[room]
        out.append(
            f'<rect x="{x - p.width * dx / 2:.1f}" y="{y:.1f}" width="{p.width * dx:.1f}" height="{BOX}" rx="8" '
            f'fill="{fill}" stroke="{INK}" stroke-width="1.2"/>'
        )
        for text, down, size, weight, ink in ((name, 19, 15, "bold", INK), (p.about, 36, 11.5, "normal", FAINT)):
            out.append(
                f'<text x="{x:.1f}" y="{y + down:.1f}" font-size="{size}" font-weight="{weight}" fill="{ink}" '
                f'text-anchor="middle">{escape(text)}</text>'
            )
    for wall in walls:  # over the arrows
        x, y = left + dx * wall.last, top + dy * wall.row
        out.append(
            f'<text x="{x:.1f}" y="{y - 6:.1f}" font-size="12" text-anchor="end" fill="{WALL}" stroke="{PAPER}" '
            f'stroke-width="4" '
            f'paint-order="stroke">{escape(wall.text)}</text>'
        )
    return "\n".join([*out, "</svg>"]) + "\n"


def _curve(x1: float, y1: float, x2: float, y2: float) -> str:
    bend = 0.6 * (y2 - y1)
    return f" C{x1:.1f} {y1 + bend:.1f} {x2:.1f} {y2 - bend:.1f} {x2:.1f} {y2:.1f}"


def _port(middle: float, width: float, others: list[tuple[float, str]], one: str) -> float:
    """Where at a room's side an arrow begins or ends: side by side, in the order of the rooms at their other ends."""
    which = [name for _, name in others].index(one)
    return middle + (which - (len(others) - 1) / 2) * min(0.7 * width / max(1, len(others)), 34)


def pictures(found: Mapping[str, Any] | None = None) -> dict[str, str]:
    """The files of docs/images by their names; ``found``: what tests/test_rooms.py defines, if it is known."""
    house, inside = imports(found or runpy.run_path(str(ROOT / "tests/test_rooms.py")))
    return {
        "rooms.svg": drawn(
            HOUSE, house, HOUSE_WALLS, (92, 92), "The rooms of openswim: a room imports what its arrows reach"
        ),
        "transport.svg": drawn(TRANSPORT, inside, TRANSPORT_WALLS, (150, 70), "Inside transport"),
    }


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    for name, text in pictures().items():
        (folder / name).write_text(text, "utf-8")
