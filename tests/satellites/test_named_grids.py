"""Grids by name: corners as others publish them, an observed picture's pixels, and the part that a model fills."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.cli.main import run
from openswim.errors import UserError
from openswim.satellites import FixedGrid, named_grid
from openswim.satellites.files import grid_of, read
from openswim.satellites.named_grids import shown_part
from openswim.scene.procedural import demo_scene

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared")) / "data/satellite/abi"


@pytest.mark.parametrize(
    ("imager", "name", "edges"),  # west, east, north (m) as pyresample's list of areas has them
    [
        ("goes-16 abi", "full", (-5434894.885056, 5434894.885056, 5434894.885056)),
        ("goes-18 abi", "full", (-5434894.885056, 5434894.885056, 5434894.885056)),
        ("goes-19 abi", "conus", (-3627271.2913, 1382771.9287, 4589199.5895)),
        ("goes-17 abi", "conus", (-2505021.6100, 2505021.6100, 4589199.5895)),
        ("himawari-9 ahi", "full", (-5499999.9012, 5499999.9012, 5499999.9012)),
        ("meteosat-11 seviri", "full", (-5568748.2758, 5568748.2758, 5568748.2758)),
        ("mtg-i1 fci", "full", (-5567999.9942, 5567999.9942, 5567999.9942)),
    ],
)
def test_their_corners_are_those_that_others_publish(imager: str, name: str, edges: tuple[float, ...]) -> None:
    grid = named_grid(imager, name)
    half = (grid.x[1] - grid.x[0]) / 2
    own = np.array([grid.x[0] - half, grid.x[-1] + half, grid.y[0] + half]) * grid.height_m
    np.testing.assert_allclose(own, edges, atol=20)  # of pixels of 2 to 3 km


def test_an_observed_picture_lies_on_the_grid_of_its_imager() -> None:
    files = sorted(SHARED.glob("*C04*CMI.tif"))
    if not files:
        pytest.skip("no observed picture")
    pytest.importorskip("rasterio")
    observed, grid = grid_of(read(files[0])), named_grid("goes-16 abi")
    for seen, own in ((observed.x, grid.x), (observed.y, grid.y)):
        place = (seen - own[0]) / (own[1] - own[0])
        np.testing.assert_allclose(place, np.round(place), atol=0.02)
    assert observed.lon_0 == grid.lon_0
    assert observed.sweep == grid.sweep


def test_the_part_of_a_grid_holds_the_domain_and_little_more() -> None:
    domain = demo_scene(16, 16, 16, spacing_m=2000.0).grid
    grid = named_grid("meteosat-10 seviri")
    part, every = shown_part(grid, domain)
    assert every == 1
    lat, lon = part.latlon()
    ix, iy = domain.index(lon, lat)
    within = (ix >= 0) & (ix <= 15) & (iy >= 0) & (iy <= 15)
    for axis in (0, 1):
        there = within.any(axis=axis)
        assert there.sum() >= there.size - 4
    coarse, every = shown_part(grid, domain, 2)
    np.testing.assert_array_equal(coarse.x, part.x[::2])
    assert shown_part(grid, None)[1] == 4
    with pytest.raises(UserError, match="not seen from"):
        shown_part(named_grid("himawari-9 ahi"), demo_scene(16, 16, 16, longitude=-80.0).grid)
    with pytest.raises(UserError, match="not on this grid"):
        shown_part(FixedGrid(grid.x[:100], grid.y[:100], 0.0), domain)


def test_a_view_of_a_grid_by_name_and_the_disc_from_l1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    demo_scene(16, 16, 16, spacing_m=2000.0).to_netcdf(tmp_path / "scene.nc")
    command = ["satellite", str(tmp_path / "scene.nc"), "--band", "VIS06", "--imager", "meteosat-10 seviri",
               "--solver", "swim"]  # fmt: skip
    out = tmp_path / "seen.nc"
    assert run([*command, "--grid", "full", "-o", str(out)]) == 0
    assert "reflectance factor, VIS06" in capsys.readouterr().out
    with xr.open_dataset(out) as seen:
        assert 0.02 < float(seen.reflectance_factor.mean()) < 1
        assert seen.geostationary.attrs["longitude_of_projection_origin"] == 0.0
    command[3], command[5] = "680", "dscovr epic"
    disc = ["--disc", "20.1", "11.0", "1470000", "--size", "2000"]
    assert run([*command, *disc, "-o", str(tmp_path / "disc.nc")]) == 0
    with xr.open_dataset(tmp_path / "disc.nc") as seen:
        assert seen.sizes["x"] == 2000
        assert np.isfinite(seen.reflectance_factor).sum() > 4
    near = ["--disc", "44.0", "11.0", "7200", "--size", "1000"]  # the disc is 124.7 degrees wide from there
    assert run([*command, *near, "-o", str(tmp_path / "near.nc")]) == 0
    with xr.open_dataset(tmp_path / "near.nc") as seen:
        on_earth = np.isfinite(seen.latitude.values)
        assert 900 < on_earth[500].sum() < 1000
        assert not on_earth[0, 0]
    assert run([*command, *disc, "-o", str(tmp_path / "disc.tif")]) == 2
    assert run([*command, "--grid", "full", "-o", str(out)]) == 2
    said = capsys.readouterr().err
    assert "has no fixed grid, which GeoTIFF needs" in said
    assert "dscovr epic has no fixed grid" in said
