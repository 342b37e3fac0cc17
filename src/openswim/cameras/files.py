"""A camera in a TOML file: read, checked, and written (docs/cameras.md)."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from openswim.arguments import check_keys, check_kind, number, numbers, shown, takes
from openswim.cameras.camera import Camera
from openswim.cameras.checks import check_shape
from openswim.cameras.given import from_map
from openswim.cameras.lenses import Lens
from openswim.cameras.obstacles import Mask
from openswim.cameras.optics import Optics
from openswim.cameras.picture_files import read_picture
from openswim.cameras.sizes import shape_of
from openswim.cameras.toml_text import read_toml, toml_text
from openswim.errors import UserError
from openswim.scene.files import written_whole
from openswim.system.inputs import check_ordinary, check_within

VERSION = 1
_PLACE = ("lat", "lon", "x_m", "y_m", "height_m", "above")
_SET_UP = ("centre_row", "centre_column", "mirrored", "affine", "fov_deg")
_LENS = ("focal_px", "coefficients")
_TURNED, _POINTED = ("rotation_deg", "tilt_deg", "tilt_azimuth_deg"), ("azimuth_deg", "altitude_deg", "roll_deg")
_COUNTS = ("azimuth", "zenith", "azimuth_deg_per_count", "zenith_deg_per_count", "outside_count", "directions")
_VIEWS = {
    "allsky": ("centre", "fov_deg"),
    "panorama": ("azimuth_deg", "altitude_range_deg"),
    "perspective": (*_POINTED, "fov_deg"),
    "satellite": ("fov_deg",),
    "fisheye": ("lens", *_LENS, *_SET_UP, *_TURNED, *_POINTED),
    "pinhole": (*_LENS, *_SET_UP, *_TURNED, *_POINTED),
    "map": _COUNTS,
}
_TABLES = {
    "place": _PLACE,
    "frame": ("rows", "columns", "time_pattern", "utc_offset_h", "saturated_count"),
    "view": ("kind", *sorted({key for keys in _VIEWS.values() for key in keys})),
    "response": ("encoding", "red_blue", "radiance_per_unit"),
    "obstacles": ("horizon_deg", "mask"),
    "calibration": None,
}
_CENTRES = {"zenith": 90.0, "nadir": -90.0}


@dataclass(frozen=True)
class FrameSettings:
    """What a camera's frames need to be read: how their names tell the time (strptime), the zone of their clock, and
    the count from which on they are saturated."""

    time_pattern: str | None = None
    utc_offset_h: float | None = None
    saturated_count: float | None = None

    def __post_init__(self) -> None:
        if self.time_pattern is not None:
            check_kind("time_pattern", self.time_pattern, str, 'write it as "%Y%m%d_%H%M%S"')
        for name in ("utc_offset_h", "saturated_count"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, number(name, getattr(self, name)))
        if self.utc_offset_h is not None and not abs(self.utc_offset_h) <= 15:
            raise UserError(f"the clock's offset from UTC (utc_offset_h) is {self.utc_offset_h:g}, not -15 to 15 hours")


@dataclass(frozen=True)
class ResponseSettings:
    """How counts follow from light, as far as it is known.

    `encoding`: "srgb", "linear", or the exponent of a power law (None: by the kind of file); `red_blue`: by how much
    ln(red / blue) of linear counts exceeds that of radiance; `radiance_per_unit`: W m-2 sr-1 nm-1 of full scale.
    """

    encoding: str | float | None = None
    red_blue: float | None = None
    radiance_per_unit: tuple[float, ...] | None = None


@dataclass(frozen=True)
class CameraFile:
    """All that a camera's TOML file says."""

    camera: Camera
    name: str = ""
    frames: FrameSettings = FrameSettings()
    calibration: dict[str, Any] = field(default_factory=dict)  # what a fit said of itself
    response: ResponseSettings = ResponseSettings()


def read_camera(path: str | os.PathLike[str], within: Path | None = None, **place: Any) -> CameraFile:
    """Read a camera's file; `place` (lat, lon, height_m ...) goes before what the file says, where not None. within: a
    folder out of which the file, a stranger's, may name no other."""
    check_kind("camera file", path, (str, os.PathLike), "give a file's name")
    path = Path(path)
    tables = read_toml(path)
    try:
        if within is not None:
            _check_named(tables, path, within)
        return _camera(tables, path, {key: value for key, value in place.items() if value is not None})
    except UserError as error:
        text = str(error)
        raise UserError(text if str(path) in text else f"{path}: {text}") from None


