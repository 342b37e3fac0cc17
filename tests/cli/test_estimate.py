"""The estimate before a large job: grows with what costs, silent for small jobs."""

from types import SimpleNamespace

from openswim.cameras import Camera
from openswim.cli.estimate import estimate

CLEAR = SimpleNamespace(grid=None)


def _scene(nz: int, ny: int, nx: int) -> SimpleNamespace:
    return SimpleNamespace(grid=SimpleNamespace(shape=(nz, ny, nx)))


def test_more_of_anything_takes_longer() -> None:
    small, large = Camera.allsky(47, 11, size=100), Camera.allsky(47, 11, size=2000)
    assert estimate(CLEAR, large).seconds > 2 * estimate(CLEAR, small).seconds
    assert estimate(_scene(64, 256, 256), small).seconds > estimate(CLEAR, small).seconds
    assert (
        estimate(_scene(64, 256, 256), small).seconds > estimate(_scene(64, 256, 256), small, "swim").seconds
    )
    preview, standard, high = (
        estimate(_scene(32, 128, 128), small, quality=q).seconds for q in ("preview", "standard", "high")
    )
    assert preview < standard < high
    assert estimate(CLEAR, large).memory_bytes > estimate(CLEAR, small).memory_bytes


def test_only_large_jobs_are_announced() -> None:
    assert not estimate(CLEAR, Camera.allsky(47, 11, size=100)).large
    assert estimate(_scene(64, 1000, 1000), Camera.allsky(47, 11, size=100)).large
    assert "GB" in str(estimate(_scene(64, 1000, 1000), Camera.allsky(47, 11)))
