"""`openswim analyse`: from a configuration to an analysis of clouds, its scene and its page."""

from dataclasses import dataclass
from pathlib import Path

import click

from openswim.errors import UserError


@dataclass(frozen=True)
class AnalyseRequest:
    """The options of `openswim analyse`."""

    config: Path
    output: Path
    check: bool = False
    observations: Path | None = None
    write_back: Path | None = None


def run(request: AnalyseRequest) -> None:
    """Analyse and write; what can be wrong with the request is found before any light is solved."""
    from openswim.assimilation import analyse, observe, write_back, write_observations
    from openswim.assimilation.checkpoint import default_checkpoint
    from openswim.assimilation.config import read_config
    from openswim.assimilation.observing.ioda import observation_files
    from openswim.assimilation.writing_back import check_write_back
    from openswim.ground.earth import preload
    from openswim.readers import open_scene
    from openswim.scene.files import check_target, written_whole

    config = read_config(request.config)
    if request.output.suffix not in (".nc", ".zarr"):
        raise UserError(f"--output {request.output}: name a scene, .nc or .zarr; its page is written beside it")
    page, rows = request.output.with_suffix(".html"), request.output.with_suffix(".departures.nc")
    kept, taken = default_checkpoint(request.output), config.inputs
    for target in (request.output, page, rows, kept):
        check_target(target, taken)
    taken = [*taken, request.output, page, rows, kept]
    if request.write_back is not None:
        check_write_back(config.model, config.observe.get("controls", "cloud_liquid"))
        check_target(request.write_back, taken, "--write-back")
        taken.append(request.write_back)
    if request.observations is not None:
        check_target(request.observations, taken, "--observations")
    images = config.images()
    preload()
    scene = open_scene(config.model) if config.time is None else open_scene(config.model, time=config.time)
    op = observe(scene, config.cameras, config.points, time=config.time, sun=config.sun, **config.observe)
    click.echo(f"{op}", err=True)
    for target in () if request.observations is None else observation_files(request.observations, op):
        check_target(target, taken, "--observations")
    observed = op.observations(images, config.w_m2 or None, **config.observations)
    if request.check:
        click.echo(f"{op.linearize(op.first()).check()}")
        return
    found = analyse(op, observed, background=config.background, checkpoint=kept, **config.analyse)
    if found.interrupted:
        click.echo(f"stopped; the same command goes on from {kept}", err=True)
    (found.scene.to_zarr if request.output.suffix == ".zarr" else found.scene.to_netcdf)(request.output)
    found.report(page)
    with written_whole(rows) as partial:
        found.to_dataset().to_netcdf(partial)
    if request.observations is not None:
        write_observations(request.observations, op, observed, found.after)
    if request.write_back is not None:
        changed = write_back(found, config.model, request.write_back)
        told = ", ".join(f"{name} at {count} nodes" for name, count in changed.items())
        click.echo(f"{request.write_back}: {told or 'nothing'} changed")
    if not found.interrupted:
        kept.unlink(missing_ok=True)  # all that was found has been written
    before, after = found.rms(found.before), found.rms(found.after)
    for part, one, two in zip(op.parts, before, after, strict=True):
        click.echo(f"{part.name}: departures of {one:.2f} errors before, {two:.2f} after (root mean square)")
    click.echo(f"{request.output}: {found.used} observations, {len(found.costs) - 1} iterations; page {page}")
