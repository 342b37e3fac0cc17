"""Files of arrays, as they are and as disks leave them."""

from pathlib import Path

import numpy as np
import pytest

from openswim.system.archives import Damaged, arrays_of


def test_arrays_come_back_and_whatever_else_is_damaged(tmp_path: Path) -> None:
    """Each byte spoilt in turn: the same arrays, where it does not matter, or one kind of error."""
    path = tmp_path / "kept.npz"
    kept = {"light": np.arange(20.0), "facts": np.array([1, 2], np.uint8)}
    np.savez_compressed(path, **kept)
    assert arrays_of(path, ["facts"]).keys() == {"facts"}
    whole, damaged = path.read_bytes(), 0
    for n in range(len(whole)):
        path.write_bytes(whole[:n] + bytes([whole[n] ^ 0x3D]) + whole[n + 1 :])
        try:
            found = arrays_of(path, kept)
        except Damaged:
            damaged += 1
        else:
            assert all((found[name] == values).all() for name, values in kept.items())
    assert damaged > 0.6 * len(whole)
    np.save(tmp_path / "single.npy", np.arange(3))
    (tmp_path / "short.npz").write_bytes(whole[:50])
    (tmp_path / "empty.npz").touch()
    for name in ("single.npy", "short.npz", "empty.npz", "none.npz"):
        with pytest.raises(Damaged):
            arrays_of(tmp_path / name)
