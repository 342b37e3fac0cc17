"""The first start: another process compiles the sweeps while this one compiles the march and the view.

Numba compiles in one thread. What the other has compiled is found in the cache on disk; where it fails, or there is no
cache, everything is compiled here as always.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from openswim.transport.air.shells import no_volume
from openswim.transport.beam.within_cells import bend_cells
from openswim.transport.diffuse.moments import Moments, nothing_coarser, places
from openswim.transport.diffuse.multigrid import Trace, coarse_to_fine
from openswim.transport.diffuse.optical_grid import at_another_wavelength, optical_grid
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.diffuse.sweep import share_ordinates
from openswim.transport.diffuse.sweeper import Sweeper
from openswim.transport.engine.eye_ways import Eye
from openswim.transport.engine.ordinates import lebedev
from openswim.transport.engine.pack import LANES, PACK
from openswim.transport.engine.scratch import Pool
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.volume import DEGREE, blank_fields, tidy
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.scatterers import Scatterers
from openswim.transport.view.source_function import FieldAt, thickest_around, view_source

_LONGEST_S = 300.0
_other: subprocess.Popen | None = None


def begin() -> None:
    """Start the other process, unless the sweeps have been compiled before or there is but one core."""
    global _other
    if _other is not None or (os.cpu_count() or 1) < 2 or _compiled():
        return
    run = f"from {__name__} import compile_sweeps; compile_sweeps()"
    quiet = subprocess.DEVNULL
    try:
        _other = subprocess.Popen([sys.executable, "-c", run], stdin=quiet, stdout=quiet, stderr=quiet)
    except OSError:
        return
    atexit.register(_other.kill)


def wait() -> None:
    """Until the other process has ended, if there is one; meanwhile what a view will need is compiled."""
    if _other is not None:
        if _other.poll() is None:
            compile_view()
        try:
            _other.wait(_LONGEST_S)
        except subprocess.TimeoutExpired:
            _other.kill()


def _compiled() -> bool:
    cache = share_ordinates.stats.cache_path
    return cache is not None and any(Path(cache).glob("sweep.share_ordinates*.nbi"))


def compile_view() -> None:
    """The source of a few nodes toward an eye."""
    shape = (2, LANES, LANES)
    nz, ny, nx = shape
    moments = Moments(places(np.zeros((nz, ny, 1), bool)), np.zeros((1, DEGREE**2, BLOCK), FLOAT))
    axes = np.tile(np.eye(3, dtype=FLOAT), (ny, nx, 1, 1))
    eye, extinction = np.array([0.0, 0.0, 5e3]), np.zeros((1, *shape), FLOAT)
    scatterers = Scatterers(
        extinction, np.array([0.0, 1e3]), np.zeros((PACK, 1), FLOAT), np.zeros((PACK, 1, DEGREE), FLOAT),
        np.zeros((PACK, nz), FLOAT), np.zeros((PACK, nz, DEGREE), FLOAT),
    )  # fmt: skip
    in_threads(
        view_source, scatterers, thickest_around(extinction, False),
        FieldAt.of([moments] * PACK, [nothing_coarser(DEGREE)] * PACK),
        Eye.of(axes, np.zeros((ny, nx, 3)), eye, False), 1, np.array([(0, n) for n in shape]),
        blank_fields(shape, 2 * PACK),
    )  # fmt: skip


def compile_sweeps() -> None:
    """A solve of a few nodes at two wavelengths, on three grids: it calls every kernel of the diffuse light. Before it
    the beam's bend, which the other process will ask for first."""
    shape = (4, 48, 48)
    in_threads(
        bend_cells, np.zeros((1, 1, 1, 1), FLOAT), 0, np.ones(1, FLOAT), np.zeros((1, 1, 3)), np.zeros(1), np.ones(2),
        tidy(no_volume()),
    )  # fmt: skip
    nz, ny, nx = shape
    extinction = np.zeros((1, *shape), FLOAT)
    extinction[:, 1:3, 8:24, 8:24] = 0.03
    forward = (0.7 ** np.arange(DEGREE)).astype(FLOAT)
    coefficients = Coefficients(
        np.ones(1, FLOAT), forward[None], np.full(nz, 1e-5, FLOAT), np.tile(1e-5 * forward, (nz, 1)).astype(FLOAT)
    )
    first = optical_grid(
        extinction, np.full((ny, DEGREE**2, nx), 0.1, FLOAT), np.linspace(0.0, 300.0, nz), np.full(2, 100.0), False,
        True, np.zeros((ny, nx), np.int64), coefficients, np.ones(shape, FLOAT),
    )  # fmt: skip
    ordinates, pool = lebedev(50), Pool()
    traces: list[Trace] | None = None
    for _ in range(2):
        grid = at_another_wavelength(first, coefficients, np.ones(shape, FLOAT))
        sweeper = Sweeper.of(
            grid, np.zeros((len(ordinates.weight), nz), FLOAT), np.zeros((ny, nx), FLOAT), np.ones((ny, nx), FLOAT),
            ordinates, pool,
        )  # fmt: skip
        solution = coarse_to_fine(sweeper, 1e-3, 6, traces)
        traces = traces or solution.traces
