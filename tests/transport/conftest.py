"""Defects that are known and not yet mended: their tests stand, and are expected to fail until they are."""

import pytest

KNOWN_DEFECTS = {
    "test_clear_conservative_air_gives_back_what_it_takes": "clear scenes do not fill up_top",
    "test_direct_flux_is_what_a_ray_to_the_sun_lets_through[haze]": "clear scenes: direct_bottom is delta-scaled",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.name in KNOWN_DEFECTS:
            item.add_marker(pytest.mark.xfail(reason=KNOWN_DEFECTS[item.name], strict=True))
