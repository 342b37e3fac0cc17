"""The walk through a folder of reference files: what is compared is decided by content, never by name."""

import os
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from openswim.errors import UserError
from openswim.progress import Quiet, job, use
from openswim.scene.phase import HenyeyGreenstein
from openswim.stations.files import kind_of
from openswim.validation import (
    cases3d,
    clearsky,
    colours,
    displays,
    level_crystals,
    measured,
    slab_tables,
    slabs,
    spectral,
    sunpos,
)
from openswim.validation.clearsky import ClearSky
from openswim.validation.night import lights, places, skies, sky_glow
from openswim.validation.reference import Reference, Row, Solver, read_reference
from openswim.validation.reference.phases import PhaseTables, is_phase_table
from openswim.validation.slabs import Slab, radiance

SUFFIXES = (".nc", ".nc4", ".csv")
STATION_SUFFIXES = (".dat", ".gz", ".txt", ".cdf")


class Family(NamedTuple):
    """A kind of reference file: how to tell one, and how to compare it."""

    matches: Callable[[Reference], bool]
    compare: Callable[[Reference, Solver, PhaseTables], Iterator[Row]]


def halos(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Of crystals in all orientations, and of level ones."""
    yield from displays.compare_halos(reference, solver, phases)
    yield from level_crystals.compare_level_crystals(reference, solver, phases)


FAMILIES = (
    Family(cases3d.matches, cases3d.compare),
    Family(slabs.is_slab_file, slabs.compare_slab_file),
    Family(slabs.is_aerosol_file, slabs.compare_aerosol_file),
    Family(slab_tables.is_flux_table, slab_tables.compare_flux_table),
    Family(slab_tables.is_radiance_table, slab_tables.compare_radiance_table),
    Family(slab_tables.is_rayleigh_table, slab_tables.compare_rayleigh_table),
    Family(clearsky.is_sky_file, clearsky.compare_sky_file),
    Family(clearsky.is_space_table, clearsky.compare_space_table),
    Family(clearsky.is_sky_table, clearsky.compare_sky_table),
    Family(sunpos.matches, sunpos.compare),
    Family(colours.matches, colours.compare),
    Family(spectral.matches, spectral.compare),
    Family(measured.matches, measured.compare),
    Family(places.is_star_table, places.compare_stars),
    Family(places.is_planet_table, places.compare_planets),
    Family(places.is_orientation_table, places.compare_orientation),
    Family(places.is_solar_eclipse_table, places.compare_solar_eclipses),
    Family(places.is_eclipse_course, places.compare_eclipse_course),
    Family(places.is_lunar_eclipse_table, places.compare_lunar_eclipses),
    Family(lights.is_moonlight_table, lights.compare_moonlight),
    Family(lights.is_zodiacal_table, lights.compare_zodiacal),
    Family(lights.is_milky_way_table, lights.compare_milky_way),
    Family(lights.is_airglow_table, lights.compare_airglow),
    Family(lights.is_refraction_table, lights.compare_refraction),
    Family(displays.is_rainbow_table, displays.compare_rainbow),
    Family(displays.is_ring_table, displays.compare_rings),
    Family(displays.is_halo_table, halos),
    Family(displays.is_halo_profile, displays.compare_halo_profile),
    Family(skies.is_moonlit_table, skies.compare_moonlit_sky),
    Family(skies.is_illuminance_table, skies.compare_illuminance),
    Family(sky_glow.is_sky_glow, sky_glow.compare_sky_glow),
    Family(skies.is_twilight_fit, skies.compare_twilight_fit),
)


def validate(directory: Path, solver: Solver) -> tuple[list[Row], list[str]]:
    """Compare every reference file below `directory`: rows, worst first, and a line per file left out."""
    if not os.path.isdir(directory):
        raise UserError(f"{directory}: no such folder; name one with reference files ({', '.join(SUFFIXES)})")
    references, skipped = _read_all(directory)
    tables = PhaseTables([])
    for reference in filter(is_phase_table, references):
        with _telling(reference, skipped):
            tables.add(reference)
    rows: list[Row] = []
    if references:
        _warm_up(solver)
    with job("validate", len(references)) as meter:
        for reference in references:
            with use(Quiet()):
                rows += _compare(reference, solver, tables, skipped)
            meter.advance()
    return sorted(rows, key=_badness, reverse=True), skipped


def reference_files(directory: Path) -> list[Path]:
    """The files below a folder that may be references."""
    found = (Path(folder, name) for folder, _, names in os.walk(directory) for name in names)  # folders may vanish
    return sorted(p for p in found if os.path.isfile(p) and (p.suffix in SUFFIXES or _is_station(p)))


def _is_station(path: Path) -> bool:
    """Whether this is a network's file of measured irradiance."""
    with suppress(UserError):
        return path.suffix in STATION_SUFFIXES and kind_of(path) is not None
    return False


def _read_all(directory: Path) -> tuple[list[Reference], list[str]]:
    references, skipped = [], []
    for path in reference_files(directory):
        try:
            references.append(read_reference(path))
        except UserError as error:
            skipped.append(str(error))
    return references, skipped


def _warm_up(solver: Solver) -> None:
    """Have the kernels compiled, so that the CPU time of the first case is its own."""
    with suppress(Exception):  # whatever goes wrong here goes wrong again, and is told, in a case
        slab = Slab(tau=1.0, sza=30.0, omega=0.9, albedo=0.1).solve(solver, HenyeyGreenstein(0.5))
        for upward in (True, False):
            radiance(slab, 20.0, 0.0, upward)
        ClearSky(solver, 30.0, 0.1, 0.1, np.array([550.0])).from_inside(0.0, 20.0, 0.0)


def _compare(reference: Reference, solver: Solver, tables: PhaseTables, skipped: list[str]) -> list[Row]:
    """The rows of one file."""
    if is_phase_table(reference):
        return []
    rows: list[Row] = []
    with _telling(reference, skipped):
        family = next((family for family in FAMILIES if family.matches(reference)), None)
        if family is None:
            skipped.append(f"{reference.path.name}: no kind of reference that is compared here")
        else:
            rows.extend(family.compare(reference, solver, tables))
    return rows


@contextmanager
def _telling(reference: Reference, skipped: list[str]) -> Iterator[None]:
    """What goes wrong with a file is told and does not end the walk."""
    try:
        yield
    except UserError as error:
        skipped.append(f"{reference.path.name}: {error}")
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        skipped.append(
            f"{reference.path.name}: failed in {Path(where.filename).name} line {where.lineno}: "
            f"{type(error).__name__}: {error}"
        )


def _badness(row: Row) -> float:
    """Relative RMSE; what is not a number is worst of all."""
    return row.relative_rmse if row.relative_rmse == row.relative_rmse else float("inf")
