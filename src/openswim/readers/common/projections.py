"""Map projections from the attributes that CF has for them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyproj import CRS

_MERIDIAN = {"longitude_of_prime_meridian": 0.0, "prime_meridian_name": "Greenwich"}
_FIGURES = ({"earth_radius"}, {"reference_ellipsoid_name"}, {"semi_major_axis", "semi_minor_axis"},
            {"semi_major_axis", "inverse_flattening"})  # fmt: skip


def crs_of(attributes: Mapping[Any, Any]) -> CRS:
    """The projection that the attributes of a grid mapping describe.

    Of an Earth of their own without a meridian pyproj asks PROJ for Greenwich by its name, which takes .4 s: it is
    given here, and the projection is the same to the last word of its WKT.
    """
    from pyproj import CRS

    given = dict(attributes)
    if any(figure <= given.keys() for figure in _FIGURES) and not _MERIDIAN.keys() & given.keys():
        given |= _MERIDIAN
    return CRS.from_cf(given)
