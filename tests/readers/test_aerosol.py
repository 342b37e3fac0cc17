"""A file's own aerosol: optical depths by kind, CAMS in GRIB, and how it goes on beyond the domain."""

import netCDF4
import numpy as np
import pytest
from tests.readers import grib_files as gf

from openswim.optics.aerosol_depth import aerosol_depth
from openswim.readers import describe, open_scene
from openswim.readers.fields.aerosol_beyond import layers_beyond
from openswim.readers.fields.aerosol_by_depth import from_depths
from openswim.readers.fields.aerosol_species import BY_DEPTH, LIKE, optics_by_depth

GEFS = "gefs.chem.20240309t00z.a2d_0p25.f000.subset.grib2"
KINDS = {62001: "dust", 62006: "sulphate", 62008: "sea_salt", 62009: "black_carbon", 62010: "organic_matter"}


def _depths(path) -> dict[int, tuple[np.ndarray, float]]:
    """Optical depth at 550 nm by type of aerosol, from the south, and the step of its packing."""
    import eccodes

    found = {}
    with path.open("rb") as file:
        while (handle := eccodes.codes_grib_new_from_file(file)) is not None:
            key = (eccodes.codes_get(handle, "parameterNumber"), eccodes.codes_get(handle, "discipline"))
            wavelength = eccodes.codes_get(handle, "scaledValueOfFirstWavelength")
            if key == (102, 0) and wavelength == 545:
                shape = eccodes.codes_get(handle, "Nj"), eccodes.codes_get(handle, "Ni")
                values = eccodes.codes_get_values(handle).reshape(shape)
                down = eccodes.codes_get(handle, "jScansPositively") == 0
                scale = 10.0 ** -eccodes.codes_get(handle, "decimalScaleFactor")
                step = 2.0 ** eccodes.codes_get(handle, "binaryScaleFactor") * scale
                found[eccodes.codes_get(handle, "aerosolType")] = values[::-1] if down else values, step
            eccodes.codes_release(handle)
    return found


def test_gefs_species_are_read_and_replace_the_background(nwp):
    """Above any place the depth is the file's total, within what packing costs, and no default is added."""
    scene = open_scene(nwp / GEFS)
    assert set(scene.species) == set(KINDS.values())
    assert all(layer.beyond for layer in scene.atmosphere.layers)
    depths = _depths(nwp / GEFS)
    total, step = depths[62000]
    parts = np.sum([depths[kind][0] for kind in KINDS], axis=0)
    packing = 0.5 * (step + sum(depths[kind][1] for kind in KINDS))
    assert np.abs(parts - total).max() < 1.3 * packing + 1e-3  # GEFS itself leaves up to .001 to no kind
    for ix, iy in ((60, 60), (110, 160), (150, 200)):
        own = sum(depths[kind][0][iy, ix] for kind in KINDS)
        assert aerosol_depth(scene, 0.0, (ix, iy)) == pytest.approx(own, rel=4e-3)  # it fades at the top, 10 km
    assert "no aerosol but the file's" in "\n".join(scene.notes)
    assert set(KINDS.values()) <= set(describe(nwp / GEFS).species)


@pytest.mark.parametrize("kind", [*BY_DEPTH, *LIKE])
def test_kinds_have_optics_of_their_own(kind):
    optics = optics_by_depth(kind)
    assert optics.kind == "aerosol"
    assert optics.relative_extinction or optics.angstrom_exponent is not None


@pytest.mark.parametrize("ground", [0.0, 320.0, 2700.0])
def test_depths_are_those_above_the_ground(ground):
    depth, height = np.full((2, 3), 0.3, np.float32), np.arange(0.0, 12_001.0, 500.0)
    fields, _ = from_depths({"dust": depth, "aerosol": depth + 0.1}, height, np.full((2, 3), ground), [])
    assert list(fields) == ["dust", "aerosol"]
    column = fields["dust"][:, 0, 0]
    fine = np.arange(ground, 12_001.0, 1.0)
    assert np.trapezoid(np.interp(fine, height, column), fine) == pytest.approx(0.3, rel=1e-3)
    rest = fields["aerosol"][:, 0, 0]
    assert np.trapezoid(np.interp(fine, height, rest), fine) == pytest.approx(0.1, rel=1e-3)


def test_what_goes_on_is_the_least_of_all_columns():
    height = np.arange(0.0, 20_001.0, 500.0)[:, None, None] + np.array([[0.0, 300.0], [600.0, 900.0]])
    field = np.exp(-height / 2000.0).astype(np.float32) * 1e-4
    (layer,) = layers_beyond({"dust": field}, {"dust": optics_by_depth("dust")}, height)
    assert (layer.name, layer.beyond) == ("dust", True)
    own = layer.extinction_per_m(height, 550.0)[0]
    assert (own <= field * 1.02).all()  # their levels are the columns' lowest, mean and highest
    lowest_ground = own[:30, 0, 0]
    np.testing.assert_allclose(lowest_ground, field[:30, 0, 0], rtol=0.02)
    top = layer.extinction_per_m([20_900.0, 22_000.0, 29_000.0], 550.0)[0]
    assert top[0] >= top[1] >= top[2] == 0.0


