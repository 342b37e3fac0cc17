"""Whether a message's points can run as its scanning mode says, beside its first and last place."""

from __future__ import annotations

from typing import Any

from openswim.errors import UserError

_WITHIN = 0.5  # of a step of longitude, to which ends and increment agree


def check_scanning(what: str, keys: dict[str, Any], nx: int) -> None:
    """UserError where points between two latitudes and longitudes run the other way than the scanning mode says.

    For grids with a first and a last place: of latitudes and longitudes (rotated ones too), and Gaussian. Which of both
    is right nobody can say, and a picture of the wrong one is mirrored.
    """
    first, last = (keys[f"latitudeOf{end}GridPointInDegrees"] for end in ("First", "Last"))
    if first is not None and last is not None and first != last and bool(keys["jScansPositively"]) != (last > first):
        toward = "north" if keys["jScansPositively"] else "south"
        raise UserError(
            f"{what}: rows run from latitude {first:g} to {last:g}, but {toward}ward by the scanning mode: one of both "
            "is damaged: download the file again, or set jScansPositively right (grib_set)"
        )
    first, last = (keys[f"longitudeOf{end}GridPointInDegrees"] for end in ("First", "Last"))
    step = keys["iDirectionIncrementInDegrees"]
    if first is None or last is None or not step or not 0 < step < 360.0:
        return
    across = step * (nx - 1)
    east, west = ((sign * (last - first) - across + 180.0) % 360.0 - 180.0 for sign in (1, -1))
    said, other = (west, east) if keys["iScansNegatively"] else (east, west)
    if abs(said) > _WITHIN * step >= abs(other):
        toward = "west" if keys["iScansNegatively"] else "east"
        raise UserError(
            f"{what}: {nx} columns of {step:g} degrees run from longitude {first:g} to {last:g}, but {toward}ward by "
            "the scanning mode: one of both is damaged: download the file again, or set iScansNegatively right "
            "(grib_set)"
        )