@takes
def load_camera(path: str | os.PathLike[str], within: Path | None = None, **place: Any) -> Camera:
    """The camera that a TOML file describes (docs/cameras.md); lat, lon, height_m ... here go before the file's.

    within: see `read_camera`.
    """
    return read_camera(path, within, **place).camera


@takes
def save_camera(camera: Camera, path: str | os.PathLike[str]) -> None:
    """Write the TOML file that `load_camera` reads."""
    write_camera(CameraFile(camera), path)


@takes
def write_camera(content: CameraFile, path: str | os.PathLike[str]) -> list[Path]:
    """Write a camera's file; maps and masks go into files beside it. Returns what has been written."""
    path = Path(path)
    camera = content.camera
    tables: dict[str, Any] = {"openswim_camera": VERSION}
    if content.name:
        tables["name"] = content.name
    tables["place"] = {key: getattr(camera, key) for key in _PLACE if getattr(camera, key) is not None}
    settings = {key: value for key, value in vars(content.frames).items() if value is not None}
    tables["frame"] = {"rows": camera.shape[0], "columns": camera.shape[1], **settings}
    beside: list[tuple[Path, np.ndarray]] = []
    tables["view"] = _view_table(camera, path, beside)
    obstacles: dict[str, Any] = {"horizon_deg": camera.horizon_deg} if camera.horizon_deg else {}
    if camera.mask is not None:
        obstacles["mask"] = f"{path.stem}_mask.png"  # which a picture program can mend
        beside.append((path.with_name(obstacles["mask"]), np.where(camera.mask.hidden, 0, 255).astype(np.uint8)))
    response = {key: value for key, value in vars(content.response).items() if value is not None}
    tables |= {"response": response} if response else {}
    tables |= {"obstacles": obstacles} if obstacles else {}
    tables |= {"calibration": content.calibration} if content.calibration else {}
    from PIL import Image

    for name, array in beside:
        with written_whole(name) as partial, partial.open("wb") as stream:
            if name.suffix == ".png":
                Image.fromarray(array).save(stream, "PNG")
            else:
                np.save(stream, array)
    with written_whole(path) as partial:
        partial.write_text("# A camera for OpenSWIm (docs/cameras.md)\n" + toml_text(tables), "utf-8")
    return [path, *(name for name, _ in beside)]


def _view_table(camera: Camera, path: Path, beside: list[tuple[Path, np.ndarray]]) -> dict[str, Any]:
    kind = "panorama" if camera.name == "sphere" else camera.name
    if (optics := camera.lens_optics) is not None:
        table: dict[str, Any] = {"kind": kind} | ({"lens": optics.lens.model} if kind == "fisheye" else {})
        table |= {"focal_px": optics.lens.focal_px}
        table |= {"coefficients": optics.lens.coefficients} if optics.lens.coefficients else {}
        return table | {key: getattr(optics, key) for key in (*_SET_UP, *_TURNED)}
    if camera.view == "map":
        pixels = camera.pixels()
        name = path.with_name(f"{path.stem}_directions.npy")
        beside.append((name, np.stack([pixels.azimuth_deg, 90 - pixels.altitude_deg]).astype(np.float32)))
        return {"kind": kind, "directions": name.name}
    if kind not in _VIEWS:
        raise UserError("a camera of free rays has no file: keep the rays themselves")
    values = {key: getattr(camera, key) for key in _VIEWS[kind] if key != "centre"}
    if kind == "allsky":
        values["centre"] = "zenith" if camera.altitude_deg > 0 else "nadir"
    return {"kind": kind} | values


