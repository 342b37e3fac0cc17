"""Which lights are solved for: all of the brightest, none that counts for nothing, and no leap between."""

import csv
import math
import os
from pathlib import Path

import numpy as np
import pytest

from openswim.lights.illuminance import _MOON, _SUN, NIGHT_SKY_LX, _lux, shares, sun_lux
from openswim.lights.refraction import lit_altitude_deg


def test_lux_of_the_explanatory_supplement():
    shared = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
    table = shared / "reference/night/horizontal_illuminance.csv"
    if not table.exists():
        pytest.skip(f"reference data not found: {table}")
    for row in csv.DictReader(table.read_text().splitlines()):
        found = _lux(float(row["altitude_deg"]), _SUN if row["light"] == "sun" else _MOON)
        if row["phase_angle_deg"]:
            phase = float(row["phase_angle_deg"])
            found *= 10 ** (-8.68e-3 * phase - 2.2e-9 * phase**4)
        assert math.log10(found / float(row["horizontal_illuminance"])) == pytest.approx(0, abs=0.02)


def test_lights_fade_in_and_out():
    """From day to night: every light's share is smooth, and what is left out is never more than a hundredth."""
    before = None
    for altitude in np.arange(5.0, -25.0, -0.05):
        lux = {"sun": sun_lux(altitude), "moon": 0.05, "sky": NIGHT_SKY_LX}
        part = shares(lux)
        lost = sum(own * (1 - part[name]) for name, own in lux.items()) / sum(lux.values())
        assert lost < 0.013
        if before is not None:
            assert all(abs(part[name] - before[name]) < 0.12 for name in part)
        before = part
    assert shares({"sun": 1e5, "moon": 0.2, "sky": 1e-3}) == {"sun": 1.0, "moon": 0.0, "sky": 0.0}


def test_the_sun_that_lights_the_sky_sets_smoothly():
    """Lifted by refraction while it is up, by less below; never the faster for it than twice the true one."""
    true = np.arange(3.0, -8.0, -0.01)
    lifted = np.array([lit_altitude_deg(float(at)) for at in true])
    assert (np.diff(lifted) < 0).all()
    assert np.diff(lifted).min() > -0.02
    assert lifted[0] - true[0] == pytest.approx(0.24, abs=0.02)
    assert lifted[-1] - true[-1] == pytest.approx(0.2, abs=0.01)
