"""The stars that pictures show, on frames of real cameras: where the frame's own bright points are."""

import numpy as np
import pytest

from openswim.heavens.points import Points, drawn_points, points_over
from openswim.observations.calibration import calibrate
from openswim.observations.frames import read_frame
from openswim.observations.peaks import find_peaks
from openswim.optics.bent_rays import Refraction
from openswim.scene.atmosphere import Atmosphere


@pytest.mark.slow
def test_drawn_stars_lie_on_those_of_the_frame(shared):
    """Stars to magnitude 2.6 more than 15 degrees high, drawn through the fitted camera as a picture draws them: nearly
    all have a bright point of the frame within three of its own residuals, in the median within one. The camera of
    Svalbard does as well."""
    path, lat, lon, height_m, brightest = shared / "data/sky/happyjack/008.fits.bz2", 34.7444, -111.4221, 2361.0, 2.6
    found = calibrate(path, lat, lon, height_m)
    frame = read_frame(path)
    peaks = find_peaks(frame.green).place
    refraction = Refraction.at(Atmosphere.us_standard(), height_m)
    every = points_over(frame.time, lat, lon, height_m, refraction)
    bright = np.flatnonzero((every.magnitude < brightest) & (every.altitude_deg > 15))
    stars = Points(*(getattr(every, part)[bright] for part in every.__dataclass_fields__))
    camera = found.camera
    wavelengths, toa = np.array([550.0]), np.array([1.86])

    def open_sky(direction, width):
        return np.ones((len(direction), 1)), np.zeros(len(direction), bool)

    drawn = drawn_points(stars, camera, camera.pixels(), wavelengths, toa, open_sky)
    missed = []
    for star in range(len(bright)):
        row, column = camera.pixel_of(stars.azimuth_deg[star], stars.altitude_deg[star])
        own = np.flatnonzero((abs(drawn.row - row) < 4) & (abs(drawn.column - column) < 4))
        weight = drawn.radiance[own, 0]
        at = np.array([weight @ drawn.row[own], weight @ drawn.column[own]]) / weight.sum()
        missed.append(np.linalg.norm(peaks - at, axis=1).min())
    residual = found.chosen.held_out_px
    assert len(missed) > 15
    assert np.median(missed) < residual
    assert np.mean(np.array(missed) < 3 * residual) > 0.8
