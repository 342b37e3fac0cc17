"""Cloud fraction as optics needs it: how much of a cell its cloud covers, consistent with what the cloud holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from openswim.scene.scene import Scene

LEAST_COVER = 0.01
_MOST_IN_CLOUD_KG_M3 = 1e-3  # mean within cloud; adiabatic cumulus 1-2 km above its base
CLOUD = ("liquid", "ice")


def cloud_cover(scene: Scene) -> NDArray[np.float32] | None:
    """Share (nz, ny, nx) of each cell that is cloud, `LEAST_COVER` to 1; None where the scene does not say.

    Raised where liquid and ice would be denser than 1 g m-3 in cloud: fraction and content of a model need not agree.
    """
    if "cloud_area_fraction" not in scene.data:
        return None
    cover = np.maximum(scene.data["cloud_area_fraction"].transpose("z", "y", "x").values, np.float32(LEAST_COVER))
    content = np.zeros_like(cover)
    for kind in CLOUD:
        if f"{kind}_content" in scene.data:
            content += scene.data[f"{kind}_content"].transpose("z", "y", "x").values
    return np.clip(np.maximum(cover, content / np.float32(_MOST_IN_CLOUD_KG_M3)), 0, 1).astype(np.float32)
