"""The command line: exit codes, one line per error, outputs whole or absent."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from pyproj import CRS

import openswim
from openswim import Camera, Scene
from openswim.cameras.views import VIEWS
from openswim.cli.main import run
from openswim.cli.options import VIEWS as VIEWS_OF_OPTIONS
from openswim.cli.render import RenderRequest, ends_of, irradiance_line
from openswim.errors import UserError
from openswim.pictures.viewpoint import LOOKED_AT

ARGUMENTS = ["--lat", "47", "--lon", "11"]


def _image(rows: int = 6, columns: int = 9) -> xr.Dataset:
    shape = (rows, columns, 3)
    dims = ("y", "x", "wavelength")
    relative = np.linspace(0.1, 1.0, int(np.prod(shape)), dtype=np.float32).reshape(shape)
    image = xr.Dataset(
        {"solar_relative_radiance": (dims, relative), "radiance": (dims, 0.1 * relative)},
        coords={"wavelength": [615.0, 546.0, 450.0]},
        attrs={"view": "allsky", "sun_altitude_deg": 40.0, "sun_azimuth_deg": 200.0}
        | {f"{name}_horizontal_irradiance_w_m2": 100.0 for name in ("global", "direct", "diffuse")},
    )
    return image


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> SimpleNamespace:
    """A scene and a renderer that cost nothing; `calls` holds what they were asked for."""
    calls = SimpleNamespace(cameras=[], solvers=[], times=[], places=[], suns=[], sparse=[])
    notes = ["no ice species in the file: none assumed"]
    scene = SimpleNamespace(grid=None, wider=None, atmosphere=None, optics={}, notes=notes)
    scene.levels = [scene]

    def open_scene(path, time=None, around=None, ground=None, **more):
        calls.times.append(time)
        calls.places.append(around)
        return scene

    def render(scene, camera, solver="fast", sparse=0.0, **sun):
        calls.sparse.append(sparse)
        calls.suns.append(sun)
        calls.cameras.append(camera)
        calls.solvers.append(solver)
        return _image()

    # Into the module's dictionary: the real ones need not be imported for this.
    monkeypatch.setitem(vars(openswim), "open_scene", open_scene)
    monkeypatch.setitem(vars(openswim), "render", render)
    monkeypatch.setattr("openswim.lighting.lights_of", lambda scene, *given, **sun: 1)
    monkeypatch.setattr("openswim.lighting.sun_altitude_deg", lambda scene, **sun: 40.0)
    monkeypatch.chdir(tmp_path)
    return calls


def test_of_large_domains_the_part_that_the_view_needs_is_read(world) -> None:
    assert run(["render", "file.nc", *ARGUMENTS, "-o", "a.png"]) == 0
    assert run(["render", "file.nc", *ARGUMENTS, "--height", "10000", "--view", "panorama", "-o", "b.png"]) == 0
    assert run(["render", "file.nc", "--x", "0", "--y", "0", "-o", "c.png"]) == 0
    ground, aloft, flat = world.places
    assert (ground.lat, ground.lon) == (world.cameras[0].lat, world.cameras[0].lon)
    assert ground.if_large
    assert ground.radius_m < aloft.radius_m < 1e6
    assert ground.radius_m < ground.far_m < aloft.far_m < 1e6
    assert flat is None


def test_from_space_it_is_told_that_clouds_end_with_the_domain() -> None:
    """Where a pixel shows ground beyond it; pixels of the sky, and all of a global grid, are no matter."""
    scene, whole = (Scene.from_arrays({}, x, y, [0.0, 1e3], crs=CRS.from_proj4("+proj=longlat +R=6371000"))
                    for x, y in ((np.arange(0.0, 5), np.arange(40.0, 45)), (np.arange(360.0), np.arange(-89.5, 90))))
    high = Camera.satellite(42.0, 2.0, height_m=8e5)

    def told(lat: list[float], lon: list[float], camera: Camera = high, of: Scene = scene) -> int:
        return len(ends_of(xr.Dataset({"latitude": ("y", lat), "longitude": ("y", lon)}), camera, of))

    assert told([40.1, np.nan], [3.9, np.nan]) == 0
    assert told([40.1, 46.0], [3.9, 3.0]) == told([42.0], [-2.0]) == 1
    assert told([89.9, -90.0, 0.0], [10.0, 359.7, -0.4], of=whole) == 0
    assert told([46.0], [3.0], Camera.allsky(42.0, 2.0, height_m=9e3)) == 0


def test_irradiance_is_told_by_night_as_well() -> None:
    watts = {"global": 0.00123456, "direct": 0.0, "diffuse": 812.345}
    image = xr.Dataset(attrs={f"{name}_horizontal_irradiance_w_m2": value for name, value in watts.items()})
    assert irradiance_line(image) == "irradiance: global 0.0012, direct 0.0, diffuse 812.3 W/m2"


def test_render_writes_every_output(world, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code = run(["render", "file.nc", *ARGUMENTS, "-o", "sky.png", "-o", "sky.nc", "--time", "2020-01-01T12:00"])
    said = capsys.readouterr()
    assert code == 0, said.err
    assert "no ice species" in said.err
    assert "altitude 40.00, azimuth 200.00" in said.out
    assert "irradiance: global 100.0, direct 100.0, diffuse 100.0 W/m2" in said.out
    assert (tmp_path / "sky.png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset(tmp_path / "sky.nc") as saved:
        assert saved["radiance"].dims == ("y", "x", "wavelength")
    assert world.times == ["2020-01-01T12:00"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sky.nc", "sky.png"]


def test_how_a_picture_looks_is_the_users_choice(world, tmp_path: Path) -> None:
    from PIL import Image

    look = ["--exposure", "sun", "--matrix", "paper", "--gamma", "2.2", "--bits", "16", "--caption", "none"]
    assert run(["render", "f.nc", *ARGUMENTS, *look, "-o", "deep.png"]) == 0
    assert (tmp_path / "deep.png").read_bytes()[24] == 16  # bits, in the header
    assert run(["render", "f.nc", *ARGUMENTS, "--exposure", "0.25", "-o", "given.png"]) == 0
    with Image.open(tmp_path / "given.png") as given:
        assert given.text["Exposure"] == "0.25"
        assert given.size == (9, 6)
    assert run(["render", "f.nc", *ARGUMENTS, "--exposure", "1/250s f/8 ISO100", "--eye", "-o", "camera.png"]) == 0
    with Image.open(tmp_path / "camera.png") as camera:
        assert float(camera.text["Exposure"]) == pytest.approx(0.55, rel=0.03)  # .65 / 250 / 64 133 klx / 4 pi 100 / 78


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ([], {"view": "allsky", "altitude_deg": 90.0, "height_m": 2.0}),
        (
            ["--altitude", "-90", "--height", "5000"],
            {"view": "allsky", "altitude_deg": -90.0, "height_m": 5000.0},
        ),
        (
            ["--view", "panorama", "--size", "720x360", "--azimuth", "90"],
            {"shape": (360, 720), "azimuth_deg": 90.0},
        ),
        (["--view", "sphere", "--size", "100"], {"shape": (50, 100), "altitude_range_deg": (-90.0, 90.0)}),
        (
            ["--view", "perspective", "--azimuth", "30", "--altitude", "-5", "--fov", "50"],
            {"azimuth_deg": 30.0, "altitude_deg": -5.0, "fov_deg": 50.0},
        ),
        (["--view", "perspective", "--roll", "12"], {"roll_deg": 12.0}),
        (["--view", "panorama", "--altitude-range", "-5,40"], {"altitude_range_deg": (-5.0, 40.0)}),
        (["--view", "satellite", "--height", "35786000"], {"above": "sea level", "height_m": 35_786_000.0}),
    ],
)
def test_options_make_the_camera(world, options: list[str], expected: dict) -> None:
    assert run(["render", "f.nc", *ARGUMENTS, *options, "-o", "x.png"]) == 0
    (camera,) = world.cameras
    assert {name: getattr(camera, name) for name in expected} == expected
    assert (camera.lat, camera.lon) == (47.0, 11.0)


@pytest.mark.parametrize(
    ("options", "fewer"),
    [("-o a.png", True), ("-o a.jpg -o b.png", True), ("-o a.png --bits 16", False), ("-o a.png -o a.nc", False)],
)
def test_what_is_only_looked_at_is_seen_by_fewer_rays(world, tmp_path: Path, options: str, fewer: bool) -> None:
    given = [f"{tmp_path}/{word}" if "." in word else word for word in options.split()]
    assert run(["render", "scene.nc", "--lat", "20", "--lon", "-60", *given]) == 0
    assert world.sparse == [LOOKED_AT if fewer else 0.0]


def test_a_camera_file_in_place_of_a_view(world, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from openswim.cameras import Camera
    from openswim.cameras.files import save_camera

    roof = Camera.fisheye(47.0, 11.0, size=(60, 80), lens="equisolid", rotation_deg=20, tilt_deg=2)
    save_camera(roof, tmp_path / "roof.toml")
    for more in ([], ["--lat", "48", "--height", "30"], ["--size", "40"]):
        assert run(["render", "f.nc", "--camera", "roof.toml", *more, "-o", "x.png"]) == 0
    whole, moved, small = world.cameras
    assert whole == roof
    assert (moved.lat, moved.lon, moved.height_m, moved.lens_optics) == (48.0, 11.0, 30.0, roof.lens_optics)
    assert small == roof.resized(40)
    assert world.places[0].lat == 47.0
    capsys.readouterr()
    for wrong in (["--fov", "90"], ["--size", "40x40"]):
        assert run(["render", "f.nc", "--camera", "roof.toml", *wrong, "-o", "x.png"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert run(["render", "f.nc", "--camera", "roof.toml", "-o", "roof.toml"]) == 2


@pytest.mark.parametrize(("options", "quality"), [([], "standard"), (["--quality", "high"], "high")])
def test_the_quality_reaches_the_solver(world, options: list[str], quality: str) -> None:
    assert run(["render", "f.nc", *ARGUMENTS, *options, "-o", "x.png"]) == 0
    assert (world.solvers[0].name, world.solvers[0].quality) == ("fast", quality)


def test_the_sun_of_another_time_or_place(world) -> None:
    for given in ([], ["--sun", "2023-01-15T11:00Z"], ["--sun", "180,30.5"]):
        assert run(["render", "f.nc", *ARGUMENTS, *given, "-o", "x.png"]) == 0
    assert world.suns == [{}, {"time": np.datetime64("2023-01-15T11:00")}, {"sun": (180.0, 30.5)}]


def test_wavelengths_of_ones_own(world) -> None:
    assert run(["render", "f.nc", *ARGUMENTS, "--wavelengths", "640,550", "-o", "x.nc"]) == 0
    assert world.suns == [{"wavelengths_nm": (640.0, 550.0)}]


@pytest.mark.parametrize(
    ("options", "kind", "depth"),
    [(["--aod", "0.4"], "continental", 0.4), (["--aerosol", "dust"], "dust", 0.05), (["--aerosol", "none"], None, 0.0)],
)
def test_an_aerosol_of_ones_own(world, monkeypatch, capsys, options, kind, depth) -> None:
    clear, seen = openswim.Scene.clear(47.0, 11.0, terrain_m=2000.0), []
    monkeypatch.setitem(vars(openswim), "open_scene", lambda *_, **__: clear)
    monkeypatch.setitem(vars(openswim), "render", lambda scene, *_, **__: seen.append(scene) or _image())
    assert run(["render", "f.nc", *ARGUMENTS, *options, "-o", "x.png"]) == 0
    layers = seen[0].atmosphere.layers
    assert [(layer.name, layer.optical_depth) for layer in layers] == ([] if kind is None else [(kind, depth)])
    assert ("no aerosol" if kind is None else f"{kind}, optical depth {depth}") in capsys.readouterr().err


def test_a_flat_scene_takes_metres(world) -> None:
    assert run(["render", "f.nc", "--x", "100", "--y", "250", "-o", "x.png"]) == 0
    assert (world.cameras[0].x_m, world.cameras[0].y_m) == (100.0, 250.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "x.bmp"], "suffix"),
        (["-o", "missing/x.png"], "does not exist"),
        (["-o", "x.png", "--paths", "100"], "--paths belongs to --solver reference"),
        (["-o", "x.png", "--seed", "3", "--solver", "swim"], "--seed belongs to --solver reference"),
        (["-o", "x.png", "--quality", "high", "--solver", "swim"], "--quality belongs to --solver fast"),
        (["-o", "x.png", "--quality", "best"], "best"),
        (["-o", "x.png", "--solver", "reference", "--paths", "1"], "paths = 1"),
        (["-o", "x.png", "--solver", "reference", "--error", "150"], "target_error"),
        (["-o", "x.png", "--size", "big"], "--size"),
        (["-o", "x.png", "--wavelengths", "red"], "--wavelengths red"),
        (["-o", "x.png", "--wavelengths", "550,550"], "each once"),
        (["-o", "x.png", "--size", "0"], "--size 0"),
        (["-o", "x.png", "--size", "10x99999"], "--size 10x99999"),
        (["-o", "x.png", "--size", "20x30"], "square"),
        (["-o", "x.png", "--sun", "south,3"], "--sun south,3"),
        (["-o", "x.png", "--sun", "180,91"], "altitude of -90 to 90"),
        (["-o", "x.png", "--sun", "noon"], "noon"),
        (["-o", "x.png", "--azimuth", "3"], "has no --azimuth"),
        (["-o", "x.png", "--roll", "3"], "has no --roll"),
        (["-o", "x.png", "--view", "sphere", "--altitude-range", "0,9"], "has no --altitude-range"),
        (["-o", "x.png", "--view", "panorama", "--altitude-range", "9"], "BOTTOM,TOP"),
        (["-o", "x.png", "--exposure", "0:"], "ALTITUDE:EXPOSURE"),
        (["-o", "x.png", "--exposure", "0:1,5:2,0:3"], "an altitude twice"),
        (["-o", "x.png", "--exposure", "1/0s f/8 ISO100"], "ISO1600"),
        (["-o", "x.png", "--gamma", "-1"], "gamma"),
        (["-o", "x.jpg", "--bits", "16"], "JPEG has 8 bits"),
        (["-o", "x.png", "--altitude", "20"], "looks up"),
        (["-o", "x.png", "--view", "panorama", "--fov", "20"], "has no --fov"),
        (["-o", "x.png", "--height", "-3"], "height"),
        (["-o", "x.png", "--view", "fisheye"], "fisheye"),
        (["-o", "x.png", "--unknown"], "--unknown"),
        (["-o", "x.png", "--solver", "reference", "--checkpoint", "no/sums"], "--checkpoint no/sums: folder no"),
        (["-o", "x.png", "--solver", "reference", "--checkpoint", "x.png"], "would replace x.png"),
        (["-o", "x.nc", "-o", "x.png", "--exposure", "-1"], "exposure -1.0 must be a positive number"),
        (["-o", "x.nc", "-o", "x.png", "--exposure", "0"], "exposure 0.0 must be a positive number"),
        (["-o", "x.nc", "-o", "x.png", "--exposure", "nan"], "exposure nan must be a positive number"),
        ([], "--output"),
    ],
)
def test_mistakes_are_found_before_any_work(
    world, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run(["render", "f.nc", *ARGUMENTS, *arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith("openswim: error: ")
    assert words in said
    assert said.count("\n") == 1
    assert world.times == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments", [["in.nc"], ["in*.nc"], ["other.nc", "--albedo", "in.nc"], ["other.nc", "--dem", "in.nc"]]
)
def test_what_is_read_is_not_written_over(
    world, arguments: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "in.nc").write_text("precious")
    assert run(["render", *arguments, *ARGUMENTS, "-o", "in.nc"]) == 2
    assert "would replace in.nc" in capsys.readouterr().err
    assert (tmp_path / "in.nc").read_text() == "precious"
    assert world.times == []


def test_an_observer_is_needed(world, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "f.nc", "--lat", "3", "-o", "x.png"]) == 2
    assert "--lon" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (
            UserError("the observer stands\noutside the domain"),
            2,
            "error: the observer stands outside the domain",
        ),
        (ValueError("broken"), 1, "error: ValueError: broken (a fault of openswim; --debug shows where)"),
        (MemoryError(), 2, "out of memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_exit_codes(
    world,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    error: BaseException,
    code: int,
    words: str,
) -> None:
    def failing(*args, **kwargs):
        raise error

    monkeypatch.setitem(vars(openswim), "render", failing)
    assert run(["render", "f.nc", *ARGUMENTS, "-o", "x.png"]) == code
    said = capsys.readouterr().err
    assert words in said.splitlines()[-1]
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_write_leaves_nothing(world, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(self, path, *args, **kwargs):
        Path(path).write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(xr.Dataset, "to_netcdf", interrupted)
    assert run(["render", "f.nc", *ARGUMENTS, "-o", "x.nc"]) == 130
    assert list(tmp_path.iterdir()) == []


def test_debug_shows_the_traceback(world, monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    def failing(*args, **kwargs):
        raise ValueError("broken")

    monkeypatch.setitem(vars(openswim), "render", failing)
    for arguments in (
        ["render", "f.nc", *ARGUMENTS, "-o", "x.png", "--debug"],
        ["--debug", "render", "f.nc", *ARGUMENTS, "-o", "x.png"],
    ):
        assert run(arguments) == 1
        assert "Traceback" in capsys.readouterr().err


def test_the_demo_writes_four_pictures(
    world, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from openswim import lighting
    from openswim.scene import procedural

    scene = SimpleNamespace(place=(47.7, 11.2), source="made up")
    monkeypatch.setattr(procedural, "demo_scene", lambda: scene)
    monkeypatch.setattr(lighting, "light", lambda scene: scene)
    assert run(["demo", "-o", str(tmp_path / "new" / "folder")]) == 0
    names = sorted(p.name for p in (tmp_path / "new" / "folder").iterdir())
    assert names == [f"demo_{view}.png" for view in ("airborne", "allsky", "panorama", "space")]
    said = capsys.readouterr().out
    assert "irradiance: global 100.0" in said
    assert all((camera.lat, camera.lon) == (47.7, 11.2) for camera in world.cameras)
    assert len({camera.height_m for camera in world.cameras}) == 3  # ground (twice), air, space

    (tmp_path / "file").write_text("in the way")
    assert run(["demo", "-o", str(tmp_path / "file")]) == 2
    assert "cannot be made" in capsys.readouterr().err


def test_a_file_that_is_none(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for command in (["info"], ["render", *ARGUMENTS, "-o", str(tmp_path / "x.png")]):
        assert run([command[0], str(tmp_path / "none.nc"), *command[1:]]) == 2
        assert "no such file" in capsys.readouterr().err


def test_validate_says_when_there_is_nothing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run(["validate", str(tmp_path), "--seconds", "1"]) == 2
    assert "--seconds belongs to --solver reference" in capsys.readouterr().err
    assert run(["validate", str(tmp_path), "--solver", "swim", "--quality", "high"]) == 2
    assert "--quality belongs to --solver fast" in capsys.readouterr().err
    assert run(["validate", str(tmp_path), "--json", str(tmp_path / "rows.json")]) == 2
    assert not (tmp_path / "rows.json").exists()
    assert run(["validate", str(tmp_path), "--json", str(tmp_path / "no" / "rows.json")]) == 2
    assert "--json" in capsys.readouterr().err


def test_validate_names_what_the_linear_core_does_not_follow(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, shared: Path
) -> None:
    (tmp_path / "slabs.nc").symlink_to(shared / "reference/clouds/slabs_hg085.nc")
    assert run(["validate", str(tmp_path), "--solver", "linear"]) == 2
    told = capsys.readouterr().err
    assert "slabs.nc: solver linear: periods and nested grids are not followed" in told
    assert "nothing in it could be compared" in told


def test_validate_replaces_no_reference(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "sky.csv").write_text("a,b\n1,2\n")
    for name in ("sky.csv", "sky.json"):
        assert run(["validate", str(tmp_path), "--json", str(tmp_path / name)]) == 2
        assert "would replace" in capsys.readouterr().err
    assert (tmp_path / "sky.csv").read_text() == "a,b\n1,2\n"


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert openswim.__version__ in capsys.readouterr().out
    assert run(["render", "--help"]) == 0
    said = capsys.readouterr().out
    for option in (
        "--lat",
        "--lon",
        "--height",
        "--time",
        "--view",
        "--azimuth",
        "--altitude",
        "--fov",
        "--size",
    ):
        assert option in said


def test_a_film_has_the_options_of_a_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    from openswim.cli import film

    found: list[film.FilmRequest] = []
    monkeypatch.setattr(film, "run", found.append)
    assert run(["film", "x.nc", "--lat", "47", "--lon", "8", "--member", "3", "--quality", "preview",
                "--allow-references", "--every", "5min", "--fps", "10", "--speed", "2", "--no-title",
                "-o", "a.mp4"]) == 0  # fmt: skip
    picture = RenderRequest(Path("x.nc"), (), 47.0, 8.0, member=3, quality="preview", allow_references=True)
    assert found == [film.FilmRequest(picture, Path("a.mp4"), "5min", frames_per_second=10.0, speed=2.0, title=False)]


def test_a_film_of_each_member(monkeypatch: pytest.MonkeyPatch) -> None:
    from openswim import readers
    from openswim.cli import film

    found: list[film.FilmRequest] = []
    monkeypatch.setattr(film, "_run", found.append)
    monkeypatch.setattr(readers, "members_of", lambda file, allow: [5, 12])
    line = [
        "film",
        "x.nc",
        "--lat",
        "47",
        "--lon",
        "8",
        "--keogram",
        "k.png",
        "--irradiance",
        "i.csv",
        "-o",
        "day.mp4",
        "--member",
    ]
    assert run([*line, "all"]) == 0
    assert [(str(one.output), str(one.keogram), one.picture.member) for one in found] == [
        ("day_m005.mp4", "k_m005.png", 5), ("day_m012.mp4", "k_m012.png", 12)]  # fmt: skip
    monkeypatch.setattr(readers, "members_of", lambda file, allow: [])  # no ensemble
    assert run([*line, "all"]) == 0
    assert (found[-1].output, found[-1].picture.member) == (Path("day.mp4"), None)
    assert run([*line, "every"]) == 2


def test_views_are_those_that_cameras_have() -> None:
    """The command line names them itself, since cameras are not imported for --help."""
    assert tuple(VIEWS) == VIEWS_OF_OPTIONS


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; from openswim.cli.main import run; run(['--help']);"
        "heavy = {'numpy', 'xarray', 'numba', 'rich', 'skyfield', 'PIL', 'pyproj', 'zarr', 'netCDF4'};"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", ["README.md", "docs/running.md"])
def test_command_lines_of_the_pages_are_understood(world, page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every `openswim render` line in a block of a page, as it is pasted."""
    monkeypatch.setattr("openswim.optics.choosing.only", lambda scene, *names: scene)  # of a scene that has none
    text = (Path(__file__).parents[2] / page).read_text("utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.split("\n")]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("openswim render")]
    assert len(commands) > 3
    assert [run(command) for command in commands] == [0] * len(commands)
