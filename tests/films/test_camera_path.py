"""Paths of cameras: what is read, and where the camera is and looks in between."""

from pathlib import Path

import numpy as np
import pytest

from openswim import Camera, Scene, UserError
from openswim.cli.main import run
from openswim.films import CameraPath, film
from openswim.films.making import _count

NOON = np.datetime64("2024-06-01T12:00", "ms")
CLEAR = Scene.clear(47.0, 11.0, time=NOON)
CAMERA = Camera.allsky(47.0, 11.0, size=32)


def test_path_passes_its_points_and_looks_along_great_circles(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text(
        "time,lat,lon,height_m,azimuth,altitude\n2024-06-01T12:00:00Z,47,179.9,900,350,0\n"
        "2024-06-01T12:00:10Z,47,-179.9,400,10,0\n2024-06-01T12:00:20Z,47,-179.7,400,10,-20\n"
    )
    path = CameraPath.read(file)
    place, attitude = path.at(NOON + np.timedelta64(1000, "ms") * np.array([0, 5, 10, 15, 20]))
    np.testing.assert_allclose(place[[0, 2, 4], 1], [179.9, -179.9, -179.7])
    assert 179.9 < abs(place[1, 1]) <= 180.0  # the short way over the date line
    assert (np.diff(place[:, 2]) <= 1e-9).all()  # monotone: never below the last height
    np.testing.assert_allclose(attitude[:3, 0] % 360, [350, 0, 10], atol=1e-6)  # north turns by .1 degrees on the way
    np.testing.assert_allclose(attitude[2:, 1], [0, -10, -20], atol=1e-4)


def test_each_angle_of_a_path_counts_by_itself_and_turns_the_short_way(tmp_path: Path) -> None:
    base, file = Camera.perspective(0.0, 0.0, azimuth_deg=33.0, altitude_deg=7.0, size=32), tmp_path / "path.csv"
    for name, first, last, middle in (
        ("azimuth", 350, 10, 0), ("altitude", -4, 0, -2), ("roll", 359, 1, 0), ("fov", 40, 60, 50)
    ):  # fmt: skip
        file.write_text(f"time,lat,lon,height_m,{name}\n2024-06-01T12:00:00Z,47,11,900,{first}\n"
                        f"2024-06-01T12:00:10Z,47,11,900,{last}\n,,,,\n")  # fmt: skip
        camera = CameraPath.read(file).camera(base, np.array([NOON + np.timedelta64(5, "s")]))[0]
        told = {"azimuth": 33.0, "altitude": 7.0, "roll": 0.0, "fov": 60.0} | {name: middle}
        for key, value in told.items():
            turned = getattr(camera, f"{key}_deg") - value
            assert (turned + 180) % 360 - 180 == pytest.approx(0, abs=1e-9), (name, key)


def _path(place: list[tuple[float, ...]], *attitude: tuple[float, ...]) -> CameraPath:
    """A path with ten seconds from point to point; angles that are not given are the camera's own."""
    angles = np.full((len(place), 4), np.nan)
    for row, values in zip(angles, attitude, strict=False):
        row[: len(values)] = values
    return CameraPath(NOON + np.timedelta64(10_000, "ms") * np.arange(len(place)), np.array(place), angles)


OVER_THE_POLE = [(88.0, 20.0, 2e4), (90.0, 20.0, 2e4), (88.0, -160.0, 2e4)]


@pytest.mark.parametrize("angles", [((0.0, -10.0), (0.0, -10.0), (180.0, -10.0)), ((0.0,), (0.0,), (180.0,)), ()])
def test_over_the_pole_a_camera_goes_straight_on_and_looks_ahead(angles: tuple[tuple[float, ...], ...]) -> None:
    """What is north ahead of the pole is south behind it: nothing turns."""
    times = NOON + np.timedelta64(1000, "ms") * np.arange(0, 21)
    cameras = _path(OVER_THE_POLE, *angles).camera(Camera.perspective(0.0, 0.0, altitude_deg=-10.0, size=32), times)
    way = np.array([camera.lat for camera in cameras])
    assert (np.diff(way[:11]) > 0).all()
    assert (np.diff(way[10:]) < 0).all()
    for camera, time in zip(cameras, range(21), strict=True):
        lon, azimuth = (20.0, 0.0) if time < 10 else (-160.0, 180.0)
        assert camera.altitude_deg == pytest.approx(-10.0)
        if time != 10:  # at the pole any longitude is right, and the azimuth goes with it
            assert camera.lon == pytest.approx(lon)
            assert (camera.azimuth_deg - azimuth + 180) % 360 == pytest.approx(180.0, abs=1e-6)


@pytest.mark.parametrize("altitude", [0.0, -10.0])
def test_a_camera_that_turns_round_pans(altitude: float) -> None:
    """The great circle from a line of sight to the opposite one goes by the nadir, or anywhere."""
    path = _path([(47.0, 11.0, 9.0)] * 2, (20.0, altitude), (200.0, altitude))
    _, attitude = path.at(NOON + np.timedelta64(1000, "ms") * np.array([0, 5, 10]))
    np.testing.assert_allclose(attitude[:, 1], altitude, atol=1e-9)
    assert attitude[1, 0] % 180 == pytest.approx(110.0)
    np.testing.assert_allclose(attitude[[0, 2], 0], [20, 200], atol=1e-9)


def test_points_on_two_sides_of_the_earth_are_refused() -> None:
    with pytest.raises(UserError, match="other side of the Earth from point 1 to 2"):
        _path([(10.0, 0.0, 9.0), (-10.0, 180.0, 9.0)])


def test_angles_at_some_points_only_are_refused() -> None:
    attitude = np.full((2, 4), np.nan)
    attitude[0, 1] = 5.0
    with pytest.raises(UserError, match="no finite altitude at some points"):
        CameraPath(NOON + np.timedelta64(1000, "ms") * np.array([0, 10]), np.full((2, 3), 47.0), attitude)


def test_gpx_and_headings(tmp_path: Path) -> None:
    file = tmp_path / "track.gpx"
    points = "".join(
        f'<trkpt lat="47" lon="{11 + 0.01 * n}"><ele>800</ele><time>2024-06-01T12:00:{10 * n:02d}Z</time></trkpt>'
        for n in range(3)
    )
    file.write_text(f'<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>{points}</trkseg></trk></gpx>')
    when = np.array([NOON + np.timedelta64(9, "s")])
    camera = CameraPath.read(file).camera(Camera.perspective(0.0, 0.0, size=32), when)[0]
    assert camera.azimuth_deg == pytest.approx(90, abs=0.1)
    assert (camera.above, camera.height_m) == ("sea level", 800.0)


def test_a_camera_that_stops_goes_on_looking_ahead() -> None:
    times = NOON + np.timedelta64(1000, "ms") * np.array([0, 10, 60])
    place = np.array([[47.0, 11.0, 900.0], [47.0, 11.1, 900.0], [47.0, 11.1, 900.0]])
    path = CameraPath(times, place, np.full((3, 4), np.nan))
    when = NOON + np.timedelta64(1000, "ms") * np.array([0, 5, 20, 59])
    cameras = path.camera(Camera.perspective(0.0, 0.0, azimuth_deg=7.0), when)
    np.testing.assert_allclose([camera.azimuth_deg for camera in cameras], 90.0, atol=0.1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,lat\n2024-01-01,1\n", "no column lon, height_m"),
        ("time,lat,lon,height_m\n2024-01-01,1,2,3\n", "at least two points"),
        ("time,lat,lon,height_m\n2024-01-02,1,2,3\n2024-01-01,1,2,3\n", r"forward in time, and point 2 \(2024-01-01"),
        ("time,lat,lon,height_m\n2024-01-01,1,2,x\n", "line 2"),
        ("time,lat,lon,height_m\n2024-01-01,1,2,3\n2024-01-02,100,2,3\n", "places that are none"),
        ("time,lat,lon,height_m,azimut\n2024-01-01,1,2,3,4\n", "path.csv: .*unknown 'azimut': did you mean azimuth"),
        ("time,lat,lon,lat,height_m\n2024-01-01,1,2,1,3\n", "name twice"),
        ("time,lat,lon,height_m,azimuth\n2024-01-01,1,2,3,4\n\n2024-01-02,1,2,3,\n", "line 4: azimuth is '': .*leave"),
        ("time,lat,lon,height_m,roll\n2024-01-01,1,2,3,inf\n", "line 2: roll is 'inf': give a finite number"),
        ("time,lat,lon,height_m,fov\n2024-01-01,1,2,3\n", "line 2: fov is ''"),
        ("time,lat,lon,height_m\n2024-01-01,1,2,\n", "line 2: height_m is '': give a finite number$"),
        ("time,lat,lon,height_m\n2024-01-01,47,1,2,3\n", "line 2 has more cells"),
        (f"time,lat,lon,height_m\n2024-01-01,1,2,{'9' * 140_000}\n", "line 2 is no CSV"),
        ("\n", "no column time"),
        ("<gpx><!ENTITY a 'b'></gpx>", "declarations"),
        ("<gpx>", "damaged GPX"),
        ("time,lat,lon,height_m\n2024-01-01,1,1e18,3\n2024-01-02,1,2,3\n", "places that are none"),
        ("time,lat,lon,height_m\n2024-01-01,1,2,3\n2024-01-02,1,2,1e300\n", r"point 2 says \[1.0, 2.0, 1e\+300\]"),
        ("time,lat,lon,height_m\n2024-01-01,4_6,2,3\n2024-01-02,1,2,3\n", "line 2: lat is '4_6'"),
        ('time,lat,lon,height_m\n2024-01-01,"46\n.1",2,3\n2024-01-02,1,2,3\n', "line 3: lat is"),
        ('<gpx><trkpt lat="1" lon="2"><time>2024-01-01</time></trkpt></gpx>', "track point 1 has no height"),
        ("time,lat,lon,height_m,altitude\n2024-01-01,1,2,3,99\n2024-01-02,1,2,3,4\n", "altitude beyond 90 degrees"),
        ("time,lat,lon,height_m" + ",d" * 1000, "1004 columns"),
        ("time,lat,lon,height_m\n" + "1\n" * 100_001, "100001 points"),
        (f"<gpx xmlns='{'x' * 1000}'><a/></gpx>", "endless names"),
    ],
)
def test_paths_that_are_none_are_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text)
    with pytest.raises(UserError, match=message):
        CameraPath.read(file)


