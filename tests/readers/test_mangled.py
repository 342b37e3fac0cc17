"""Well-formed files that tell nonsense: words for numbers, absurd values, lost and stretched dimensions."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

from tests.readers.model_files import MAKERS

from openswim.scene.procedural import demo_scene

MANGLE = """
import resource, sys, time, warnings
resource.setrlimit(resource.RLIMIT_AS, (6_000_000_000, 6_000_000_000))
import netCDF4, numpy as np, xarray as xr
from pathlib import Path
from openswim.errors import UserError
from openswim.readers import describe, open_scene
from openswim.readers.common.prober import prober
random = np.random.default_rng(int(sys.argv[1]))
BAD = [np.nan, np.inf, -np.inf, 1e20, -1e20, 9.96921e36, 0.0, -1.0, 1e-30, 1e308, -9999.0, 360.0]
WORDS = ["", "nonsense", 5, 1e30, np.nan, "degrees_east", "K",
         "seconds since nowhere", "days since 0000-00-00", "x" * 3000]

def mangled(data):
    name, other = (random.choice(list(data.variables)) for _ in range(2))
    field, how = data[name], random.integers(8)
    numbers = field.dtype.kind in "fiu" and field.size > 0
    if how == 0 and numbers:
        values = field.values.astype("f8")
        values.flat[random.integers(values.size)] = random.choice(BAD)
        data[name] = field.dims, values, field.attrs
    elif how == 1 and numbers:
        data[name] = field.dims, np.full(field.shape, random.choice(BAD)), field.attrs
    elif how == 2 and field.attrs:
        key = random.choice(list(field.attrs))
        data[name].attrs[key if key != "_FillValue" else "units"] = WORDS[random.integers(len(WORDS))]
    elif how == 3:
        data = data.drop_vars(name)
    elif how == 4 and field.ndim:
        data = data.isel({random.choice(field.dims): slice(0, random.integers(3))})
    elif how == 5:
        data[name] = field.dims, np.full(field.shape, "text", dtype=object)
    elif how == 6:
        data[name].attrs, data[other].attrs = dict(data[other].attrs), dict(field.attrs)
    elif how == 7 and field.ndim:
        data = data.rename({random.choice(field.dims): "elsewhere"})
    return data, f"{name} {other} {how}"

def stretched(source, target):
    with netCDF4.Dataset(source) as old, netCDF4.Dataset(target, "w") as new:
        longer = random.choice(list(old.dimensions))
        for name, dim in old.dimensions.items():
            new.createDimension(name, int(random.choice([10**6, 10**9, 2**40])) if name == longer else len(dim))
        new.setncatts({name: old.getncattr(name) for name in old.ncattrs()})
        for name, field in old.variables.items():
            chunks = [min(len(new.dimensions[dim]), 50) for dim in field.dimensions] or None
            copy = new.createVariable(name, field.dtype, field.dimensions, chunksizes=chunks)
            copy.setncatts({key: field.getncattr(key) for key in field.ncattrs() if key != "_FillValue"})
            if longer not in field.dimensions:
                copy[...] = field[...]
    return f"stretched {longer}"

prober().__enter__()  # one for all files
for source in sys.argv[3:]:
    for number in range(int(sys.argv[2])):
        target = Path(source).with_name(f"mangled{Path(source).suffix}")
        if number % 3 == 2:
            what = stretched(source, target)
        else:
            with xr.open_dataset(source, decode_cf=False, engine="netcdf4") as opened:
                data, what = mangled(opened.load())
            for field in data.variables.values():
                field.encoding = {}
            data.to_netcdf(target)
        print(source, what, flush=True)
        began = time.process_time()
        warnings.simplefilter("error")
        for look in (describe, open_scene):
            try:
                scene = look(target)
            except UserError as error:
                assert "\\n" not in str(error) and len(str(error)) < 800, str(error)
                continue
            for name in scene.data.data_vars if look is open_scene else ():
                assert np.isfinite(scene.data[name].values).all(), name
        warnings.simplefilter("ignore")
        assert time.process_time() - began < 20, "too long"
        target.unlink()
print("done", flush=True)
"""


def test_files_that_tell_nonsense_give_a_scene_or_one_line(tmp_path: Path, wrf_file) -> None:
    """Each read with 6 GB of address space and 20 s of CPU; what is opened is finite."""
    files = [wrf_file()]
    demo_scene(16, 16, 16).to_netcdf(tmp_path / "scene.nc")
    files.append(tmp_path / "scene.nc")
    for number, (name, make) in enumerate(MAKERS.items()):
        if "text" not in name and name not in ("LAPS", "ERA5 over the date line"):
            folder = tmp_path / str(number)
            folder.mkdir()
            files += [path for path in make(folder).paths if "head" not in path.name]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", MANGLE, "1", "3", *map(str, files)],
        capture_output=True, text=True, timeout=280,
    )  # fmt: skip
    last = done.stdout.strip().splitlines()[-1:]
    assert last == ["done"], f"{last}\n{done.stderr[-3000:]}"
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 5_000_000  # kB
