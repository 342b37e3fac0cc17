"""Which skies are solved for, and for which ground and eye."""

import re
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from tests.comparison.skies import small_camera, write_frame

import openswim
from openswim import Camera, Scene
from openswim.cameras.files import CameraFile, ResponseSettings, write_camera
from openswim.cli.main import run
from openswim.comparison import cloud_correction, skies
from openswim.comparison.skies import Skies
from openswim.errors import UserError
from openswim.scene.atmosphere import Atmosphere
from openswim.solver import Solver

TIME = np.datetime64("2024-06-20T08:00", "ms")
AXIS = np.arange(21) * 500.0


def alps():
    """Flat, 21 x 21 nodes: a valley at 200 m in the middle, and 1500 m around it."""
    terrain = np.full((21, 21), 1500.0)
    terrain[8:13, 8:13] = 200.0
    return Scene.from_arrays(np.zeros((3, 21, 21)), AXIS, AXIS, np.array([100.0, 2000.0, 4000.0]), place=(47, 8),
                             fields={"surface_altitude": terrain}, atmosphere=Atmosphere.us_standard())  # fmt: skip


@pytest.mark.parametrize(
    ("height_m", "above", "expected"),
    [
        (30.0, "ground", (200.0, 30.0)),
        (260.0, "sea level", (200.0, 60.0)),
        (170.0, "sea level", (170.0, 0.0)),  # the model's valley is higher than it is
    ],
)  # fmt: skip
def test_the_clear_sky_stands_on_the_ground_under_the_camera(height_m, above, expected, monkeypatch):
    found = []

    class Table:
        def __init__(self, atmosphere, albedo, ground_m, eye_m, solver):
            found.append((ground_m, eye_m))

        def radiance(self, pixels, sun, distance_au):
            return np.zeros(1)

    monkeypatch.setattr(skies, "ClearTable", Table)
    camera = replace(Camera.allsky(x_m=5000.0, y_m=5000.0, height_m=height_m, size=4), above=above)
    Skies(alps(), table=True, sun=(180.0, 40.0)).clear(camera, TIME)
    ground_m, eye_m = found[0]
    assert ground_m == pytest.approx(expected[0])
    assert eye_m == pytest.approx(expected[1], abs=0.02)


def test_a_series_shows_what_the_model_knows_and_no_more():
    """Invented detail (decision 17) is for pictures that are looked at; who asks for it has it in a series, too."""

    def detail(**chosen):
        return Skies(None, **chosen).solver.detail

    assert detail()
    assert not detail(table=True)
    assert detail(table=True, detail=True)
    assert not detail(detail=False)
    assert not detail(solver=Solver("fast", detail=False))
    assert Skies(None, Solver("fast", quality="preview"), table=True).solver.quality == "preview"
    lit = openswim.light(Scene.clear(47, 8), time=TIME)
    assert Skies(lit, table=True).invents  # as it was lit


def test_one_light_of_a_scene_serves_all_cameras(monkeypatch):
    solved = []

    def light(scene, *arguments):
        solved.append(scene)
        return SimpleNamespace(scene=scene, viewpoint=lambda camera: SimpleNamespace(view=lambda **_: camera))

    monkeypatch.setattr(skies, "light", light)
    cameras = [Camera.allsky(lat, 8.0, size=4) for lat in (47.0, 47.1)]
    for model, count in ((Scene.clear(47, 8), 1), (None, 2)):
        solved.clear()
        these = Skies(model)
        assert [these.simulated(camera, TIME) for camera in cameras] == cameras
        assert len(solved) == count


def plain(**more):
    """Flat, level and clear, with air."""
    given = {"surface_albedo": 0.15, "place": (47, 8), "atmosphere": Atmosphere.us_standard(), **more}
    return Scene.from_arrays(np.zeros((3, 21, 21)), AXIS, AXIS, np.array([100.0, 2000.0, 4000.0]), **given)


@pytest.mark.parametrize("sun", [None, (100.0, 40.0)])
def test_a_camera_at_x_and_y_stands_at_the_place_of_its_flat_scene(sun):
    """Its sun, its clear sky and its clear frame are those of that place, or of the sun that is given."""
    flat, on_earth = Camera.allsky(x_m=5000.0, y_m=5000.0, size=8), Camera.allsky(47.0, 8.0, size=8)
    found, expected = Skies(plain(), sun=sun), Skies(None, sun=sun)
    assert found.sun_at(flat, TIME) == expected.sun_at(on_earth, TIME)
    np.testing.assert_allclose(found.clear(flat, TIME), expected.clear(on_earth, TIME), rtol=1e-5)
    found.table = expected.table = True
    np.testing.assert_allclose(found.clear(flat, TIME), expected.clear(on_earth, TIME), rtol=1e-5)


