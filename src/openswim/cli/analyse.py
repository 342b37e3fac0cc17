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
    from openswim.assimilation.writing_back import check_write_back
    from openswim.ground.earth import preload
    from openswim.readers import open_scene
    from openswim.scene.files import check_target

    config = read_config(request.config)
    if request.output.suffix not in (".nc", ".zarr"):
        raise UserError(f"--output {request.output}: name a scene, .nc or .zarr; its page is written beside it")
    page, rows = request.output.with_suffix(".html"), request.output.with_suffix(".departures.nc")
    for target in (request.output, page, rows):
        check_target(target, [config.path, config.model])
    if request.write_back is not None:
        check_write_back(config.model, config.observe.get("controls", "cloud_liquid"))
        others = [config.path, config.model, request.output, page, rows, *(image for _, image in config.cameras)]
        check_target(request.write_back, others, "--write-back")
    images = config.images()
    preload()
    scene = open_scene(config.model) if config.time is None else open_scene(config.model, time=config.time)
    cameras = [camera for camera, _ in config.cameras]
    op = observe(scene, cameras, config.points, time=config.time, sun=config.sun, **config.observe)
    click.echo(f"{op}", err=True)
    observed = op.observations(images, config.w_m2 or None, **config.observations)
    if request.check:
        click.echo(f"{op.linearize(op.first()).check()}")
        return
    kept = default_checkpoint(request.output)
    found = analyse(op, observed, background=config.background, checkpoint=kept, **config.analyse)
    if found.interrupted:
        click.echo(f"stopped; the same command goes on from {kept}", err=True)
    else:
        kept.unlink(missing_ok=True)
    (found.scene.to_zarr if request.output.suffix == ".zarr" else found.scene.to_netcdf)(request.output)
    found.report(page)
    _write_rows(found.to_dataset(), rows)
    if request.observations is not None:
        write_observations(request.observations, op, observed, found.after)
    if request.write_back is not None:
        changed = write_back(found, config.model, request.write_back)
        told = ", ".join(f"{name} at {count} nodes" for name, count in changed.items())
        click.echo(f"{request.write_back}: {told or 'nothing'} changed")
    before, after = found.rms(found.before), found.rms(found.after)
    for part, one, two in zip(op.parts, before, after, strict=True):
        click.echo(f"{part.name}: departures of {one:.2f} errors before, {two:.2f} after (root mean square)")
    click.echo(f"{request.output}: {found.used} observations, {len(found.costs) - 1} iterations; page {page}")


def _write_rows(rows: object, path: Path) -> None:
    from openswim.scene.files import written_whole

    with written_whole(path) as partial:
        rows.to_netcdf(partial)  # type: ignore[attr-defined]
