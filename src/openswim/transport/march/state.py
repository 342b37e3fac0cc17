"""What the march hands about: the world that rays go through, what is at a place, and what each ray has gathered.

Named tuples of arrays and numbers, which Numba takes apart when it compiles: they cost what their parts would.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import PACK, flat, put, read, spread, write
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.cloud_detail import SCRATCH, Detail
from openswim.transport.march.volume import DEGREE, Shells, Volume, blank_fields
from openswim.transport.march.walk import BATCH, PLACE, PLACE_LEVEL, WALK

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ZERO, _ONE = FLOAT(0.0), FLOAT(1.0)

IN_TURN = 4  # rays that walk in turn

# A ray's own numbers: which it is or -1, cosine of the angle to the sun, share of the peak that is resolved
WHICH, ANGLE, SHARE, OWN = 0, 1, 2, 8
LAST = BATCH * PLACE  # where among the places the last one of the batch before is kept

# What is constant along a ray, packs: phase functions of molecules and of aerosol, without the part of its peak that is
# resolved; from SPECIES on what each species scatters of the beam once, then harmonics of the ray's direction
MOLECULES, AEROSOL, SPECIES = 0, PACK, 2 * PACK

# What a ray has gathered, packs: radiance, transmission, depth of the forward peaks to the eye; then a `Sample` where
# it stands, of which the last two are numbers; then scratch of the detail
_RADIANCE, _THROUGH, AHEAD, _SAMPLE = 0, PACK, 2 * PACK, 3 * PACK
DETAIL = 10 * PACK
GATHERED = DETAIL + SCRATCH


class World(NamedTuple):
    """What rays go through, and how finely."""

    shells: Shells
    volume: Volume
    detail: Detail
    sun: F64  # (3,) unit vector toward it
    table: F32  # (species and aerosol, angle, depth, PACK) forward peaks, see `forward_peak.py`
    highest_m: float  # of the ground
    scale: float  # steps over the usual ones
    level_ice: Any  # `LevelIce`


class EyeRays(NamedTuple):
    """Rays (n,) in an order in which those that look at about the same place follow each other."""

    order: NDArray[np.int64]
    origin_m: F64  # (n, 3)
    direction: F64  # (n, 3)
    ends_m: F64  # (n,) as `march_rays` has them, or (0,)
    cone: F64  # (n, 2) width at the origin, m, and what it grows by per metre


class Sample(NamedTuple):
    """What is at a place of a ray, all but the beam per metre. Packs: delta-scaled extinction; what the forward peaks
    scatter besides; source of diffuse light; what is scattered of the beam toward the eye, over it; the beam;
    extinction of the air alone. At the reference wavelength: extinction of all species, and of those that have detail.
    """

    extinction: Any
    forward: Any
    diffuse: Any
    single: Any
    beam: Any
    air: Any
    cloud: Any
    refined: Any


class Gathered(NamedTuple):
    """What a ray has gathered so far, packs: radiance L', transmission e^-tau', depth of the forward peaks."""

    radiance: Any
    through: Any
    ahead: Any


class Ray(NamedTuple):
    """What is constant along a ray."""

    cos_angle: float  # cosine of the angle between it and the way to the sun
    share: Any  # of the forward peaks, that is resolved
    constants: F32  # see `SPECIES`
    peak: F32  # (species and aerosol, depth, PACK) the forward peaks at this angle


class Lanes(NamedTuple):
    """Memory of the rays that are under way, one array a part of the view and a lane: (parts, IN_TURN, ...)."""

    own: F64
    walk: F64
    places: F64
    nodes: F32  # channels of the grid at the place looked at last
    gathered: F32
    constants: F32
    peak: F32

    @classmethod
    def of(cls, parts: int, volume: Volume, table: F32) -> Lanes:
        widest = max(volume.fields.shape[3], GATHERED, SPECIES + volume.species * PACK + DEGREE * DEGREE)
        own, walk, places = (np.zeros((parts, IN_TURN, size)) for size in (OWN, WALK, LAST + PLACE))
        peak = np.zeros((parts, IN_TURN, table.shape[0], table.shape[2], PACK), FLOAT)
        return cls(own, walk, places, *blank_fields((3, parts, IN_TURN), widest), peak)


@part(FINITE, inlined=True)
def lane_of(lanes, part, lane):
    """The memory of one lane."""
    return Lanes(
        lanes.own[part, lane], lanes.walk[part, lane], lanes.places[part, lane], lanes.nodes[part, lane],
        lanes.gathered[part, lane], lanes.constants[part, lane], lanes.peak[part, lane],
    )  # fmt: skip


@part(FINITE)
def begin(lane, species_depth):
    """A ray that has seen nothing."""
    for n in range(GATHERED):
        put(lane.gathered, n, _ZERO)
    write(lane.gathered, _THROUGH, spread(_ONE))
    put(lane.places, LAST + PLACE_LEVEL, -1.0)
    for n in range(species_depth.shape[0]):
        species_depth[n] = _ZERO


@part(FINITE, inlined=True)
def gathered(lane):
    """`Gathered` of a ray, and `Sample` where it stands."""
    got, n = lane.gathered, _SAMPLE
    seen = Gathered(read(got, _RADIANCE), read(got, _THROUGH), read(got, AHEAD))
    return seen, Sample(
        read(got, n), read(got, n + PACK), read(got, n + 2 * PACK), read(got, n + 3 * PACK), read(got, n + 4 * PACK),
        read(got, n + 5 * PACK), flat(got, n + 6 * PACK), flat(got, n + 6 * PACK + 1),
    )  # fmt: skip


@part(FINITE, inlined=True)
def keep(lane, seen, sample):
    """Keep what `gathered` reads."""
    got, n = lane.gathered, _SAMPLE
    write(got, _RADIANCE, seen.radiance)
    write(got, _THROUGH, seen.through)
    write(got, AHEAD, seen.ahead)
    write(got, n, sample.extinction)
    write(got, n + PACK, sample.forward)
    write(got, n + 2 * PACK, sample.diffuse)
    write(got, n + 3 * PACK, sample.single)
    write(got, n + 4 * PACK, sample.beam)
    write(got, n + 5 * PACK, sample.air)
    put(got, n + 6 * PACK, sample.cloud)
    put(got, n + 6 * PACK + 1, sample.refined)
