"""Files in JEDI's layout."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from netCDF4 import Dataset
from tests.assimilation.toy import flat_scene, toy_core

from openswim import Camera, UserError
from openswim.assimilation import observe, write_observations

ABOVE = Camera.satellite(0.0, 0.0, 5e4, fov_deg=0.4, size=5)


def test_groups_names_and_numbers(tmp_path: Path) -> None:
    scene = flat_scene()
    down = Camera.perspective(x_m=250.0, y_m=200.0, height_m=2000.0, altitude_deg=-89.9, fov_deg=10.0, size=(5, 5))
    down = type(down)(**{**down.__dict__, "above": "sea level"})
    cameras, points = [Camera.allsky(x_m=200.0, y_m=250.0, size=9), down], [(100.0, 200.0)]
    core = toy_core(scene, cameras, points, 2)
    given = {"controls": "extinction_cloud", "core": core}
    op = observe(scene, cameras, points, (550.0, 650.0), time="2024-06-21T12:30", **given)
    seen = op(op.first())
    images = [image.to_dataset(name="radiance") for image in op.pictures(seen)]
    observed = op.observations(images, op.irradiance_w_m2(seen))
    paths = write_observations(tmp_path / "seen.nc", op, observed, seen)
    assert [path.name for path in paths] == ["seen.nc", "seen_irradiance.nc"]
    with Dataset(paths[0]) as file:
        assert file.getncattr("_ioda_layout") == "ObsGroup"
        assert set(file.groups) == {"MetaData", "ObsValue", "ObsError", "PreQC", "hofx"}
        count = sum(each.rays for each in op.instruments)
        assert file["ObsValue/radiance"].dimensions == ("Location", "Channel")
        assert file["ObsValue/radiance"].shape == (count, 2)
        assert file["MetaData/dateTime"][0] == np.datetime64("2024-06-21T12:30", "s").astype(int)
        assert file["MetaData/dateTime"].units == "seconds since 1970-01-01T00:00:00Z"
        assert np.allclose(file["MetaData/sensorCentralWavelength"][:], [0.55, 0.65])
        first = op.parts[0]
        assert np.allclose(file["hofx/radiance"][: first.shape[1], 1], seen.values[first.here].reshape(first.shape)[1])
        quality = file["PreQC/radiance"][: first.shape[1], 0]
        assert np.array_equal(quality == 0, op.instruments[0].usable)
        # the camera above looks straight down on its place, the one below stands where it is
        last = count - 1 - down.shape[0] * down.shape[1] // 2
        per_degree = np.radians(1.0) * scene.earth_radius_m
        assert file["MetaData/latitude"][last] == pytest.approx(40.0 + 200.0 / per_degree, abs=1e-4)
        assert file["MetaData/sensorZenithAngle"][last] == pytest.approx(0.1, abs=0.02)
        assert file["MetaData/latitude"][0] == pytest.approx(40.0 + 250.0 / per_degree, abs=1e-5)
        sun = op.instruments[0].sun
        assert file["MetaData/solarZenithAngle"][0] == pytest.approx(90 - sun[1], abs=1e-4)
        assert set(file["MetaData/stationIdentification"][:]) == {"camera 0", "camera 1"}
    with Dataset(paths[1]) as file:
        assert file["ObsValue/globalHorizontalIrradiance"][0] == pytest.approx(op.irradiance_w_m2(seen)[0], rel=1e-6)


def test_what_ioda_has_no_name_for(tmp_path: Path) -> None:
    scene, cameras = flat_scene(), [Camera.allsky(x_m=200.0, y_m=250.0, size=5)]
    core = toy_core(scene, cameras)
    given = {"controls": "extinction_cloud", "core": core}
    op = observe(scene, cameras, sun=(140.0, 50.0), **given)
    with pytest.raises(UserError, match="no time"):
        write_observations(tmp_path / "a.nc", op, op.observations([op.pictures(op(op.first()))[0].values]))
    dated = replace(scene, time=np.datetime64("2024-06-21T12:00", "ms"))
    for time in (None, "2024-06-21T12:30"):  # a sun of one's own leaves the observations' time as it is
        op = observe(dated, cameras, time=time, sun=(140.0, 50.0), **given)
        image = op.pictures(op(op.first()))[0].values
        observed = op.observations([image])
        with pytest.raises(UserError, match="both 0"):
            op.observations([image], noise=0.0)
        (path,) = write_observations(tmp_path / "b.nc", op, observed)
        with Dataset(path) as file:
            when = np.datetime64(time or dated.time, "s").astype(int)
            assert set(file["MetaData/dateTime"][:].tolist()) == {when}
            assert file["MetaData/solarZenithAngle"][0] == pytest.approx(40.0, abs=0.01)
    op = observe(scene, cameras, time="2024-06-21T12:30", quantity="log_radiance", **given)
    with pytest.raises(UserError, match="no name for log_radiance"):
        write_observations(tmp_path / "a.nc", op, op.observations([np.full((5, 5), 0.1)]))
