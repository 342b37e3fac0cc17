"""Projections from CF's attributes."""

import pytest
from pyproj import CRS

from openswim.readers.common.projections import crs_of

ROTATED = {
    "grid_mapping_name": "rotated_latitude_longitude", "grid_north_pole_latitude": 39.25,
    "grid_north_pole_longitude": -162.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "given",
    [
        {"earth_radius": 6371229.0},
        {"reference_ellipsoid_name": "GRS 1980"},
        {"semi_major_axis": 6378137.0, "inverse_flattening": 298.257223563},
        {"earth_radius": 6371229.0, "prime_meridian_name": "Paris"},
        {"semi_major_axis": 6378137.0},
        {},
    ],
)
def test_they_are_those_of_pyproj_to_the_last_word(given):
    """Which thinks for .4 s where it is not told of the meridian."""
    assert crs_of(ROTATED | given).to_wkt() == CRS.from_cf(ROTATED | given).to_wkt()
