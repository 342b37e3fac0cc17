"""What is told of files and folders without opening them."""

import os
from pathlib import Path

from openswim.system.inputs import size_and_change


def test_a_folder_is_as_large_and_as_new_as_all_in_it(tmp_path: Path) -> None:
    store = tmp_path / "store.zarr"
    (store / "c/0").mkdir(parents=True)
    (store / "zarr.json").write_text("{}")
    (store / "c/0/0").write_bytes(b"chunk")
    (store / "c/0/none").symlink_to(tmp_path / "not there")
    size, changed = size_and_change(store)
    assert size == 7 + len(os.fspath(tmp_path / "not there"))
    os.utime(store / "c/0/0", ns=(0, changed + 10))
    assert size_and_change(store) == (size, changed + 10)
    (store / "c/0/0").write_bytes(b"a longer chunk")
    assert size_and_change(store)[0] == size + 9
    assert size_and_change(store / "zarr.json")[0] == 2
