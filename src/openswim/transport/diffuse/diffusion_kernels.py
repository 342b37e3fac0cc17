"""Conjugate gradients of `diffusion.py`, an iteration in two passes, each row by row. Grids are small: one thread does.

Fields are (nz, ny, width), rows of whole packs: a ghost, the nodes, a ghost, and filling. All but nodes is zero, except
that ghosts of periodic grids are the nodes at the other side. They lie in one row, between LANES zeros on both sides
that packs of neighbours reach into.
"""

from __future__ import annotations

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import LANES, flat, put, read_quadruple, spread_quadruple, write
from openswim.transport.engine.types import FLOAT

_ZERO = FLOAT(0.0)


@part(FINITE)
def step_and_clear(shape, step, along, product, e, residual, inverse, share, cleared, sums):
    """Go a ``step`` ``along``, and solve columns by themselves for what is left; sums (2, LANES): of both
    multiplied, and of what is left, squared."""
    nz, ny, width = shape
    both, square = spread_quadruple(_ZERO), spread_quadruple(_ZERO)
    for j in range(ny):
        for k in range(nz):
            row = LANES + (k * ny + j) * width
            for n in range(row, row + width, LANES):
                write(e, n, read_quadruple(e, n) + step * read_quadruple(along, n))
                left = read_quadruple(residual, n) - step * read_quadruple(product, n)
                write(residual, n, left)
                square += left * left
                if k > 0:
                    left += read_quadruple(share, n) * read_quadruple(cleared, n - ny * width)
                write(cleared, n, left)
        for up in range(nz):
            k = nz - 1 - up
            row = LANES + (k * ny + j) * width
            for n in range(row, row + width, LANES):
                here = read_quadruple(cleared, n) * read_quadruple(inverse, n)
                if up > 0:
                    above = n + ny * width
                    here += read_quadruple(share, above) * read_quadruple(cleared, above)
                write(cleared, n, here)
                both += here * read_quadruple(residual, n)
    write(sums, 0, both)
    write(sums, LANES, square)


@part(FINITE)
def turn_and_multiply(shape, turn, along, new, cleared, own, up, north, east, columns, periodic, product, sums):
    """The next direction, ``cleared`` and ``turn`` times the last one, and the medium's product with it; sums: of both
    multiplied."""
    nz, ny, width = shape
    total = spread_quadruple(_ZERO)
    plane = ny * width
    for j in range(ny):
        to_north = width if j + 1 < ny else -j * width
        to_south = -width if j > 0 else (ny - 1) * width
        for k in range(nz):
            row = LANES + (k * ny + j) * width
            for n in range(row, row + width, LANES):
                write(new, n, read_quadruple(cleared, n) + turn * read_quadruple(along, n))
            if periodic:
                put(new, row, flat(new, row + columns))
                put(new, row + columns + 1, flat(new, row + 1))
        for k in range(nz):
            row = LANES + (k * ny + j) * width
            for n in range(row, row + width, LANES):
                here = read_quadruple(new, n)
                out = read_quadruple(own, n) * here
                out -= read_quadruple(east, n) * read_quadruple(new, n + 1)
                out -= read_quadruple(east, n - 1) * read_quadruple(new, n - 1)
                m = n + to_north
                out -= read_quadruple(north, n) * (read_quadruple(cleared, m) + turn * read_quadruple(along, m))
                m = n + to_south
                out -= read_quadruple(north, m) * (read_quadruple(cleared, m) + turn * read_quadruple(along, m))
                if k > 0:
                    out -= read_quadruple(up, n) * read_quadruple(new, n - plane)
                if k + 1 < nz:
                    out -= read_quadruple(up, n + plane) * read_quadruple(new, n + plane)
                write(product, n, out)
            put(product, row, _ZERO)  # ghosts have none
            put(product, row + columns + 1, _ZERO)
            for n in range(row, row + width, LANES):
                total += read_quadruple(new, n) * read_quadruple(product, n)
    write(sums, 0, total)
