"""What became of a spoilt file: refused in a line, told in a note, the same scene, or quietly another one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from openswim.errors import UserError
from openswim.readers import open_scene
from openswim.scene import Scene


@dataclass(frozen=True)
class Found:
    """What a scene holds: fields, and notes."""

    fields: dict[str, np.ndarray]
    notes: set[str]

    @classmethod
    def of(cls, scene: Scene) -> Found:
        grid = scene.grid
        assert grid is not None
        own = {"x": grid.x, "y": grid.y, "height": grid.height_m, "time": scene.time.astype(float)}
        return cls({name: v.values for name, v in scene.data.data_vars.items()} | own, set(scene.notes))

    def same_as(self, other: Found) -> bool:
        return self.fields.keys() == other.fields.keys() and all(
            field.shape == other.fields[name].shape
            and np.allclose(field, other.fields[name], rtol=2e-3, atol=2e-4 * np.abs(other.fields[name]).max())
            for name, field in self.fields.items()
        )

    def faults(self) -> list[str]:
        """Fields that no scene may have: not finite, contents below zero, axes or heights that do not rise."""
        found = [name for name, field in self.fields.items() if name != "time" and not np.isfinite(field).all()]
        found += [name for name, field in self.fields.items() if name.endswith("_content") and (field < 0).any()]
        return found + [name for name in ("x", "y", "height") if (np.diff(self.fields[name], axis=0) <= 0).any()]


def verdict(paths: list[Path], good: Found) -> str:
    """refused, told, same; or, what must not be, silent, bad or a message that is no one line."""
    try:
        found = Found.of(open_scene(paths))
    except UserError as error:
        names = [path.name for path in paths[0].parent.iterdir()]  # headers may lie beside
        one_line = "\n" not in str(error) and len(str(error)) < 500 and any(name in str(error) for name in names)
        return "refused" if one_line else f"unclear: {error}"
    if found.faults():
        return f"bad: {found.faults()}"
    if found.same_as(good):
        return "same"
    return "told" if found.notes - good.notes else "silent"
