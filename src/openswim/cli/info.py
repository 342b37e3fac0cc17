"""`openswim info`: what files hold, in words and as maps of each species' column maximum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from openswim.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from PIL import Image

    from openswim.scene import Scene

PANEL = 320  # pixels, the longer side
_MARGIN, _TITLE, _BAR = 12, 34, 12
_DECADES = 3.0  # below the maximum that the colours show
# From clear to thick, even steps in lightness.
_COLOURS = (
    (20, 24, 48), (38, 60, 110), (46, 110, 142), (60, 158, 128), (150, 196, 80), (240, 222, 90), (255, 250, 220),
)  # fmt: skip


def run(files: Sequence[Path], picture: Path | None, time: str | None, allow_references: bool = False) -> None:
    """Print the description; draw the maps where a picture is asked for."""
    from openswim.readers import describe

    if picture is not None and picture.suffix.lower() != ".png":
        raise UserError(f"{picture}: maps are written as .png: choose such a name")
    if time is not None and picture is None:
        raise UserError("--time is the time of the maps: give --map FILE.png, or leave it out")
    click.echo(str(describe(files, allow_references)))
    if picture is not None:
        drawn = draw(files, picture, time, allow_references)
        if drawn:
            click.echo(f"{picture}: column maxima")
        else:
            click.echo(f"note: there is no cloud, precipitation or aerosol: nothing to map, no {picture}", err=True)


def draw(files: Sequence[Path], picture: Path, time: str | None = None, allow_references: bool = False) -> bool:
    """Write the maps of one time; False where there is nothing to map."""
    import numpy as np

    from openswim.colour import check_writable
    from openswim.colour.picture import write_picture
    from openswim.readers import files_of, open_scene
    from openswim.scene.files import written_whole

    check_writable(picture, files_of(files))
    scene = open_scene(files, time, allow_references=allow_references)
    image = maps(scene)
    if image is None:
        return False
    with written_whole(picture) as partial:
        write_picture(np.asarray(image), partial, {})
    return True


def maps(scene: Scene) -> Image.Image | None:
    """One panel for each species that is anywhere present: north (+y) up, logarithmic colours, three decades; coasts,
    latitudes and longitudes (of flat scenes kilometres), and a scale below. None where there is nothing to map."""
    from PIL import Image, ImageDraw, ImageFont

    from openswim.cli.map_marks import mark, scale

    fields = column_maxima(scene)
    if not fields:
        return None
    across = min(3, len(fields))
    height, width = next(iter(fields.values()))[0].shape
    stretch = PANEL / max(height, width)
    size = max(int(width * stretch), 40), max(int(height * stretch), 40)
    cell = PANEL + 2 * _MARGIN, size[1] + _TITLE + _BAR + 3 * _MARGIN
    rows = math.ceil(len(fields) / across)
    sheet = Image.new("RGB", (across * cell[0], rows * cell[1] + _TITLE), (250, 250, 248))
    pen, font, small = ImageDraw.Draw(sheet), ImageFont.load_default(13), ImageFont.load_default(11)
    when = "" if scene.time is None else f", {str(scene.time)[:16]} UTC"
    pen.text((_MARGIN, _MARGIN), f"{scene.source}{when}"[: across * 46], (30, 30, 30), font)
    for index, (name, (field, units)) in enumerate(fields.items()):
        left, top = (index % across) * cell[0] + _MARGIN, (index // across) * cell[1] + _TITLE
        most = float(field.max())
        title = f"{name}, column maximum\n{units}, up to {most:.2g}, logarithmic"
        pen.text((left, top), title, (30, 30, 30), font)
        panel = Image.fromarray(_coloured(field, most)).resize(size, Image.Resampling.NEAREST)
        sheet.paste(panel, (left, top + _TITLE + 4))
        if scene.grid is not None:
            mark(pen, small, scene.grid, left, top + _TITLE + 4, size)
        bar = Image.fromarray(_coloured(_ramp(size[0]), 1.0)).resize((size[0], _BAR))
        sheet.paste(bar, (left, top + _TITLE + 4 + size[1] + 4))
        scale(pen, small, left, top + _TITLE + 8 + size[1] + _BAR, size[0], most, _DECADES)
    return sheet


def column_maxima(scene: Scene) -> dict[str, tuple[NDArray[np.float32], str]]:
    """(ny, nx) maximum over the column of every content and extinction that is somewhere positive, and its unit."""
    found: dict[str, tuple[Any, str]] = {}
    for name in map(str, scene.data.data_vars):
        if name.endswith("_content"):
            field = 1e3 * scene.data[name].max("z").values
            found[name.removesuffix("_content")] = field, "g m-3"
        elif "extinction" in name:
            kind = name.removeprefix("extinction_").removesuffix("_extinction").replace("_", " ")
            found[f"{kind} extinction"] = 1e3 * scene.data[name].max("z").values, "km-1"
    return {name: (field, units) for name, (field, units) in found.items() if field.max() > 0}


def _ramp(width: int) -> NDArray[np.float32]:
    import numpy as np

    return np.logspace(-_DECADES, 0, width, dtype=np.float32)[None]


def _coloured(field: NDArray[np.float32], most: float) -> NDArray[np.uint8]:
    """(ny, nx, 3), rows from the north."""
    import numpy as np

    share = 1.0 + np.log10(np.maximum(field[::-1] / most, 10**-_DECADES)) / _DECADES
    steps = np.linspace(0.0, 1.0, len(_COLOURS))
    table = np.array(_COLOURS, float)
    return np.stack([np.interp(share, steps, table[:, k]) for k in range(3)], axis=-1).astype(np.uint8)
