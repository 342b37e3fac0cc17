"""Rays through prisms of ice, and what level plates show, against tables of other codes (skipped without them)."""

import numpy as np
import pytest
from tests.optics.test_displays import RGB_NM, rows

from openswim.transport.ice import plates
from openswim.transport.ice.prisms import MOST_WAYS, scattered, trace


def test_light_through_a_prism_is_kept():
    ways = np.zeros((MOST_WAYS + 1, 4))
    direction = np.array([0.3, -0.5, -0.2]) / np.linalg.norm([0.3, -0.5, -0.2])
    count = trace(0.1, 0.2, 0.0, *direction, 1.31, 0.8, ways)
    assert count >= 3
    assert ways[:count, 3].sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(np.linalg.norm(ways[:count, :3], axis=1), 1.0, atol=1e-9)
    assert trace(5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.31, 0.8, ways) == 0
    assert scattered(1.31, 1.0, 2000, 180).sum() == pytest.approx(1.0, abs=1e-9)


ALTITUDE = (np.arange(plates.ALTITUDES) + 0.5) * 180 / plates.ALTITUDES - 90
AZIMUTH = (np.arange(plates.AZIMUTHS) + 0.5) * 180 / plates.AZIMUTHS


def test_sundogs_and_arcs_of_level_plates():
    """Bravais' angles of minimum deviation, the inner edge; tilts and the disc of the sun blur it."""
    seen = 0
    for row in rows("halos"):
        if row["sun_altitude_deg"] not in ("5", "20", "30") or float(row["wavelength_nm"]) not in RGB_NM:
            continue
        sun = float(row["sun_altitude_deg"])
        table = plates.phase_map(float(row["wavelength_nm"]), sun, 400_000)
        if row["quantity"] == "parhelion (sun dog), azimuth distance from the sun":
            profile = table[np.abs(ALTITUDE - sun) < 1].mean(axis=0) * ((AZIMUTH > 15) & (AZIMUTH < 100))
            half = 0.5 * profile.max()
            k = int(np.argmax(profile > half))
            edge = np.interp(half, profile[k - 1 : k + 1], AZIMUTH[k - 1 : k + 1])
            assert (edge - float(row["value"])) * np.cos(np.radians(sun)) == pytest.approx(0.0, abs=0.26)
            seen += 1
        elif row["quantity"].startswith("circumzenithal arc, altitude") and sun < 30:
            profile = table[:, AZIMUTH < 6].mean(axis=1) * (ALTITUDE > 50)
            assert ALTITUDE[np.argmax(profile)] == pytest.approx(float(row["value"]), abs=0.45)
            seen += 1
    assert seen >= 4


def test_level_plates_mirror_the_sun_below_the_horizon():
    table = plates.phase_map(546.0, 33.0, 200_000)
    below = table[:, 0] * (ALTITUDE < -10)
    assert ALTITUDE[np.argmax(below)] == pytest.approx(-33.0, abs=0.4)


def test_level_plates_keep_the_light():
    """Half is diffraction; of the other half what does not go straight on is in the map, here nearly nothing less than
    what prisms of all orientations turn aside, since there is more than one way through a level plate."""
    sphere = 0.5 * np.diff(np.sin(np.radians(np.linspace(-90, 90, plates.ALTITUDES + 1))))[:, None] / plates.AZIMUTHS
    turned = [float((2 * plates.phase_map(546.0, sun, 50_000) * sphere).sum()) for sun in (10.0, 40.0, 80.0)]
    assert turned[0] > turned[1] > turned[2] > 0.08  # straight down all but what two faces reflect goes on
    assert max(turned) < 1.0
