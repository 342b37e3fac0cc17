"""The default Earth's maps: read once, by whoever is first."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from openswim.errors import UserError
from openswim.ground import earth


def test_maps_are_read_once_though_several_threads_ask() -> None:
    read = []

    @earth._once
    def slow() -> int:
        read.append(threading.current_thread())
        time.sleep(0.05)
        return len(read)

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: slow(), range(4))) == [1, 1, 1, 1]


def test_what_cannot_be_read_ahead_is_told_to_who_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost() -> None:
        raise UserError("gone")

    monkeypatch.setattr(earth, "_image", earth._once(lost))
    earth.preload()
    for _ in range(2):
        with pytest.raises(UserError, match="gone"):
            earth._image()
