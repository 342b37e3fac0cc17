"""Around the clock nothing leaps: benchmarks/whole_day.py at some of its minutes."""

import numpy as np
import pytest

from openswim.validation.night.whole_day import Skies, steps


@pytest.mark.slow
def test_no_minute_leaps():
    """Three minutes in a row at noon, through dusk, night and dawn over the Alps. Over all minutes of three places
    (benchmarks/README.md) the zenith changes by less than .34 magnitudes, and from one minute to the next by .052."""
    skies = Skies.over(47.3, 11.4)
    for start in ("11:16", "18:58", "19:16", "19:49", "20:20", "20:52", "22:58", "02:12", "03:20"):
        minutes = np.datetime64(f"2024-06-21T{start}", "m") + np.arange(3)
        zenith, lux = np.array([skies.at(minute) for minute in minutes]).T
        assert np.isfinite([zenith, lux]).all()
        assert min(zenith.min(), lux.min()) > 0
        step, change = steps(zenith)
        assert step.max() < 0.2
        assert change.max() < 0.008
