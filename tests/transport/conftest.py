"""Defects that are known and not yet mended: their tests stand, and are expected to fail until they are."""

import pytest

KNOWN_DEFECTS = {
    "test_clear_conservative_air_gives_back_what_it_takes": "clear scenes do not fill up_top",
    "test_direct_flux_is_what_a_ray_to_the_sun_lets_through[haze]": "clear scenes: direct_bottom is delta-scaled",
    "test_an_empty_grid_changes_nothing[haze-open sky]": "the haze's peak is read at the nodes' own angles",
    "test_an_empty_grid_changes_nothing[haze-aureole]": "the haze's peak is read at the nodes' own angles",
    "test_wavelengths_do_not_know_of_each_other[one]": "sweeps stop before thick cloud has converged",
    "test_wavelengths_do_not_know_of_each_other[five]": "sweeps stop before thick cloud has converged",
    "test_overcast_sky_integrates_to_the_light_below_it": "swim: rays stop at depth 10.5, Eq. 14 wants the whole",
    "test_brightness_does_not_depend_on_how_finely_the_cloud_is_cut[33]": "swim: l = 2 is met to a step",
    "test_brightness_does_not_depend_on_how_finely_the_cloud_is_cut[65]": "swim: l = 2 is met to a step",
    "test_horizon_dips_as_the_earth_curves[3000.0]": "rays in vacuum may stall on the round ground",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.name in KNOWN_DEFECTS:
            item.add_marker(pytest.mark.xfail(reason=KNOWN_DEFECTS[item.name], strict=True))