def test_cams_mixing_ratios_in_grib(tmp_path):
    """ECMWF's table 210 in GRIB1's manner: dust and black carbon on hybrid levels."""
    product = gf.ifs(gf.GLOBAL, levels=8)
    temperature = [one for one in product.messages if one.parameter == (0, 0, 0)]
    for number, mass in ((4, 1e-8), (9, 1e-9)):
        product.messages += [
            gf.Message((192, 210, number), one.level, lambda lat, lon, m=mass: m * (1 + np.cos(np.radians(lat))))
            for one in temperature
        ]
    scene = open_scene(gf.write(tmp_path / "cams", product), around=(10, 10))
    assert scene.species[-2:] == ["dust", "black_carbon"]
    density = scene.data.air_pressure.values / (287.0 * scene.data.air_temperature.values)
    lat = scene.grid.lonlat(*np.meshgrid(np.arange(scene.grid.shape[2]), np.arange(scene.grid.shape[1])))[1]
    expected = 1e-8 * (1 + np.cos(np.radians(lat))) * density * 2542.0
    np.testing.assert_allclose(scene.data.extinction_dust.values, expected, rtol=0.02)
    scene.to_netcdf(tmp_path / "scene.nc")
    again = open_scene(tmp_path / "scene.nc")
    assert again.optics == scene.optics
    assert again.atmosphere.layers == scene.atmosphere.layers


def test_naaps_and_cams_depths_in_netcdf(tmp_path):
    lat, lon = np.arange(-10.0, 11.0), np.arange(0.0, 31.0)
    names = {"naaps": ("dust_aod", "smoke_aod", "salt_aod", "abf_aod", "total_aod"),
             "cams": ("duaod550", "bcaod550", "ssaod550", "suaod550", "aod550")}  # fmt: skip
    for model, every in names.items():
        with netCDF4.Dataset(tmp_path / f"{model}.nc", "w") as file:
            for name, values in (("lat", lat), ("lon", lon)):
                file.createDimension(name, values.size)
                file.createVariable(name, "f8", (name,))[:] = values
                file[name].units = "degrees_north" if name == "lat" else "degrees_east"
            file.createDimension("time", 1)
            file.createVariable("time", "f8", ("time",))[:] = 12.0
            file["time"].units = "hours since 2020-06-01"
            for depth, name in zip((0.4, 0.1, 0.05, 0.02, 0.6), every, strict=True):
                file.createVariable(name, "f4", ("time", "lat", "lon"))[:] = depth * (1 + lon / 100)
        scene = open_scene(tmp_path / f"{model}.nc")
        kinds = {"dust", "sea_salt", "sulphate", "aerosol", "smoke" if model == "naaps" else "black_carbon"}
        assert set(scene.species) == kinds
        assert aerosol_depth(scene, 0.0, (15.0, 10.0)) == pytest.approx(0.6 * 1.15, rel=4e-3)
        assert str(scene.time) == "2020-06-01T12:00:00.000"
        assert every[0] in "".join(describe(tmp_path / f"{model}.nc").species)


@pytest.mark.parametrize("single", [True, False])
def test_depth_at_one_wavelength_or_in_a_band(tmp_path, single):
    """ECMWF writes 550 nm, NCEP 545 to 565 nm; what is at another wavelength is not of use."""
    product = gf.ifs(gf.GLOBAL, levels=8)
    for kind, nm, depth in ((62001, 550 if single else 545, 0.3), (62001, 865, 0.2), (62004, 550, 0.1)):
        keys = {"productDefinitionTemplateNumber": 48, "aerosolType": kind, "scaleFactorOfFirstWavelength": 9,
                "typeOfWavelengthInterval": 11 if single else 7, "scaledValueOfFirstWavelength": nm}  # fmt: skip
        if not single:
            keys |= {"scaleFactorOfSecondWavelength": 9, "scaledValueOfSecondWavelength": nm + 20}
        product.messages.append(gf.Message((0, 20, 102), (10, 0), lambda lat, lon, d=depth: d + 0 * lat, keys=keys))
    scene = open_scene(gf.write(tmp_path / "depths", product), around=(0.0, -30.0))
    assert {"dust", "nitrate"} <= set(scene.species)
    ground = float(scene.data.surface_altitude.values[2, 2])
    assert aerosol_depth(scene, ground, (2.0, 2.0)) == pytest.approx(0.4, rel=2e-3)
