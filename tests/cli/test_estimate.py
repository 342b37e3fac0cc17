"""The estimate before a large job: grows with what costs, silent for small jobs."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pyproj import CRS

import openswim
from openswim.cameras import Camera
from openswim.cli import estimate as module
from openswim.cli.estimate import Pictured, announce, estimate, mean_of, passes_of
from openswim.errors import UserError
from openswim.films import Weather
from openswim.lighting import lights_of
from openswim.optics.matter import matter_of
from openswim.readers import Neighbourhood
from openswim.scene import Scene
from openswim.scene.rays import Rays
from openswim.solver import Solver
from openswim.transport.montecarlo import reference

CLEAR = SimpleNamespace(grid=None, wider=None, levels=[SimpleNamespace(atmosphere=None)])


def _scene(nz: int, ny: int, nx: int, cell_m: float = 100.0, share: float = 1.0) -> Scene:
    """On the Earth, with a deck of thin cloud over a share of the columns."""
    crs = CRS.from_proj4("+proj=lcc +lat_1=47 +lat_0=47 +lon_0=11 +R=6371000 +units=m +no_defs")
    cloud = np.zeros((nz, ny, nx), np.float32)
    cloud[nz // 2] = 1e-4 * (np.random.default_rng(3).random((ny, nx)) < share)
    return Scene.from_arrays(cloud, *(np.arange(n) * cell_m for n in (nx, ny)), np.linspace(0, 12e3, nz), crs=crs)


def test_wide_cells_are_divided() -> None:
    """Katrina, 48 x 48 columns of 9 km: drawn on 2.25-km cells, a few seconds of solving and a small view."""
    small = Camera.allsky(47, 11, size=100)
    own, narrow = (estimate(_scene(45, 48, 48, cell_m), small).seconds for cell_m in (9000.0, 1000.0))
    assert narrow + 0.5 < own < 8


@pytest.mark.parametrize(
    ("file", "seconds", "gigabytes"), [("stratocumulus_64x64x16", 8.3, 1.82), ("rico_122x106x39", 3.5, 0.61)]
)
def test_flat_scenes_as_measured(shared: Path, file: str, seconds: float, gigabytes: float) -> None:
    """An all-sky view of 400 pixels, on two cores; the stratocumulus is drawn on cells a quarter as wide."""
    scene = openswim.open_scene(shared / "data" / "nwp" / f"les_{file}.txt")
    expected = estimate(scene, Camera.allsky(x_m=0, y_m=0, size=400))
    assert seconds / 1.5 < expected.seconds < seconds * 1.5
    assert gigabytes / 1.5 < expected.memory_bytes / 1e9 < gigabytes * 1.5


@pytest.mark.parametrize(("sun_deg", "seconds"), [(40.0, 16.0), (5.0, 24.0), (-1.0, 43.0)])
def test_a_low_sun_takes_longer(shared: Path, sun_deg: float, seconds: float) -> None:
    """As measured: rays toward it pass up to a hundred cells of a global model's."""
    around = Neighbourhood.seen_from(45.0, 15.0, 2.0, True)
    scene = openswim.open_scene(shared / "data" / "nwp" / "um_cosp_input_2d.nc", around=around)
    expected = estimate(scene, Camera.allsky(45.0, 15.0, size=400), sun_deg=sun_deg).seconds
    assert seconds / 1.3 < expected < seconds * 1.3
    assert estimate(scene, Camera.allsky(45.0, 15.0, size=400), sun_deg=-10.0).seconds < 43.0 / 1.5


@pytest.mark.parametrize(
    ("file", "paths", "seconds"), [("rico_122x106x39", 64, 4.6), ("stratocumulus_64x64x16", 512, 49.0)]
)
def test_paths_scatter_twice_the_mean_depth_times(shared: Path, file: str, paths: int, seconds: float) -> None:
    """100 x 100 pixels by Monte Carlo, as measured; columns of a mean depth of .83, and of 7.1."""
    scene = openswim.open_scene(shared / "data" / "nwp" / f"les_{file}.txt")
    view = Camera.allsky(x_m=0, y_m=0, size=100)
    assert seconds / 1.5 < estimate(scene, view, "reference", paths=paths).seconds < seconds * 1.5


def test_passes_are_those_of_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    field = Solver("reference", paths=200).solve(Scene.clear(47, 11), np.array([0.0, 0.0, 1.0]), [550.0])
    monkeypatch.setattr(reference, "_PASS_S", 0.0)  # a machine on which no pass is short
    monkeypatch.setattr(reference, "path_kernel", lambda t, *rest: taken.append(rest[8]) if t == 0 else None)
    field.view(Rays(np.array([0.0, 0.0, 10.0]), np.array([[0.0, 0.0, 1.0]])))
    assert sum(taken) == 200
    assert len(taken) == passes_of(200)