def _camera(tables: dict[str, Any], path: Path, place: dict[str, Any]) -> CameraFile:
    version = tables.get("openswim_camera")
    if version != VERSION or isinstance(version, bool):
        raise UserError(f"is no camera's file: its first line says openswim_camera = {VERSION}")
    check_keys(tables, ("openswim_camera", "name", *_TABLES), "the file")
    for name, keys in _TABLES.items():
        if not isinstance(tables.get(name, {}), dict):
            raise UserError(f"{name} is {shown(tables[name])}: write a table [{name}]")
        if keys is not None:
            check_keys(tables.get(name, {}), keys, f"[{name}]")
    view, frame = dict(tables.get("view", {})), tables.get("frame", {})
    kind = view.pop("kind", None)
    if not isinstance(kind, str) or kind not in _VIEWS:
        raise UserError(f"[view] kind is {shown(kind)}: choose one of {', '.join(_VIEWS)}")
    check_keys(view, _VIEWS[kind], f"[view] of kind {kind}")
    where = dict(tables.get("place", {})) if not {"x_m", "y_m"} & set(place) else {}
    if {"lat", "lon"} & set(place):
        where = {key: value for key, value in where.items() if key not in ("x_m", "y_m")}
    where |= place
    if not {"lat", "lon"} <= set(where) and not {"x_m", "y_m"} <= set(where):
        raise UserError("has no place: write lat and lon in degrees under [place] (or give --lat and --lon)")
    options: dict[str, Any] = where | _obstacles(tables.get("obstacles", {}), path)
    if kind == "map":
        camera = _of_map(view, path, options)
        if {"rows", "columns"} & set(frame) and (frame.get("rows"), frame.get("columns")) != camera.shape:
            raise UserError(f"[frame] rows and columns differ from the map's {camera.shape[0]} and {camera.shape[1]}")
    else:
        shape = tuple(_needed(frame, key, "[frame]") for key in ("rows", "columns"))
        check_shape(shape)
        camera = _of_view(kind, view, shape, options)
    settings = _frame_settings(frame)
    name = tables.get("name", "")
    check_kind("name", name, str, 'write it in quotes, such as name = "roof"')
    response = _response_settings(tables.get("response", {}))
    return CameraFile(camera, name, settings, tables.get("calibration", {}), response)


def _of_view(kind: Any, view: dict[str, Any], shape: tuple[Any, ...], options: dict[str, Any]) -> Camera:
    if kind in ("fisheye", "pinhole"):
        optics = _optics(kind, view, shape)
        return Camera(kind, shape, fov_deg=optics.fov_deg, lens_optics=optics, **options)
    if kind == "allsky":
        centre = view.pop("centre", "zenith")
        if not isinstance(centre, str) or centre not in _CENTRES:
            raise UserError(f"[view] centre is {shown(centre)}: choose one of {', '.join(_CENTRES)}")
        if len(set(shape)) > 1:
            raise UserError(f"[frame] rows {shape[0]} and columns {shape[1]} of an allsky view must be the same")
        return Camera("allsky", shape, altitude_deg=_CENTRES[centre], **view, **options)
    if kind == "satellite":
        options = {"above": "sea level"} | options
        fov = _needed(view, "fov_deg", "[view]")
        return Camera("perspective", shape, azimuth_deg=0.0, altitude_deg=-90.0, fov_deg=fov, **options)
    if kind == "perspective":
        view = {"fov_deg": 60.0, "altitude_deg": 10.0} | view
    if isinstance(view.get("altitude_range_deg"), list):
        view["altitude_range_deg"] = tuple(view["altitude_range_deg"])
    return Camera(kind, shape, **view, **options)


def _optics(kind: str, view: dict[str, Any], shape: tuple[Any, ...]) -> Optics:
    coefficients = view.get("coefficients", ())
    check_kind("[view] coefficients", coefficients, (list, tuple), "give a list of numbers")
    model = "pinhole" if kind == "pinhole" else _needed(view, "lens", "[view]")
    if kind == "fisheye" and model == "pinhole":
        raise UserError('[view] lens pinhole belongs to kind = "pinhole"')
    lens = Lens(model, _needed(view, "focal_px", "[view]"), coefficients)
    row, column = ((number("[frame] rows and columns", n) - 1) / 2 for n in shape)
    centre = tuple(number(f"[view] {key}", view.get(key, middle))
                   for key, middle in (("centre_row", row), ("centre_column", column)))  # fmt: skip
    options = {key: view[key] for key in ("mirrored", "affine", "fov_deg") if key in view}
    turned, pointed = ({key: view[key] for key in keys if key in view} for keys in (_TURNED, _POINTED))
    if not pointed:
        return Optics(lens, centre[0], centre[1], **turned, **options)
    if turned or not {"azimuth_deg", "altitude_deg"} <= set(pointed):
        raise UserError(
            "[view] give azimuth_deg, altitude_deg and roll_deg, or rotation_deg, tilt_deg and tilt_azimuth_deg"
        )
    azimuth, altitude, roll = (number(f"[view] {key}", pointed.get(key, 0.0)) for key in _POINTED)
    return Optics.pointing(lens, (centre[0], centre[1]), azimuth, altitude, roll, **options)


