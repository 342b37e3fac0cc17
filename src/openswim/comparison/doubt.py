"""What a frame shows that cannot be at its time: daylight by night, a red sky by day."""

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.comparison.cloud_rules import log_red_blue
from openswim.comparison.prepared import Prepared
from openswim.comparison.scores import Region
from openswim.comparison.settings import weighted_median
from openswim.lights import moon_position
from openswim.observations import SkyFrame
from openswim.observations.sun_spot import find_spot
from openswim.scene.frame import horizon_vector

F64 = NDArray[np.float64]

# ln(red/blue) of linear light, medians over skies: of 27 real frames by day of 6 cameras, clear to overcast, with the
# sun 10 to 59 degrees up, -1.06 to -.21, clear ones below -.6; of two by night +.90, and -.24 in aurora and moonlight
_RED, _BLUE = 0.1, -0.5
_ALIKE = 0.3  # r of ln(red/blue) with the simulated sky's once swapped; of 12 clear frames .54 to .76, by night .22
_HIGH_DEG, _DARK_DEG = 10.0, -12.0  # of the sun: lower ones redden the sky, higher ones leave it twilight
_LEAST_SR = 0.3  # a twentieth of the sky
_DIMMEST = 0.1  # share of full scale as stored, below which colours are of noise; a dim starry sky has .12
_NEAR_MOON_DEG = 6.0  # a spot's middle from the moon; .3 to .8 in three real frames


def doubt(
    seen: SkyFrame, camera: Camera, frame: Prepared, simulated: F64, region: Region, sun_altitude_deg: float,
    place: tuple[float, float], red_blue: float | None,
) -> str:  # fmt: skip
    """Half a sentence, empty where nothing is odd; simulated: radiance (ny, nx, 3); place: latitude and longitude;
    red_blue: the camera's white balance, if it is known."""
    coloured = len(frame.channels) == 3 and region.weight.sum() > _LEAST_SR
    found = ""
    if sun_altitude_deg < _DARK_DEG:
        found = _spot_by_night(seen, camera, place) or (_blue_night(seen, frame, region, place) if coloured else "")
    elif sun_altitude_deg > _HIGH_DEG and coloured:
        found = _red_day(frame, simulated, region, sun_altitude_deg, red_blue or 0.0)
    return found


def _spot_by_night(seen: SkyFrame, camera: Camera, place: tuple[float, float]) -> str:
    spot = find_spot(seen, ~camera.open_sky())
    if spot is None:
        return ""
    moon = moon_position(seen.time, *place)
    there = horizon_vector(*camera.direction_of(spot.row, spot.column))
    away = np.degrees(np.arccos(np.clip(there @ horizon_vector(moon.azimuth_deg, moon.refracted_altitude_deg), -1, 1)))
    if not away > _NEAR_MOON_DEG:
        return ""
    where = f"lies {away:.0f} degrees from the moon" if moon.refracted_altitude_deg > 0 else "is there without a moon"
    return f"a round bright spot {where}, and the sun is down: a frame by day, a lamp, or a wrong time, zone or place"


def _blue_night(seen: SkyFrame, frame: Prepared, region: Region, place: tuple[float, float]) -> str:
    """Moonlight makes a sky as blue as sunlight does."""
    if moon_position(seen.time, *place).refracted_altitude_deg > 0:
        return ""
    level = np.median(frame.stored[region.valid])
    typical = weighted_median(log_red_blue(frame.linear[region.valid]), region.weight)
    if level < _DIMMEST or not typical < _BLUE:
        return ""
    return (
        "its sky is as blue as by day, and neither sun nor moon is up: a frame by day, or a wrong time, zone or place"
    )


def _red_day(frame: Prepared, simulated: F64, region: Region, sun_altitude_deg: float, red_blue: float) -> str:
    seen = log_red_blue(frame.linear[region.valid]) - red_blue
    if not weighted_median(seen, region.weight) > _RED:
        return ""
    said = f"its sky is red rather than blue with the sun {sun_altitude_deg:.0f} degrees up"
    sky = log_red_blue(simulated[region.valid])
    if seen.std() > 0 and sky.std() > 0 and np.corrcoef(seen, sky)[0, 1] < -_ALIKE:
        return f"{said}, and is like the simulated one once red and blue are swapped: save it with red first"
    return f"{said}: red and blue are swapped, smoke or dust, a frame by night, or a wrong time, zone or place"
