"""A fixed run of spoilt files, for test_hostile.py: every case by its own seed, in the formats that these tests make.

    python -m tests.readers.fuzzing FOLDER SEED FIRST END

prints one line of JSON a case, before it is opened and after, with 6 GB of address space. Bytes are changed in any
file; whole things, such as variables, messages, rows and chunks, by what the format has.
"""

from __future__ import annotations

import json
import resource
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from tests.readers import grib_files
from tests.readers.conftest import WRFSpec, write_wrf
from tests.readers.model_files import MAKERS
from tests.readers.verdicts import Found, verdict

from openswim.readers import open_scene
from openswim.readers.common.prober import prober
from openswim.scene.procedural import demo_scene

Random = np.random.Generator
ADDRESS_BYTES = 6_000_000_000
VALUES = (np.nan, np.inf, 1e20, 9.96921e36, -9999.0, -1.0, 0.0, 1e5)
WORDS = ("", "nonsense", "K", "Pa", "hPa", "g kg-1", "kg kg-1", "m", "km", "%", "days since 0000-00-00", "x" * 3000)


def _scene_layout(folder: Path, suffix: str) -> list[Path]:
    scene, path = demo_scene(16, 16, 16), folder / f"scene{suffix}"
    (scene.to_zarr if suffix == ".zarr" else scene.to_netcdf)(path)
    return [path]


def _grib(product: Callable[[], grib_files.Product]) -> Callable[[Path], list[Path]]:
    return lambda folder: [grib_files.write(folder / "file.grib", product())]


FILES: dict[str, Callable[[Path], list[Path]]] = {
    **{name: lambda folder, make=make: make(folder).paths for name, make in MAKERS.items()},
    "WRF": lambda folder: [write_wrf(folder / "wrfout_d01_x", WRFSpec())],
    "WRF classic": lambda folder: [write_wrf(folder / "wrfout_d01_x", WRFSpec(map_proj=3, format="NETCDF3_CLASSIC"))],
    "GRIB2 on native levels": _grib(lambda: grib_files.hrrr(levels=8)),
    "GRIB2 on pressure": _grib(lambda: grib_files.on_pressure(grib_files.AROME)),
    "GRIB1 on pressure": _grib(lambda: grib_files.on_pressure(grib_files.AROME, edition=1)),
    "scene layout": lambda folder: _scene_layout(folder, ".nc"),
    "scene layout, Zarr": lambda folder: _scene_layout(folder, ".zarr"),
}


def spoil_bytes(random: Random, path: Path) -> str:
    data = bytearray(path.read_bytes())
    how = str(random.choice(["cut", "flip", "flip head", "zeros", "noise", "insert", "remove", "double"]))
    at = int(random.integers(len(data)))
    some = int(random.integers(1, 1000))
    if how == "cut":
        del data[at:]
    elif how.startswith("flip"):  # headers are at the front
        reach = min(len(data), 4000) if how == "flip head" else len(data)
        for _ in range(random.integers(1, 9)):
            data[random.integers(reach)] ^= 1 << random.integers(8)
    elif how == "remove":
        del data[at : at + some]
    elif how == "double":
        data *= 2
    elif how == "insert":
        data[at:at] = random.bytes(some)
    else:
        some = min(some, len(data) - at)
        data[at : at + some] = bytes(some) if how == "zeros" else random.bytes(some)
    path.write_bytes(data)
    return f"bytes {how}"