def _of_map(view: dict[str, Any], path: Path, options: dict[str, Any]) -> Camera:
    if "directions" in view:
        stored = _array(_beside(view["directions"], "[view] directions", path))
        if stored.ndim != 3 or len(stored) != 2 or stored.dtype.kind != "f":
            raise UserError(f"[view] directions holds {stored.shape}: must be (2, rows, columns) of azimuth and zenith")
        return _mapped(stored[0], stored[1], options)
    maps = []
    for name in ("azimuth", "zenith"):
        counts = read_picture(_beside(_needed(view, name, "[view]"), f"[view] {name}", path)).counts
        if counts.ndim != 2:
            raise UserError(f"[view] {name} has {counts.shape[-1]} channels: a map has one")
        scale = number(f"[view] {name}_deg_per_count", view.get(f"{name}_deg_per_count", 1.0))
        outside = number("[view] outside_count", view.get("outside_count", np.nan))
        with np.errstate(all="ignore"):  # what is no angle then is refused
            maps.append(np.where(counts == outside, np.nan, counts * scale))
    return _mapped(maps[0], maps[1], options)


def _mapped(azimuth_deg: Any, zenith_deg: Any, options: dict[str, Any]) -> Camera:
    pixels = from_map(azimuth_deg, zenith_deg)
    return Camera("map", shape_of(pixels.pixels.inside.shape), given=pixels, **options)


def _obstacles(table: dict[str, Any], path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if "horizon_deg" in table:
        found["horizon_deg"] = table["horizon_deg"]
    if "mask" in table:
        name = _beside(table["mask"], "[obstacles] mask", path)
        if name.suffix == ".npy":
            hidden = _array(name)
        else:
            counts = read_picture(name).counts
            hidden = (counts if counts.ndim == 2 else counts.max(axis=-1)) == 0  # black hides
        if hidden.ndim != 2 or hidden.dtype != bool:
            raise UserError(f"{name}: a mask is a picture of one channel, black where the sky is hidden")
        found["mask"] = Mask(hidden, name.name)
    return found


def _beside(name: Any, what: str, path: Path) -> Path:
    """A file named in the camera's file, which counts from there."""
    check_kind(what, name, str, "give a file's name in quotes")
    return path.parent / name


def _check_named(tables: dict[str, Any], path: Path, within: Path) -> None:
    """Raise UserError where a map or mask of a camera lies out of a folder."""
    for table, keys in (("view", ("directions", "azimuth", "zenith")), ("obstacles", ("mask",))):
        found = tables.get(table)
        for key in keys:
            if isinstance(found, dict) and isinstance(found.get(key), str):
                label = f"[{table}] {key} {shown(found[key])}"
                check_within(path.parent / found[key], within, label, f"{within}; copy the file into it")


def _array(path: Path) -> np.ndarray:
    check_ordinary(path)
    try:
        with path.open("rb") as stream:  # mapped: a header may claim what is not there
            if stream.read(6) != b"\x93NUMPY":
                raise UserError(f"{path}: is no .npy file")
        return np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except (OSError, ValueError, EOFError, MemoryError, OverflowError, TypeError, SyntaxError) as error:
        why = " ".join(str(error).split())[:100]
        raise UserError(f"{path}: cannot be read ({why})") from None


def _frame_settings(frame: dict[str, Any]) -> FrameSettings:
    return FrameSettings(*(frame.get(key) for key in ("time_pattern", "utc_offset_h", "saturated_count")))


def checked_encoding(value: Any) -> str | float | None:
    """The encoding of counts: "srgb", "linear", an exponent, or None; raises UserError."""
    if value is None or (isinstance(value, str) and value in ("srgb", "linear")):
        return None if value is None else str(value)
    exponent = number("encoding", value) if not isinstance(value, str) else np.nan
    if not 0.2 <= exponent <= 5:
        raise UserError(f'encoding is {shown(value)}: write "srgb", "linear", or an exponent such as 2.2')
    return exponent


def _response_settings(table: dict[str, Any]) -> ResponseSettings:
    red_blue = number("[response] red_blue", table["red_blue"]) if "red_blue" in table else None
    scale = None
    if "radiance_per_unit" in table:
        given = np.atleast_1d(numbers("[response] radiance_per_unit", table["radiance_per_unit"])).astype(float)
        if given.shape not in ((1,), (3,)) or not (np.isfinite(given) & (given > 0)).all():
            raise UserError("[response] radiance_per_unit must be one or three numbers above 0 (W m-2 sr-1 nm-1)")
        scale = tuple(float(value) for value in given)
    return ResponseSettings(checked_encoding(table.get("encoding")), red_blue, scale)


def _needed(table: dict[str, Any], key: str, where: str) -> Any:
    if key not in table:
        raise UserError(f"{where} needs {key}")
    return table[key]
