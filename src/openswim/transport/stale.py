"""Machine code that an earlier version of the kernels left in Numba's cache on disk.

Numba stamps what it keeps of a kernel with the kernel's own file; what it inlines from others may have changed since.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from openswim.errors import UserError
from openswim.scene.files import written_whole

_STAMP = "openswim-sources"


def drop_stale(cache_path: str | None, sources: Path = Path(__file__).parent) -> None:
    """Empty Numba's folder of the kernels in ``sources`` unless these are what it was filled from; where nothing may be
    written, nothing is done."""
    if cache_path is None:
        return
    folder, digest = Path(cache_path), _digest(sources)
    stamp = folder / _STAMP
    try:
        if stamp.is_file() and stamp.read_text() == digest:
            return
        # the index first: what it names and is gone Numba compiles anew, as another process may at this moment
        for pattern in ("*.nbi", "*.nbc"):
            for file in folder.glob(pattern):
                file.unlink(missing_ok=True)
        with written_whole(stamp) as partial:
            partial.write_text(digest)
    except (OSError, UserError):
        pass


def _digest(sources: Path) -> str:
    found = hashlib.sha256()
    for file in sorted(sources.glob("*.py")):
        found.update(f"{file.name} {file.stat().st_size} ".encode() + file.read_bytes())
    return found.hexdigest()
