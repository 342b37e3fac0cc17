"""What a fit cannot tell, in words and numbers."""

import numpy as np

from openswim.cameras.optics import Optics
from openswim.observations.star_fit import StarFit
from openswim.observations.track_fit import ALIKE, TrackFit

_MINUTES_PER_DEGREE = 4.0


def star_limits(fit: StarFit, lat: float) -> tuple[str, ...]:
    """Of a look at the stars."""
    optics = fit.chosen.optics
    zenith = np.degrees(np.arccos(np.clip(fit.matched.direction[:, 2], -1, 1)))
    return (
        "the clock and the place: both were taken as given, since an error of either looks like a tilt and a turn of "
        f"the camera. {_tilt_words(optics, lat)}",
        f"the lens nearer to the horizon than {90 - zenith.max():.0f} degrees, where no star was matched",
    )


def track_limits(fit: TrackFit, lat: float) -> tuple[str, ...]:
    """Of the way of the sun, or the moon, through the sky."""
    altitude = 90 - np.degrees(np.arccos(np.clip(fit.matched.direction[:, 2], -1, 1)))
    best = min(lens.held_out_px for lens in fit.lenses)
    alike = [lens for lens in fit.lenses if lens.held_out_px <= ALIKE * best]
    said = []
    if len(alike) > 1:
        listed = ", ".join(f"{lens.name} {lens.held_out_px:.1f} px" for lens in alike)
        said.append(f"the lens: these do as well ({listed}); {fit.chosen.name} was taken")
    if not fit.tilt_told:
        said.append("the tilt: the axis was taken as vertical; frames of another season, or stars, would tell it")
        said.append(
            "the clock, the date and the place: taken as given; a lens that is turned and shifted hides their errors"
        )
    said.append(
        f"the picture away from the {fit.body}'s way: between altitudes {altitude.min():.0f} and {altitude.max():.0f} "
        "degrees it was seen, the rest is the lens model's"
    )
    return tuple(said)


def _tilt_words(optics: Optics, lat: float) -> str:
    """Which clock and latitude would make the tilt."""
    toward = np.radians(optics.tilt_azimuth_deg)
    east, north = optics.tilt_deg * np.sin(toward), optics.tilt_deg * np.cos(toward)
    across = np.cos(np.radians(lat))
    found = f"The tilt found, {optics.tilt_deg:.2f} degrees toward azimuth {optics.tilt_azimuth_deg:.0f}"
    if across < 0.05:
        return f"{found}, may be part of such an error"
    minutes = abs(east / across) * _MINUTES_PER_DEGREE
    # the true zenith lies where the axis seems to lean away from: east of it the stars are ahead of the clock
    return (
        f"{found}, would also come of a vertical camera with a clock {minutes:.1f} minutes "
        f"{'slow' if east > 0 else 'fast'} and {abs(north):.2f} degrees farther {'north' if north > 0 else 'south'}"
    )
