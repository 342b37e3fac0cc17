"""What is refused before it is read: pipes, files without end or that point elsewhere, headers that promise much."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from tests.readers.model_files import era5

from openswim.errors import UserError
from openswim.readers import describe, open_scene

SECRET = "root:x:0:0"


def _refused(path: Path, *words: str, **options) -> str:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(UserError) as caught:
        open_scene(path, **options)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 650
    for word in words:
        assert word in line, line
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kilobytes
    return line


def _store(path: Path) -> Path:
    """A Zarr store of one piece; the file of it."""
    data = xr.Dataset({"liquid_content": (("z", "y", "x"), np.ones((2, 2, 2)))})
    data.to_zarr(path, zarr_format=2)
    (piece,) = path.rglob("0.0.0")
    return piece


def _references(path: Path, pieces: dict[str, object], **more: object) -> Path:
    """A Zarr store of four numbers x, and some pieces."""
    array = dict(zarr_format=2, shape=[4], chunks=[4], dtype="<f8", compressor=None, fill_value=None, order="C")
    refs = {
        ".zgroup": json.dumps(dict(zarr_format=2)),
        "x/.zarray": json.dumps(array | dict(filters=None)),
        "x/.zattrs": json.dumps(dict(_ARRAY_DIMENSIONS=["x"])),
    }
    path.write_text(json.dumps(dict(version=1, refs=refs | pieces, **more)))
    return path


@pytest.mark.parametrize("where", ["alone", "in a store", "a loop in a store"])
def test_a_pipe(tmp_path, where):
    if where == "alone":
        os.mkfifo(tmp_path / "a.nc")
        _refused(tmp_path / "a.nc", "a.nc: a pipe, device or socket")
    else:
        chunk = _store(tmp_path / "a.zarr")
        chunk.unlink()
        if where == "in a store":
            os.mkfifo(chunk)
        else:
            chunk.symlink_to(chunk.name)
        _refused(tmp_path / "a.zarr", "a pipe, device or link to nowhere")


def test_devices_links_and_names(tmp_path):
    _refused(Path("/dev/zero"), "/dev/zero: a pipe, device or socket")
    (tmp_path / "a.nc").symlink_to("a.nc")
    _refused(tmp_path / "a.nc", "a.nc: a link that leads to itself")
    (tmp_path / "b.nc").symlink_to("c.nc")
    _refused(tmp_path / "b.nc", "b.nc: a link to a file that is not there")
    odd = tmp_path / os.fsdecode(b"caf\xe9.nc")
    os.link(era5(tmp_path / "d.nc", new=True).paths[0], odd)
    _refused(odd, "this name is not UTF-8", "rename it")


def test_a_store_that_points_out_of_its_folder(tmp_path):
    chunk = _store(tmp_path / "a.zarr")
    chunk.rename(tmp_path / "elsewhere")
    chunk.symlink_to(tmp_path / "elsewhere")
    _refused(tmp_path / "a.zarr", "0.0.0 points out of the folder", "--allow-references")


@pytest.mark.parametrize("target", ["/etc/passwd", "file:///etc/passwd", "../secret", "link/passwd", "{{u}}passwd"])
def test_references_out_of_their_folder(tmp_path, target):
    (tmp_path / "secret").write_text(SECRET)
    own = tmp_path / "own"
    own.mkdir()
    (own / "link").symlink_to("/etc")
    path = _references(own / "a.json", {"x/0": [target, 0, 8]}, templates={"u": "/etc/"})
    assert "out of its folder" in _refused(path, "a.json: x/0 points to", "--allow-references")


@pytest.mark.parametrize("target", ["http://127.0.0.1:9/x", "s3://bucket/x", "simplecache::http://127.0.0.1:9/x"])
def test_references_into_the_network(tmp_path, target):
    _refused(_references(tmp_path / "a.json", {"x/0": [target, 0, 8]}), "into the network", "--allow-references")


def test_references_to_what_never_ends(tmp_path):
    for allowed in (False, True):
        _refused(_references(tmp_path / "a.json", {"x/0": ["/dev/zero"]}), "x/0 points to", allow_references=allowed)
    (tmp_path / "short").write_bytes(b"12345678")
    _refused(_references(tmp_path / "b.json", {"x/0": ["short", 4, 8]}), "x/0 lies beyond the end of short")
    _refused(_references(tmp_path / "c.json", {"x/0": ["short", "4", 4]}), "beyond the end")
    _refused(_references(tmp_path / "d.json", {"x/0": ["short", 4]}), "x/0 is no reference")
    os.mkfifo(tmp_path / "pipe")
    _refused(_references(tmp_path / "e.json", {"x/0": ["pipe"]}), "pipe, device")


def test_references_count_from_the_folder_of_their_file(tmp_path, monkeypatch):
    """As a model's file laid out in another folder than the one that the user is in."""
    hdf = pytest.importorskip("kerchunk.hdf")
    own = tmp_path / "own"
    own.mkdir()
    path = era5(own / "a.nc", new=True).paths[0]
    xr.load_dataset(path, decode_times=False).drop_vars(["expver", "number"]).to_netcdf(own / "b.nc")
    found = hdf.SingleHdf5ToZarr(str(own / "b.nc")).translate()
    text = json.dumps(found).replace(str(own / "b.nc"), "b.nc")
    (own / "b.json").write_text(text)
    monkeypatch.chdir("/")
    expected = open_scene(path).data.liquid_content
    np.testing.assert_array_equal(open_scene(own / "b.json").data.liquid_content, expected)
    (tmp_path / "other").mkdir()
    other = (own / "b.json").rename(tmp_path / "other" / "b.json")
    other.write_text(text.replace('"b.nc"', f'"{own / "b.nc"}"'))
    _refused(other, "out of its folder")
    scene = open_scene(other, allow_references=True)
    np.testing.assert_array_equal(scene.data.liquid_content, expected)


