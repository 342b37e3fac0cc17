"""Linear light for renderers, checked by a real Radiance and OpenEXR where they are installed."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim import Camera, Scene, Solver, UserError
from openswim.colour import check_writable, save
from openswim.colour.hdr import LUMENS_PER_WATT, radiance_rgb, rgbe, without_sun
from openswim.colour.photometry import luminance_cd_m2


@pytest.fixture(scope="module")
def sphere() -> xr.Dataset:
    scene = Scene.clear(47.0, 11.0, time=np.datetime64("2024-06-01T08:00"))
    return openswim.render(scene, Camera.sphere(47.0, 11.0, size=720), Solver("swim"))


def _weights(image: xr.Dataset) -> np.ndarray:
    """What a pixel (y, x) adds to the irradiance on the horizontal, sr."""
    up = np.sin(np.radians(image["altitude"].values.astype(float)))
    return np.maximum(up, 0) * image["solid_angle"].values


def test_irradiance_by_radiance_is_the_pictures_own_sum(sphere: xr.Dataset, tmp_path: Path) -> None:
    pytest.importorskip("pyradiance")
    import pyradiance

    save(sphere, tmp_path / "my sky.hdr")
    folder = Path(pyradiance.__file__).parent / "bin"
    path = {"RAYPATH": f".:{folder.parent / 'lib'}"}
    octree = subprocess.run(
        [folder / "oconv", "my sky.rad"], cwd=tmp_path, capture_output=True, check=True, env=path
    ).stdout
    (tmp_path / "sky.oct").write_bytes(octree)
    command = [folder / "rtrace", "-h", "-I", "-ab", "1", "-ad", "16384", "-lw", "1e-9", "-aa", "0", "sky.oct"]
    found = subprocess.run(
        command, input=b"0 0 0 0 0 1\n", cwd=tmp_path, capture_output=True, check=True, env=path
    ).stdout
    by_radiance = np.array(found.split(), float)
    own = (radiance_rgb(sphere).astype(float) * _weights(sphere)[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(by_radiance, own, rtol=2e-3)


def test_sun_and_the_sky_without_it_add_up(sphere: xr.Dataset) -> None:
    sky, beam = without_sun(sphere)
    assert beam is not None
    weight = _weights(sphere)[..., None]
    whole, rest = ((radiance_rgb(each).astype(float) * weight).sum(axis=(0, 1)) for each in (sphere, sky))
    up = np.sin(np.radians(sphere.attrs["sun_altitude_deg"]))
    np.testing.assert_allclose(rest + beam * up, whole, rtol=3e-3)
    assert radiance_rgb(sky).max() < 0.01 * radiance_rgb(sphere).max()


def test_luminance_is_the_images(sphere: xr.Dataset) -> None:
    light = radiance_rgb(sphere)
    luminance = LUMENS_PER_WATT * light @ np.array([0.2126, 0.7152, 0.0722])
    above = sphere["altitude"].values > 5
    np.testing.assert_allclose(luminance[above], luminance_cd_m2(sphere)[above], rtol=7e-3)  # carried to D65


@pytest.mark.parametrize("shape", [(3, 5, 3), (4, 300, 3)])
def test_rgbe_is_within_a_step(shape: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(4)
    light = np.exp(rng.normal(0, 5, shape)).astype(np.float32)
    light[0, 0] = 0
    found = _read_rgbe(rgbe(light))
    assert (np.abs(found - light) <= light.max(axis=-1, keepdims=True) / 255 + 1e-30).all()


def _read_rgbe(data: bytes) -> np.ndarray:
    head, _, rest = data.partition(b"\n\n")
    assert b"FORMAT=32-bit_rle_rgbe" in head
    size, _, body = rest.partition(b"\n")
    ny, nx = int(size.split()[1]), int(size.split()[3])
    raw = np.frombuffer(body, np.uint8)
    if nx < 8:
        pixels = raw.reshape(ny, nx, 4)
    else:
        pixels, at = np.empty((ny, nx, 4), np.uint8), 0
        for y in range(ny):
            assert tuple(raw[at : at + 4]) == (2, 2, nx >> 8, nx & 255)
            at += 4
            for n in range(4):
                x = 0
                while x < nx:
                    count = int(raw[at])
                    pixels[y, x : x + count, n] = raw[at + 1 : at + 1 + count]
                    at, x = at + 1 + count, x + count
        assert at == raw.size
    exponent = pixels[..., 3:].astype(int) - 128
    return np.where(pixels[..., 3:] > 0, np.ldexp(pixels[..., :3] + 0.5, exponent - 8), 0.0)


def test_exr_holds_light_and_radiance(sphere: xr.Dataset, tmp_path: Path) -> None:
    library = pytest.importorskip("OpenEXR")
    save(sphere, tmp_path / "sky.exr")
    with library.File(str(tmp_path / "sky.exr"), separate_channels=True) as file:
        channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    np.testing.assert_array_equal(channels["G"], radiance_rgb(sphere)[..., 1])
    np.testing.assert_allclose(channels["radiance.546nm"], sphere["radiance"].values[..., 1], rtol=5e-4, atol=1e-7)


def test_exr_holds_the_night_as_well(sphere: xr.Dataset, tmp_path: Path) -> None:
    """Starlight is a thousandth of the least that half floats hold."""
    library = pytest.importorskip("OpenEXR")
    night = sphere.assign(radiance=1e-9 * sphere["radiance"])
    save(night, tmp_path / "night.exr")
    with library.File(str(tmp_path / "night.exr"), separate_channels=True) as file:
        found = np.array(file.channels()["radiance.546nm"].pixels)
    np.testing.assert_allclose(found, night["radiance"].values[..., 1], rtol=1e-6)
    assert np.median(found) > 0


def test_a_sun_below_the_ground_is_no_source(sphere: xr.Dataset, tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    light = sphere["solar_relative_radiance"]
    night = sphere.assign(solar_relative_radiance=light * rng.uniform(0.5, 2, light.shape))
    night.attrs["sun_altitude_deg"] = -50.0
    assert without_sun(night)[1] is None
    save(night, tmp_path / "night.hdr")
    assert "openswim_sun" not in (tmp_path / "night.rad").read_text()


def test_other_views_are_one_file_and_no_renderer_is_needed(tmp_path: Path) -> None:
    scene = Scene.clear(47.0, 11.0, time=np.datetime64("2024-06-01T08:00"))
    image = openswim.render(scene, Camera.allsky(47.0, 11.0, size=16), Solver("swim"))
    save(image, tmp_path / "sky.hdr")
    assert [each.name for each in tmp_path.iterdir()] == ["sky.hdr"]
    with pytest.raises(UserError, match=r"\.hdr, \.exr"):
        save(image, tmp_path / "sky.bmp")


def test_files_beside_replace_none_but_our_own(sphere: xr.Dataset, tmp_path: Path) -> None:
    sky = tmp_path / "sky.hdr"
    save(sphere, sky)
    save(sphere, sky)
    for suffix in (".cal", ".rad"):
        sky.with_suffix(suffix).write_text("void plastic wall 0 0 5 .7 .7 .7 0 0")
        with pytest.raises(UserError, match=rf"sky\{suffix}: would be replaced"):
            save(sphere, sky)
        with pytest.raises(UserError, match=rf"sky\{suffix}: would replace .*which is needed"):
            check_writable(sky, [sky.with_suffix(suffix)], "sphere")
        check_writable(sky, (), "allsky")  # which has none
        sky.with_suffix(suffix).unlink()
