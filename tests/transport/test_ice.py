"""Rays through prisms of ice, and what level plates and columns show, against tables of other codes (skipped without
them) and least deviation."""

import numpy as np
import pytest
from tests.optics.test_displays import RGB_NM, rows

from openswim.optics.displays import crystals
from openswim.transport.ice import level
from openswim.transport.ice.prisms import MOST_WAYS, scattered, trace
from openswim.validation.level_crystals import ALTITUDE_DEG, AZIMUTH_DEG, edge_deg, place_deg


def test_light_through_a_prism_is_kept():
    ways = np.zeros((MOST_WAYS + 1, 4))
    direction = np.array([0.3, -0.5, -0.2]) / np.linalg.norm([0.3, -0.5, -0.2])
    count = trace(0.1, 0.2, 0.0, *direction, 1.31, 0.8, ways)
    assert count >= 3
    assert ways[:count, 3].sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(np.linalg.norm(ways[:count, :3], axis=1), 1.0, atol=1e-9)
    assert trace(5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.31, 0.8, ways) == 0
    assert scattered(1.31, 1.0, 2000, 180).sum() == pytest.approx(1.0, abs=1e-9)


DISC_DEG = 0.2665
HALF_AT = 0.42  # radii before the edge: where half is of what falls as 1/sqrt(angle), averaged over a disc


def least_deviation_deg(index, lean_deg):
    """By two faces that meet in 60 degrees, of rays that lean from the plane across their edge (Bravais)."""
    sine, cosine = np.sin(np.radians(lean_deg)), np.cos(np.radians(lean_deg))
    return np.degrees(2 * np.arcsin(0.5 * np.sqrt(index**2 - sine**2) / cosine)) - 60


def test_sundogs_of_level_plates():
    """The edge stands where deviation is least for the sun's middle, less what its disc makes of it; the azimuth grows
    with the sun's altitude, so that the disc counts more for a high sun."""
    seen = 0
    for row in rows("halos"):
        name, wavelength, sun = row["quantity"], float(row["wavelength_nm"]), row["sun_altitude_deg"]
        if not name.startswith("parhelion (sun dog)") or wavelength not in RGB_NM or float(sun) not in (5, 20, 30, 45):
            continue
        sun, index = float(sun), crystals.refractive_index(wavelength)
        shrunk = np.cos(np.radians(sun))
        slope = shrunk * np.diff([least_deviation_deg(index, sun + d) for d in (-0.1, 0.1)])[0] / 0.2
        found = place_deg("parhelion (sun dog), azimuth", wavelength, sun)
        away = (found - float(row["value"])) * shrunk
        assert away == pytest.approx(-HALF_AT * DISC_DEG * np.hypot(1, slope), abs=0.05)
        seen += 1
    assert seen >= 6


@pytest.mark.parametrize(("name", "suns"), [("circumzenithal arc, altitude", (5, 20, 25)),
                                            ("circumhorizontal arc, altitude", (60, 65, 70))])  # fmt: skip
def test_arcs_of_level_plates(name, suns):
    seen = 0
    for row in rows("halos"):
        wavelength, sun = float(row["wavelength_nm"]), row["sun_altitude_deg"]
        if row["quantity"].startswith(name) and wavelength in RGB_NM and float(sun) in suns:
            bound = 0.06 if float(sun) != 60 else 0.13  # where an arc appears it stands far below, and is broad
            assert place_deg(name, wavelength, float(sun)) == pytest.approx(float(row["value"]), abs=bound), row
            seen += 1
    assert seen >= 3


def test_tilts_move_arcs_little_where_deviation_is_least():
    """There a degree's tilt counts in second order only. Elsewhere it blurs: a sundog of a sun of 45 degrees begins
    half a degree early."""
    arc = "circumzenithal arc, altitude"
    shift = [place_deg(arc, 546.0, sun, level.TILT_DEG) - place_deg(arc, 546.0, sun) for sun in (20.0, 25.0)]
    np.testing.assert_allclose(shift, 0.0, atol=0.06)
    dog = "parhelion (sun dog), azimuth"
    early = [place_deg(dog, 546.0, sun, level.TILT_DEG) - place_deg(dog, 546.0, sun) for sun in (0.0, 45.0)]
    assert early[0] == pytest.approx(0.0, abs=0.03)
    assert -0.65 < early[1] < -0.4


@pytest.mark.parametrize("sun", [20.0, 45.0])
def test_tangent_arcs_of_level_columns(sun):
    """Rays through a column whose axis points to some azimuth are turned least by what Bravais says of how they lean;
    all axes together draw the arc, which touches the halo above and, for a high sun, below."""
    index = crystals.refractive_index(546.0)
    table = level.phase_map(546.0, sun, 1_000_000, "column", 0.0)
    up = np.radians(sun)
    toward = np.array([np.cos(up), 0.0, np.sin(up)])
    for sign in (1, -1) if sun > 40 else (1,):
        for axis_deg in (90.0, 80.0, 70.0):
            axis = np.array([np.cos(np.radians(axis_deg)), np.sin(np.radians(axis_deg)), 0.0])
            turn = sign * np.radians(least_deviation_deg(index, np.degrees(np.arcsin(toward @ axis))))
            x, y, z = (
                toward * np.cos(turn) - np.cross(axis, toward) * np.sin(turn)
                + axis * (axis @ toward) * (1 - np.cos(turn))
            )  # fmt: skip
            altitude, azimuth = np.degrees(np.arcsin(z)), abs(np.degrees(np.arctan2(y, x)))
            near = np.abs(ALTITUDE_DEG - altitude) < 3
            profile = table[:, np.abs(AZIMUTH_DEG - azimuth) < 0.3].mean(axis=1)[near][::sign]
            edge = edge_deg(ALTITUDE_DEG[near][::sign], profile)
            assert sign * (edge - altitude) == pytest.approx(-HALF_AT * DISC_DEG, abs=0.08)


def test_level_plates_mirror_the_sun_below_the_horizon():
    assert place_deg("subsun, altitude", 546.0, 33.0) == pytest.approx(-33.0, abs=0.01)


@pytest.mark.parametrize("shape", ["plate", "column"])
def test_level_crystals_keep_the_light(shape):
    """Half is diffraction; of the other half what does not go straight on is in the map. A low sun's light is turned
    aside by most plates, of a high sun's most goes straight down; all of a column's is turned but what two side faces
    pass."""
    edges = np.radians(np.linspace(-90, 90, level.ALTITUDES + 1))
    sphere = 0.5 * np.diff(np.sin(edges))[:, None] / level.AZIMUTHS
    turned = [float((2 * level.phase_map(546.0, sun, 50_000, shape) * sphere).sum()) for sun in (10.0, 40.0, 80.0)]
    assert max(turned) < 1.0
    if shape == "plate":
        assert turned[0] > turned[1] > turned[2] > 0.08  # straight down all but what two faces reflect goes on
    else:
        assert min(turned) > 0.5
