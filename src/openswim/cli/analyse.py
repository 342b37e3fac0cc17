"""`openswim analyse`: from a configuration to an analysis of clouds, its scene and its page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from openswim.errors import UserError

if TYPE_CHECKING:
    import xarray as xr

    from openswim.assimilation import Analysis, Operator
    from openswim.assimilation.config import Configuration


@dataclass(frozen=True)
class AnalyseRequest:
    """The options of `openswim analyse`."""

    config: Path
    output: Path | None = None
    check: bool = False
    observations: Path | None = None
    write_back: Path | None = None


def run(request: AnalyseRequest) -> None:
    """Analyse and write; what can be wrong with the request is found before any light is solved, by --check as well."""
    from openswim.assimilation.analysing import prepared
    from openswim.assimilation.config import read_config
    from openswim.assimilation.configured import operator_of
    from openswim.assimilation.settings import Settings
    from openswim.ground.earth import preload

    config = read_config(request.config)
    files = None if request.check and request.output is None else _files(request, config)
    images = config.images()
    preload()
    op = operator_of(config)
    click.echo(f"{op}", err=True)
    observed = op.observations(images, config.w_m2 or None, **config.observations)
    checkpoint = None
    if files is not None:
        files.check_observations(op)
        checkpoint = files.checkpoint
    prepared(op, observed, None, config.background, Settings(**config.analyse), checkpoint)
    if request.check or files is None:
        click.echo(f"{op.linearize(op.first()).check()}")
        return
    _analyse(op, observed, config, files)


@dataclass(frozen=True)
class _Files:
    """What is written, and what is read and may not be replaced: ``taken``."""

    scene: Path
    page: Path
    departures: Path
    checkpoint: Path
    write_back: Path | None
    observations: Path | None
    taken: list[Path]

    def check_observations(self, op: Operator) -> None:
        from openswim.assimilation.observing.ioda import observation_files
        from openswim.scene.files import check_target

        for target in () if self.observations is None else observation_files(self.observations, op):
            check_target(target, self.taken, "--observations")


def _files(request: AnalyseRequest, config: Configuration) -> _Files:
    """Checked: all can be written, and none replaces another or an input."""
    from openswim.assimilation.checkpoint import default_checkpoint
    from openswim.assimilation.writing_back import check_write_back
    from openswim.scene.files import check_target

    output = request.output
    if output is None or output.suffix not in (".nc", ".zarr"):
        raise UserError(f"--output {output or 'is missing'}: name a scene, .nc or .zarr; its page is written beside it")
    page, departures = output.with_suffix(".html"), output.with_suffix(".departures.nc")
    own = [output, page, departures, default_checkpoint(output)]
    for target in own:
        check_target(target, config.inputs)
    taken = [*config.inputs, *own]
    if request.write_back is not None:
        check_write_back(config.models, request.write_back, config.observe.get("controls", "cloud_liquid"), taken)
        taken.append(request.write_back)
    if request.observations is not None:
        check_target(request.observations, taken, "--observations")
    return _Files(output, page, departures, own[-1], request.write_back, request.observations, taken)


def _analyse(op: Operator, observed: xr.Dataset, config: Configuration, files: _Files) -> None:
    from openswim.assimilation import analyse, write_back, write_observations
    from openswim.scene.files import written_whole

    found = analyse(op, observed, background=config.background, checkpoint=files.checkpoint, **config.analyse)
    if found.interrupted:
        click.echo(f"stopped; the same command goes on from {files.checkpoint}; what there is, is written", err=True)
    scene = found.scene
    (scene.to_zarr if files.scene.suffix == ".zarr" else scene.to_netcdf)(files.scene)
    found.report(files.page)
    with written_whole(files.departures) as partial:
        found.to_dataset().to_netcdf(partial)
    if files.observations is not None:
        write_observations(files.observations, op, observed, found.after)
    if files.write_back is not None:
        changed = write_back(found, config.models, files.write_back, config.member)
        told = ", ".join(f"{name} at {count} nodes" for name, count in changed.items())
        click.echo(f"{files.write_back}: {told or 'nothing'} changed")
    if not found.interrupted:
        files.checkpoint.unlink(missing_ok=True)  # all that was found has been written
    _tell(found, files)
    if found.interrupted:
        raise KeyboardInterrupt  # as of any command that was stopped


def _tell(found: Analysis, files: _Files) -> None:
    before, after = found.rms(found.before), found.rms(found.after)
    for part, one, two in zip(found.rows.parts, before, after, strict=True):
        click.echo(f"{part.name}: departures of {one:.2f} errors before, {two:.2f} after (root mean square)")
    if found.told:
        click.echo(f"numbers that the observations tell: {'; '.join(map(str, found.told))}")
    click.echo(f"{files.scene}: {found.used} observations, {len(found.costs) - 1} iterations; page {files.page}")