def test_too_many_references(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(b'{"refs": {' + b" " * 49_000_000 + b"}}")
    _refused(path, "a.json: references of over 48 MB")
    array = dict(zarr_format=2, shape=[20_000], chunks=[1], dtype="<f8", compressor=None, fill_value=0, order="C")
    path = _references(tmp_path / "b.json", {"x/.zarray": json.dumps(array | dict(filters=None))})
    _refused(path, "coordinate x lies in 20000 pieces")


@pytest.mark.parametrize("zarr_format", [2, 3])
def test_chunks_without_values(tmp_path, zarr_format):
    """Which divide nothing: the metadata of a store of format 3 lie in one file, too."""
    data = xr.load_dataset(era5(tmp_path / "a.nc", new=True).paths[0], decode_times=False).drop_vars("expver")
    path = tmp_path / "a.zarr"
    data.drop_encoding().to_zarr(path, zarr_format=zarr_format, consolidated=False)
    file = path / "q" / (".zarray" if zarr_format == 2 else "zarr.json")
    found = json.loads(file.read_text())
    chunks = found["chunks"] if zarr_format == 2 else found["chunk_grid"]["configuration"]["chunk_shape"]
    chunks[-1] = 0
    file.write_text(json.dumps(found))
    _refused(path, "a.zarr", "damaged")


@pytest.mark.parametrize("kind", ["external", "virtual", "link"])
def test_hdf5_whose_data_lies_elsewhere(tmp_path, kind):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = np.arange(5.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        if kind == "external":
            file.create_dataset("group/clwc", shape=(64,), dtype="u1", external=[("/etc/passwd", 0, 64)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout((5,), "f8")
            layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "x", (5,))
            file.create_virtual_dataset("clwc", layout)
        else:
            file["clwc"] = h5py.ExternalLink(tmp_path / "other.h5", "/x")
    _refused(tmp_path / "a.h5", "a.h5: its data lies in other files", "--allow-references")
    _refused(tmp_path / "a.h5", "no reader", allow_references=True)  # opened, and found to hold no model's fields


def test_hdf5_that_never_ends(tmp_path):
    """Some bytes of a header, found by flipping bits at random, for which nc_open computes for ever."""
    path = Path(os.environ.get("OPENSWIM_SHARED", "../shared")) / "data/hostile/flipped_hdf5.nc"
    if not path.is_file():
        pytest.skip("no reference data")
    _refused(path, "flipped_hdf5.nc: truncated or damaged")


def _declared(path: Path, size: int, name: str = "lon", zarr: bool = False) -> Path:
    """A coordinate of which nothing is written."""
    if zarr:
        array = dict(zarr_format=2, shape=[size], chunks=[1000], dtype="<f8", compressor=None, fill_value=0, order="C")
        (path / name).mkdir(parents=True)
        (path / ".zgroup").write_text('{"zarr_format": 2}')
        (path / name / ".zarray").write_text(json.dumps(array | dict(filters=None)))
        (path / name / ".zattrs").write_text(json.dumps(dict(_ARRAY_DIMENSIONS=[name])))
        return path
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension(name, size)
        file.createVariable(name, "f8", (name,), chunksizes=(1000,))
    return path


@pytest.mark.parametrize("name", ["lon", "time", "column"])
def test_coordinates_are_measured_before_they_are_read(tmp_path, name):
    """6 kB whose coordinate takes 3.2 GB."""
    _refused(_declared(tmp_path / "a.nc", 400_000_000, name), f"coordinate {name} declares 400000000 values")
    _refused(_declared(tmp_path / "a.zarr", 400_000_000, name, zarr=True), f"coordinate {name} declares 400000000")


def test_values_that_no_file_of_this_size_holds(tmp_path):
    """1.1 MB of zeros that unpack to a gigabyte, which would take 2.5 GB to open."""
    with netCDF4.Dataset(tmp_path / "a.nc", "w") as file:
        for name, size in (("level", 20), ("latitude", 1500), ("longitude", 1500)):
            file.createDimension(name, size)
        for name in ("clwc", "ciwc", "t", "q", "z", "cc"):
            field = file.createVariable(name, "f4", ("level", "latitude", "longitude"), zlib=True, complevel=1,
                                        chunksizes=(1, 1500, 1500))  # fmt: skip
            field.units = "1"
    _refused(tmp_path / "a.nc", "1.1 GB of values", "nccopy -d 0")


def test_messages_do_not_repeat_all_that_a_file_says(tmp_path):
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        file["valid_time"].units = "y" * 1_000_000
    line = _refused(path, "a.nc", "give seconds, minutes, hours or days")
    assert "..." in line
    assert len(_refused(path, time="x" * 10_000_000)) <= 610
    with pytest.raises(UserError) as caught:
        describe(tmp_path / ("n" * 100_000))
    assert len(str(caught.value)) <= 610