def test_each_light_takes_its_time_and_stays() -> None:
    one, three = (estimate(_scene(32, 96, 96), Camera.allsky(47, 11), lights=lights) for lights in (1, 3))
    assert 2 * one.seconds < three.seconds < 3 * one.seconds
    assert one.memory_bytes < three.memory_bytes < 2 * one.memory_bytes
    scene = _scene(4, 3, 3)
    assert lights_of(scene, time="2024-06-21T11:00") == 1
    assert lights_of(scene, time="2024-06-21T23:30") > 1
    assert lights_of(scene, sun=(180.0, -20.0)) == 1


@pytest.mark.parametrize(
    ("camera", "seconds"),
    [
        (Camera.allsky(24.5, -90.0, size=800), (6.9, 8.3)),
        (Camera.perspective(24.5, -90.0, altitude_deg=5.0, azimuth_deg=180.0, fov_deg=70.0, size=(1080, 1920)),
         (18.5, 24.2)),
    ],
)  # fmt: skip
def test_large_pictures_as_measured(shared: Path, camera: Camera, seconds: tuple[float, float]) -> None:
    """Katrina, to be looked at and with all rays."""
    around = Neighbourhood.seen_from(24.5, -90.0, 2.0, True)
    file = shared / "data" / "nwp" / "wrfout_katrina_2005-08-28.nc"
    scene = openswim.open_scene(file, time="2005-08-28T18:00", around=around)
    expected = estimate(scene, camera).seconds
    assert all(takes / 1.5 < expected < 1.5 * takes for takes in seconds)


def test_quality_costs_where_there_is_cloud() -> None:
    """Tibet's grid of 42 x 225 x 289 nodes without cloud: high took 1.18 times the CPU seconds of standard; with cloud
    in a third of the columns 1.5 times. Below, both skies are drawn on one grid, of narrower cells for high."""
    small = Camera.allsky(47, 11, size=10)
    for quality, least, most in (("standard", 1.0, 1.1), ("high", 1.4, 2.0)):
        clear, cloudy = (estimate(_scene(32, 128, 128, 1000.0, share), small, quality=quality) for share in (0.0, 1.0))
        assert least <= cloudy.seconds / clear.seconds < most


def test_wavelengths_are_solved_for_in_fours_and_bands_of_gases_in_several_terms() -> None:
    scene = replace(_scene(32, 128, 128), atmosphere=Scene.clear(47, 11).atmosphere)
    small, three = Camera.allsky(47, 11, size=100), [450.0, 500.0, 550.0]
    one, four, five, within = (
        estimate(scene, small, wavelengths_nm=nm)
        for nm in ([550.0], [*three, 600.0], [*three, 600.0, 650.0], [*three, 940.0])
    )
    assert one.seconds == four.seconds
    assert 1.5 * one.seconds < five.seconds <= within.seconds
    assert four.memory_bytes < five.memory_bytes < 2 * four.memory_bytes


def test_an_imagers_picture_is_refused_before_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "free_memory", lambda: 1e9)
    with pytest.raises(UserError, match=r"this picture takes about \d+\.\d GB of memory, and 1\.0 GB are free"):
        announce(_scene(64, 500, 500), Pictured((62, 79), 36e6), "fast", wavelengths_nm=[640.0, 810.0])


def test_a_clear_panorama_as_measured(shared: Path) -> None:
    """Tibet at noon, 2048 x 1024 pixels, on two cores: nothing but air and traces of ice."""
    file = shared / "data" / "nwp" / "wrfout_tibet_2005-09-21.nc"
    scene = openswim.open_scene(file, time=np.datetime64("2005-09-21T06:00"))
    expected = estimate(scene, Camera.panorama(30, 87, size=(2048, 1024)))
    assert 16 / 1.5 < expected.seconds < 16 * 1.5


def test_a_film_is_estimated_by_several_of_its_skies() -> None:
    scenes = [replace(_scene(8, 32, 32), time=np.datetime64(f"2024-06-21T1{hour}:00", "ms")) for hour in range(6)]
    weather, small = Weather.of_scenes(scenes), Camera.allsky(47, 11, size=100)
    begin, end = (np.datetime64(f"2024-06-21T{time}", "ms") for time in ("10:30", "14:00"))
    assert [str(each.time)[11:13] for each in weather.spanned([begin, end], most=3)] == ["10", "12", "14"]
    assert [each.time for each in weather.spanned([end, end], most=3)] == [scenes[4].time]
    assert [each.time for each in weather.spanned([end + np.timedelta64(9, "h")], most=3)] == [scenes[5].time]
    one, other = (estimate(scene, small) for scene in (scenes[0], _scene(32, 256, 256)))
    both = mean_of([one, other])
    assert both.seconds == pytest.approx((one.seconds + other.seconds) / 2)
    assert both.memory_bytes == other.memory_bytes