def test_a_folder_is_no_path_and_an_endless_film_is_told_shortly(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cannot be read as text \(Is a directory\): give a CSV"):
        CameraPath.read(tmp_path)
    with pytest.raises(UserError, match=r"film: 1\.5e\+300 frames; at most"):
        _count(1.5e300)


def test_what_a_camera_cannot_be_on_its_path_names_the_file(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("time,lat,lon,height_m,fov\n2024-01-01,1,2,3,60\n2024-01-02,1,2,3,-5\n")
    path = CameraPath.read(file)
    with pytest.raises(UserError, match=r"path\.csv: at 2024-01-02T00:00:00\.000: field of view -5"):
        path.camera(Camera.perspective(1, 2), path.time)


def test_a_path_has_times_of_its_own(tmp_path: Path) -> None:
    times = NOON + np.timedelta64(1000, "ms") * np.arange(2)
    path = CameraPath(times, np.array([[47.0, 11.0, 900.0]] * 2), np.full((2, 4), np.nan))
    with pytest.raises(UserError, match="times of its own"):
        film(CLEAR, CAMERA, tmp_path / "film", path=path, every_s=60.0)


def test_a_path_says_where_the_camera_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "path.csv"
    file.write_text("time,lat,lon,height_m\n2024-01-01T12:00,47,11,900\n2024-01-01T12:01,47,11.1,900\n")
    for option in ("--lat", "--x", "--y"):
        line = ["film", "none.nc", "--path", str(file), option, "10", "-o", str(tmp_path / "film")]
        assert run(line) == 2
        assert f"--path says where the camera is: leave out {option}" in capsys.readouterr().err


@pytest.mark.parametrize(("options", "told"), [
    (["--path", "p.csv", "--height", "5"], "by its column height_m: leave out --height"),
    (["--path", "p.csv", "--view", "perspective", "--azimuth", "5"], "by a column azimuth: leave out --azimuth"),
    (["--lat", "47", "--lon", "11", "--speed", "2"], "--speed is how fast a --path is played"),
])  # fmt: skip
def test_what_a_film_would_overlook_is_refused(
    options: list[str], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("p.csv").write_text("time,lat,lon,height_m\n2024-01-01T12:00,47,11,900\n2024-01-01T12:01,47,11.1,900\n")
    assert run(["film", "none.nc", *options, "-o", "film"]) == 2
    assert told in capsys.readouterr().err


def test_a_log_with_more_columns_is_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes: list[str] = []
    monkeypatch.setattr("openswim.films.camera_path.tell", notes.append)
    file = tmp_path / "path.csv"
    file.write_text("time,battery,lat,lon,height_m,speed,azimuth\n2024-01-01,x,1,2,3,,90\n2024-01-02,,1,2,3,7,80\n")
    path = CameraPath.read(file)
    assert path.attitude[:, 0].tolist() == [90.0, 80.0]
    assert np.isnan(path.attitude[:, 1:]).all()
    assert notes == [f"note: {file}: columns that are not used: 'battery', 'speed'"]