def spoil_variables(random: Random, path: Path) -> str:
    with xr.open_dataset(path, decode_cf=False, engine="netcdf4") as opened:
        data = opened.load()
    for variable in data.variables.values():
        variable.encoding = {}
    on_levels = [name for name in data.variables if data[name].ndim >= 3 and data[name].dtype.kind == "f"]
    name = random.choice(on_levels if on_levels and random.random() < 0.7 else list(data.variables))
    field, value = data[name], random.choice(VALUES)
    how = str(random.choice(["delete", "rename", "units", "no attributes", "value", "values", "all", "block", "scale",
                             "negative", "cut", "levels"]))  # fmt: skip
    values = field.values.copy()
    if how == "delete":
        data = data.drop_vars(name)
    elif how == "rename":
        data = data.rename({name: "elsewhere"})
    elif how == "units":
        data[name].attrs["units"] = str(random.choice(WORDS))
    elif how == "no attributes":
        data[name].attrs = {}
    elif how == "cut" and field.ndim:
        data = data.isel({random.choice(field.dims): slice(0, int(random.integers(4)))})
    elif values.dtype.kind == "f" and values.ndim:
        if how == "value":
            values.flat[random.integers(values.size)] = value
        elif how == "values":
            values[random.random(values.shape) < 0.1] = value
        elif how == "all":
            values[:] = value
        elif how == "block":
            values[tuple(slice(0, max(1, size // 2)) for size in values.shape)] = np.nan
        elif how == "scale":
            values *= values.dtype.type(random.choice([1e-3, 1e-2, 1e2, 1e3, 1e6]))
        elif how == "negative":
            values *= -1
        elif how == "levels" and values.ndim > 2:
            values = np.take(values, random.permutation(values.shape[-3]), axis=-3)
        data[name] = field.dims, values, field.attrs
    path.unlink()
    data.to_netcdf(path, engine="netcdf4")
    return f"{how} of {name}"


def spoil_messages(random: Random, path: Path) -> str:
    whole = path.read_bytes()
    starts = [at for at in range(len(whole)) if whole.startswith(b"GRIB", at) and whole[at + 7] in (1, 2)]
    parts = [whole[at:end] for at, end in zip(starts, [*starts[1:], len(whole)], strict=True)]
    at = int(random.integers(len(parts)))
    how = str(random.choice(["drop", "drop many", "double", "shuffle", "cut one", "head of one"]))
    if how == "drop":
        del parts[at]
    elif how == "drop many":
        parts = [part for part in parts if random.random() < 0.7]
    elif how == "double":
        parts.append(parts[at])
    elif how == "shuffle":
        parts = [parts[k] for k in random.permutation(len(parts))]
    elif how == "cut one":
        parts[at] = parts[at][: random.integers(1, len(parts[at]))]
    else:
        head = bytearray(parts[at])
        head[random.integers(16, min(len(head), 200))] = random.integers(256)
        parts[at] = bytes(head)
    path.write_bytes(b"".join(parts))
    return how


def spoil_rows(random: Random, path: Path) -> str:
    lines = path.read_text().split("\n")
    at = int(random.integers(8 if random.random() < 0.5 else len(lines)))
    how = str(random.choice(["lost", "double", "word", "cut", "empty"]))
    if how == "lost":
        del lines[at]
    elif how == "double":
        lines.insert(at, lines[at])
    elif how == "word":
        words = lines[at].replace(",", " , ").split() or [""]
        words[random.integers(len(words))] = str(random.choice(["nan", "inf", "-1", "1e99", "text", "0", "\u00fc"]))
        lines[at] = " ".join(words)
    elif how == "cut":
        del lines[at:]
    else:
        lines[at] = ""
    path.write_text("\n".join(lines))
    return f"row {at} {how}"


def spoil_store(random: Random, path: Path) -> str:
    one = random.choice(sorted(each for each in path.rglob("*") if each.is_file()))
    if random.random() < 0.5:
        one.unlink()
        return f"{one.relative_to(path)} lost"
    return f"{one.relative_to(path)} {spoil_bytes(random, one)}"


def spoil(random: Random, path: Path) -> str:
    """Change one file in place; says how."""
    if path.is_dir():
        return spoil_store(random, path)
    if random.random() < 0.4:
        return spoil_bytes(random, path)
    ways = {".grib": spoil_messages, ".txt": spoil_rows}
    return ways.get(path.suffix, spoil_variables)(random, path)


def main(folder: Path, seed: int, first: int, end: int) -> None:
    good: dict[str, tuple[list[Path], Found]] = {}
    for number in range(first, end):
        name = list(FILES)[number % len(FILES)]
        if name not in good:
            home = folder / "good" / name.replace(" ", "_")
            shutil.rmtree(home, ignore_errors=True)
            home.mkdir(parents=True)
            paths = FILES[name](home)
            good[name] = paths, Found.of(open_scene(paths))
        paths, found = good[name]
        spoilt = folder / "spoilt" / str(number)
        shutil.copytree(paths[0].parent, spoilt)
        copies = [spoilt / path.name for path in paths]
        random = np.random.default_rng([seed, number])
        case = {"number": number, "file": name, "how": spoil(random, copies[random.integers(len(copies))])}
        print(json.dumps(case), flush=True)
        began = time.process_time()
        try:
            case["verdict"] = verdict(copies, found)
        except Exception:
            case["verdict"] = traceback.format_exc()
        print(json.dumps(case | {"cpu_s": time.process_time() - began}), flush=True)
        shutil.rmtree(spoilt)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_BYTES, ADDRESS_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    with prober():  # one for all files
        main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