def test_thick_cells_of_flat_scenes_are_divided() -> None:
    small, x, z = Camera.allsky(x_m=0, y_m=0, size=100), np.arange(48) * 100.0, np.arange(16) * 100.0
    cloud = np.zeros((16, 48, 48), np.float32)
    cloud[4:12] = 1.0
    cloud[:, ::7] = 0.0
    thin, thick = (
        estimate(openswim.Scene.from_arrays(cloud * per_m, x, x, z), small) for per_m in (1e-3, 0.06)
    )
    assert thick.seconds > 1.5 * thin.seconds
    assert thick.memory_bytes > 3 * thin.memory_bytes


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


def test_domains_lit_in_parts_take_less() -> None:
    """Measured: HRRR's 1799 x 1059 columns on 50 levels, 1.9 million pixels: 2.7 GB of fields, 5.0 GB in all, some 70
    CPU seconds, half of that on two cores."""
    names = ("liquid_content", "ice_content", "rain_content", "snow_content", "air_pressure", "air_temperature")
    field = SimpleNamespace(nbytes=4 * 50 * 1059 * 1799)
    shape = SimpleNamespace(shape=(50, 1059, 1799), periodic=False, curved=True, height_m=field)
    scene = SimpleNamespace(grid=shape, data=_Fields(dict.fromkeys(names, field)), species=[*"abcd"],
                            wider=None, levels=CLEAR.levels)  # fmt: skip
    expected = estimate(scene, Camera.satellite(0, 0, size=(1059, 1799)))
    assert 20 < expected.seconds < 90
    assert 4e9 < expected.memory_bytes < 8e9


def test_nested_grids_take_the_time_and_memory_of_each() -> None:
    small = Camera.allsky(47, 11, size=100)
    inner, wider = _scene(32, 128, 128), _scene(32, 256, 256)
    nested = replace(inner, wider=wider)
    both, one, other = (estimate(scene, small) for scene in (nested, inner, wider))
    assert max(one.seconds, other.seconds) < both.seconds < one.seconds + other.seconds
    assert max(one.memory_bytes, other.memory_bytes) < both.memory_bytes < one.memory_bytes + other.memory_bytes
    assert estimate(nested, small, "reference").seconds == estimate(inner, small, "reference").seconds


def test_terms_of_nested_grids_are_those_that_are_solved_for() -> None:
    """Air of the wider grid alone: its gases are in both."""
    small, wavelengths = Camera.allsky(47, 11, size=100), [760.0, 940.0]
    wider = _scene(16, 24, 24)
    inner = replace(wider, atmosphere=None)
    terms = matter_of(replace(inner, wider=wider), wavelengths).terms.nm.size
    assert terms > 4  # a pack
    scenes = wider, replace(wider, wider=wider), replace(inner, wider=wider)
    one, nested, found = (estimate(scene, small, wavelengths_nm=wavelengths) for scene in scenes)
    assert found.seconds == nested.seconds > one.seconds
    assert found.memory_bytes == nested.memory_bytes


class _Fields(dict):  # type: ignore[type-arg]
    @property
    def data_vars(self) -> "_Fields":
        return self


def test_only_large_jobs_are_announced() -> None:
    assert not estimate(CLEAR, Camera.allsky(47, 11, size=100)).large
    large = estimate(_scene(64, 500, 500), Camera.allsky(47, 11, size=100))
    assert large.large
    assert "GB" in str(large)


@pytest.mark.parametrize("size", [(20_000, 20_000), (3000, 12_000)])
def test_a_picture_larger_than_the_machine_is_refused_with_a_size_that_fits(monkeypatch, size) -> None:
    monkeypatch.setattr(module, "free_memory", lambda: 2e9)
    with pytest.raises(UserError, match=r"GB of memory, and 2.0 GB are free: use --size \d+(x\d+)? or less") as caught:
        announce(CLEAR, Camera.panorama(47, 11, size=size), "fast")
    columns, _, rows = str(caught.value).rpartition("--size ")[2].removesuffix(" or less").partition("x")
    fits = Camera.panorama(47, 11, size=(int(rows or columns), int(columns)))
    assert 1.4e9 < estimate(CLEAR, fits).memory_bytes < 1.6e9
    announce(CLEAR, fits, "fast")
    monkeypatch.setattr(module, "free_memory", lambda: 1e8)
    with pytest.raises(UserError, match="use a smaller domain"):
        announce(CLEAR, fits, "fast")
