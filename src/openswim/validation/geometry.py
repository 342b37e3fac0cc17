"""Homogeneous bodies with sharp edges, from the words of a `geometry` attribute to extinction on a grid."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.grid import THINNEST_M

Array = NDArray[np.float64]

# Odd numbers: axes meet a sphere's surface midway between nodes, so that it ends within one cell and not two
_CELLS_ACROSS = 97, 145
_CELL_DEPTH = 0.28  # where the more do not suffice: nodes give what is opaque a skin of a cell
_RIM = 0.001  # of a cell, in which a box ends above and below,
_LEAST_RIM = 1.01e-3 * THINNEST_M  # but no thinner (km) than a layer may be
_SUBSAMPLES = 6  # per cell and axis, for the share of a cell that a sphere fills
_NUMBER = r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?"


@dataclass(frozen=True)
class Body:
    """A sphere or an axis-parallel box; lengths in km, extinction in 1/km."""

    shape: str
    centre: Array  # (3,)
    half_size: Array  # (3,) radius, or half the edges
    extinction: float

    def in_sphere(self, x: Array, y: Array, z: Array) -> NDArray[np.bool_]:
        offset = [(a - c) / h for a, c, h in zip((x, y, z), self.centre, self.half_size, strict=True)]
        return np.asarray(offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2 <= 1)


def parse_body(text: str) -> Body:
    """Read "sphere: centre (0,0,1) km radius 0.5 extinction 20/km" or the like for a box.

    A box is given by a centre and a size (one edge or three; `half` before it: half edges) or by two corners.
    """
    shape = "sphere" if "sphere" in text.lower() else "box" if re.search(r"(?i)box|cube|cuboid", text) else ""
    if not shape:
        raise UserError(f"geometry {text!r} is neither a grid nor a sphere nor a box")
    extinction = _after(r"extinction|beta", text)
    triples = [
        (word.lower(), np.array([float(n) for n in re.findall(_NUMBER, numbers)]))
        for word, numbers in re.findall(
            rf"([\w -]*?)\W*[(\[]\s*({_NUMBER}(?:[,\s]+{_NUMBER}){{2}})\s*[)\]]", text
        )
    ]
    if shape == "sphere":
        if len(triples) != 1:
            raise UserError(f"geometry {text!r}: the sphere's centre (x,y,z) is missing")
        radius = _after("radius", text)
        return Body(shape, triples[0][1], np.full(3, radius), extinction)
    centre, half_size = _box_extent(text, triples)
    return Body(shape, centre, half_size, extinction)


def _box_extent(text: str, triples: list[tuple[str, Array]]) -> tuple[Array, Array]:
    named = next((value for word, value in triples if "cent" in word), None)
    others = [(word, value) for word, value in triples if "cent" not in word]
    if named is None and len(others) == 2:
        (_, low), (_, high) = others
        return (low + high) / 2, np.abs(high - low) / 2
    if named is not None and len(others) == 1:
        word, size = others[0]
        return named, size if "half" in word else size / 2
    if named is not None and not others:
        edge = _after(r"edge|size|side|width", text)
        return named, np.full(3, edge if re.search(r"(?i)half", text) else edge / 2)
    raise UserError(f"geometry {text!r}: the box needs a centre and a size, or two corners")


def _after(word: str, text: str) -> float:
    match = re.search(rf"(?i)(?:{word})s?\s*[:=]?\s*({_NUMBER})", text)
    if not match:
        raise UserError(f"geometry {text!r}: no number after {word!r}")
    return float(match.group(1))


def cells_across(body: Body) -> int:
    """Into how many cells a body is divided: the more, the thicker it is."""
    depth = 2 * body.half_size.max() * body.extinction
    return int(np.clip(2 * (depth / _CELL_DEPTH // 2) + 1, *_CELLS_ACROSS))


def grid_body(body: Body, across: int | None = None) -> tuple[Array, Array, Array, Array]:
    """Node coordinates x, y, z (km) and extinction (nz, ny, nx) in 1/km of a body ``across`` cells wide (default
    `cells_across`).

    Of a sphere a node has the share of the cell around it that lies inside; nodes reach two cells beyond. A box has
    nodes on its faces: the grid, beyond which nothing is, ends with it, but for a thin rim above and below.
    """
    across = across or cells_across(body)
    step = 2 * body.half_size.max() / across
    if body.shape == "box":
        cells = np.maximum(np.ceil(2 * body.half_size / step - 1e-9), 2).astype(int)
        x, y, z = (c + np.linspace(-h, h, n + 1) for c, h, n in zip(body.centre, body.half_size, cells, strict=True))
        rim = max(_RIM * (z[1] - z[0]), _LEAST_RIM)
        full = np.full((z.size, y.size, x.size), body.extinction)
        return x, y, np.concatenate([[z[0] - rim], z, [z[-1] + rim]]), np.pad(full, ((1, 1), (0, 0), (0, 0)))
    cells = np.ceil(body.half_size / step).astype(int) + 2
    x, y, z = (c + step * np.arange(-n, n + 1) for c, n in zip(body.centre, cells, strict=True))
    offsets = step * ((np.arange(_SUBSAMPLES) + 0.5) / _SUBSAMPLES - 0.5)
    share = np.zeros((z.size, y.size, x.size))
    for dz in offsets:
        for dy in offsets:
            for dx in offsets:
                share += body.in_sphere(x[None, None] + dx, y[None, :, None] + dy, z[:, None, None] + dz)
    return x, y, z, body.extinction * share / _SUBSAMPLES**3