def test_flat_scenes_and_cameras_that_do_not_go_together_are_told_before_light_is_solved(monkeypatch, tmp_path):
    def solved(*given):
        raise AssertionError("light was solved")

    monkeypatch.setattr(skies, "light", solved)
    flat, on_earth = Camera.allsky(x_m=5000.0, y_m=5000.0, size=8), Camera.allsky(47.0, 8.0, size=8)
    plain().to_netcdf(tmp_path / "flat.nc")
    for model, camera, match in (
        (None, flat, "give the camera lat and lon"),
        (plain(place=None), flat, "flat scene without a place"),
        (plain(), on_earth, "flat: give x_m and y_m"),
        (tmp_path / "flat.nc", on_earth, "flat: give x_m and y_m"),
        (Scene.clear(47, 8), flat, "curved Earth: give lat and lon"),
    ):
        these = Skies(model)
        with pytest.raises(UserError, match=match):
            _ = these.sun_at(camera, TIME), these.simulated(camera, TIME)


def test_commands_name_only_options_that_they_have(tmp_path, capsys):
    """compare and correct-clouds have neither --x and --y nor --sun, which render has."""
    frame = str(write_frame(tmp_path / "a_20240620_080000.png", np.ones((8, 8, 3)), (2.0, 2.0, 2.0)))
    for place in (None, (47, 8)):
        plain(place=place).to_netcdf(tmp_path / "flat.nc")
        at = Camera.allsky(47.0, 8.0, size=8) if place else Camera.allsky(x_m=5000.0, y_m=5000.0, size=8)
        write_camera(CameraFile(at, response=ResponseSettings(red_blue=0.0)), tmp_path / "camera.toml")
        model, camera = str(tmp_path / "flat.nc"), ["--camera", str(tmp_path / "camera.toml")]
        for command, more in (("compare", []), ("correct-clouds", ["--base", "1800"])):
            out = [*more, "--utc-offset", "0", "-o", str(tmp_path / f"{command}.nc")]
            assert run([command, model, frame, *camera, *out]) == 2
            said = capsys.readouterr().err
            assert ("give x_m and y_m in metres in place of lat" if place else "without a place: give it lat") in said
            assert not {"--x", "--y", "--sun"} & set(re.findall("--[a-z]+", said))
        assert run(["render", model, *camera, "--time", "2024-06-20T08:00", "-o", str(tmp_path / "a.png")]) == 2
        said = capsys.readouterr().err
        assert ("(--x, --y)" if place else "--sun)") in said


@pytest.mark.slow
def test_a_flat_scene_is_compared_with_the_frames_of_its_camera(tmp_path, capsys):
    """One cloud, the same in both: r is 1 but for the counts' rounding; a clear frame of the camera gives the masks."""
    cloud, places = np.zeros((3, 21, 21)), CameraFile(Camera.allsky(x_m=5000.0, y_m=5000.0, size=48))
    cloud[1, 8:12, 12:16] = 0.01
    sky = Scene.from_arrays(cloud, AXIS, AXIS, np.array([100.0, 2000.0, 4000.0]), surface_albedo=0.15, place=(47, 8),
                            atmosphere=Atmosphere.us_standard())  # fmt: skip
    write_camera(places, tmp_path / "camera.toml")
    names = []
    for scene, name in ((sky, "sky_20240620_080000.png"), (plain(), "clear_20240620_080000.png")):
        radiance = np.nan_to_num(openswim.render(scene, places.camera, time=TIME).radiance.values)
        names.append(str(write_frame(tmp_path / name, radiance, (2.0, 2.0, 2.0))))
    sky.to_netcdf(tmp_path / "flat.nc")
    asked = [str(tmp_path / "flat.nc"), names[0], "--camera", str(tmp_path / "camera.toml"), "--utc-offset", "0",
             "--clear-frame", names[1]]  # fmt: skip
    assert run(["compare", *asked, "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "with the response undone" in said
    assert float(re.search(r"([0-9.]+) with the response undone", said)[1]) > 0.99
    cover = re.search(r"cloud ([0-9]+) % observed, ([0-9]+) % simulated", said)
    assert cover
    assert abs(int(cover[1]) - int(cover[2])) <= 3  # 26 and 24
    page = (tmp_path / "out" / names[0].split("/")[-1]).with_suffix(".html").read_text("utf-8")
    assert {"sun", "venus"} <= set(re.findall(r">([a-z]+)</text>", page))  # of the scene's place
    assert run(["correct-clouds", *asked, "--passes", "1", "-o", str(tmp_path / "edited.nc")]) == 0
    assert re.search(r"no edit has raised r|edit 1 has the highest r, and is written", capsys.readouterr().err)


def test_a_series_reckons_irradiance_where_it_is_asked_for():
    """In a single comparison it is there."""
    camera = Camera.allsky(47.0, 8.0, size=8)
    single, series = (Skies(Scene.clear(47, 8), table=table) for table in (False, True))
    image = series.simulated(camera, TIME)
    assert not [name for name in image.attrs if "irradiance" in name]
    expected = single.simulated(camera, TIME).attrs
    found = series.with_irradiance(image).attrs
    for name in ("diffuse_horizontal_irradiance_w_m2", "global_horizontal_irradiance_w_m2"):
        assert found[name] == pytest.approx(expected[name], rel=1e-6)
    assert series.with_irradiance(expected) is expected  # another's picture


def test_the_chosen_edit_is_the_one_that_is_returned(monkeypatch):
    """Cameras without a pixel left have no r; the others tell."""
    scenes = [Scene.clear(47, 8) for _ in range(3)]
    later = {id(scene): after for scene, after in pairwise(scenes)}
    view = SimpleNamespace(radiance=xr.DataArray(np.zeros((2, 2, 3))))
    monkeypatch.setattr(cloud_correction, "Skies", lambda *_: SimpleNamespace(simulated=lambda *_: view))
    monkeypatch.setattr(cloud_correction, "_step", lambda scene, *_: later[id(scene)])
    for r, expected in (
        ([[0.5, np.nan], [0.6, 0.2], [0.7, 0.1]], 0),
        ([[np.nan, np.nan], [0.2, np.nan], [0.1, 0.2]], 1),
        ([[np.nan, np.nan]] * 3, 0),
    ):
        rows = iter(r)
        monkeypatch.setattr(
            cloud_correction, "_scores", lambda *_, rows=rows: (np.array(next(rows)), np.zeros(2), 0.0, "")
        )
        eyes = [SimpleNamespace(frame=SimpleNamespace(camera=None, time=TIME, name=name)) for name in "ab"]
        best, history = cloud_correction._passes(scenes[0], None, eyes, 2, "fast", None)
        assert best is scenes[expected]
        assert history.attrs["chosen_edit"] == expected


def test_correct_clouds_notes_a_model_that_is_far_from_the_frame_in_time(tmp_path, monkeypatch, capsys):
    def corrected(*arguments, **settings):
        raise UserError("here the work begins")

    monkeypatch.setattr(cloud_correction, "correct_clouds", corrected)
    content = small_camera(48)
    write_camera(content, tmp_path / "camera.toml")
    frame = write_frame(tmp_path / "sky_20240621_140000.png", np.full((48, 48, 3), 0.1))
    for hour in (6, 8):
        scene = replace(alps(), time=np.datetime64(f"2024-06-20T{hour:02}:00", "ms"))
        scene.to_netcdf(tmp_path / f"run_{hour}.nc")
    command = ["correct-clouds", str(tmp_path / "run_*.nc"), str(frame), "--camera", str(tmp_path / "camera.toml"),
               "-o", str(tmp_path / "edited.nc")]  # fmt: skip
    assert run(command) == 2
    assert "2024-06-20T08:00:00Z, is 30 hours before this frame" in capsys.readouterr().err
    frame.rename(tmp_path / "sky_20240620_090000.png")
    assert run([part.replace("0621_14", "0620_09") for part in command]) == 2
    assert "hours before" not in capsys.readouterr().err
    (tmp_path / "sky_20240620_090000.png").rename(tmp_path / "sky_20250620_080000.png")
    assert run([part.replace("20240621_14", "20250620_08") for part in command]) == 2
    assert "2024-06-20T08:00:00Z, is 365 days before this frame" in capsys.readouterr().err
