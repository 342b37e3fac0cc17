"""What the members of an ensemble say together: the mean sky, and how likely sun and cloud are."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.batches.cloud_depth import DEPTH
from openswim.batches.names import stamp_of
from openswim.batches.plan import ENSEMBLE, Ensemble, Plan
from openswim.batches.plan_cameras import PlannedCamera
from openswim.batches.records import Records
from openswim.batches.tasks import Task
from openswim.batches.working import Outcome, attempted
from openswim.colour.picture import PICTURES
from openswim.errors import UserError
from openswim.scene.files import written_whole

CLEAR, CLOUDY = (38, 84, 160), (255, 255, 255)  # sRGB of a probability of cloud of 0 and of 1
_GROUND = 0.5  # of the brightness that ground has in the picture
_MEAN = ("radiance", "solar_relative_radiance")
_BEAM = "direct_normal_irradiance_w_m2"


@dataclass(frozen=True)
class Together(Task):
    """The members of one time, of all runs of a plan."""

    members: tuple[Task, ...] = ()

    def targets(self, camera: PlannedCamera) -> list[str]:
        """Data, the mean picture, and the picture of cloud's probability."""
        picture = next((suffix for suffix in camera.suffixes if suffix in PICTURES), ".png")
        stem = "_".join(part for part in (f"{self.weather}/{camera.name}", self.stamp) if part)
        return [f"{stem}.nc", f"{stem}_mean{picture}", f"{stem}_cloud{picture}"]


def together(plan: Plan, tasks: Sequence[Task]) -> list[Together]:
    """The ensembles of a plan, one a time."""
    if plan.ensemble is None:
        return []
    by_time: dict[str, list[Task]] = {}
    for task in tasks:
        by_time.setdefault(stamp_of(task.time, None), []).append(task)
    return [
        Together(ENSEMBLE, (), members[0].time, None,
                 hashlib.sha256(repr((plan.ensemble, [(one.name, one.mark) for one in members])).encode()).hexdigest(),
                 tuple(members))
        for members in by_time.values()
    ]  # fmt: skip


def outcomes(plan: Plan, tasks: Sequence[Task], incomplete: frozenset[str] = frozenset()) -> Iterator[Outcome]:
    """Make those ensembles of cameras of which all members stand, and that do not stand themselves. incomplete: runs
    with files that cannot be read, which may hold the times that these runs lack."""
    records = Records(plan.folder)
    known = [one for one in together(plan, tasks) if incomplete <= {member.weather for member in one.members}]
    ready = [(one, cameras) for one in known if (cameras := _ready(records, one, plan.cameras))]
    records.prepare([one for one, _ in ready])
    for one, cameras in ready:
        yield attempted(plan, one, cameras, partial(_make_one, plan, records, one))


def _ready(records: Records, one: Together, cameras: Sequence[PlannedCamera]) -> list[PlannedCamera]:
    """The cameras of which all members stand, but not the ensemble."""
    return [
        camera for camera in records.missing(one, cameras)
        if not any(records.missing(member, [camera]) for member in one.members)
    ]  # fmt: skip


def _make_one(plan: Plan, records: Records, one: Together, camera: PlannedCamera) -> None:
    records.add(one, camera, _make(plan, one, camera))


def _make(plan: Plan, one: Together, camera: PlannedCamera) -> list[str]:
    from openswim.colour import save
    from openswim.colour.caption import facts, with_strip
    from openswim.colour.picture import write_picture

    assert plan.ensemble is not None
    names = [next(name for name in member.targets(camera) if name.endswith(".nc")) for member in one.members]
    data = joined([plan.folder / name for name in names], [member.name for member in one.members], plan.ensemble)
    data_path, mean_path, cloud_path = (plan.folder / name for name in one.targets(camera))
    save(data, data_path)
    save(data, mean_path, **dict(plan.look))
    count, sun = data.sizes["member"], float(data["sun_probability"])
    entries = {name: text for name, text in facts(data).items() if name in ("View", "Place", "Time", "Weather")}
    entries["Probability"] = f"of cloud, blue 0 to white 1, by {count} members; of sun {sun:.0%}"
    ground = data["altitude"].values < 0  # there cloud is meant that stands before the ground
    if "latitude" in data.coords:
        ground = np.isfinite(data["latitude"].values)
    picture = with_strip(cloud_picture(data["cloud_probability"].values, ground), entries, inside=True)
    with written_whole(cloud_path) as unfinished:
        write_picture(picture, unfinished, entries)
    return one.targets(camera)


def joined(paths: Sequence[Path], members: Sequence[str], ensemble: Ensemble) -> xr.Dataset:
    """Mean radiance, and probabilities of cloud at pixels and of sun at the place, of members' data; one is held at a
    time."""
    total: xr.Dataset | None = None
    sums: dict[str, NDArray[np.float64]] = {}
    attrs: list[dict[str, Any]] = []
    for path in paths:
        try:
            with xr.open_dataset(path) as found:
                image = found.load()
            cloudy = np.where(np.isnan(image[DEPTH]), np.nan, image[DEPTH] >= ensemble.cloud_depth)
            values = {name: image[name].values.astype(np.float64) for name in _MEAN} | {"cloud_probability": cloudy}
        except (OSError, ValueError, KeyError) as error:
            raise UserError(f"{path}: cannot be read as a member's data ({str(error)[:100]}): remove it") from None
        total = image.drop_vars([DEPTH]) if total is None else total
        for name, value in values.items():
            if name in sums and sums[name].shape != value.shape:
                raise UserError(f"{path}: of another shape than the other members: remove it")
            sums[name] = sums[name] + value if name in sums else value
        attrs.append(image.attrs)
    assert total is not None
    return _described(total, {name: value / len(paths) for name, value in sums.items()}, attrs, members, ensemble)


def _described(
    first: xr.Dataset, means: dict[str, NDArray[np.float64]], attrs: Sequence[dict[str, Any]], members: Sequence[str],
    ensemble: Ensemble,
) -> xr.Dataset:  # fmt: skip
    out = first.copy()
    for name in _MEAN:
        out[name] = first[name].copy(data=means[name].astype(np.float32))
    out["cloud_probability"] = ("y", "x"), means["cloud_probability"].astype(np.float32), {
        "long_name": f"share of members with cloud of optical depth {ensemble.cloud_depth:g} or more along the line "
        "of sight", "units": "1"}  # fmt: skip
    beam = np.array([float(each.get(_BEAM, np.nan)) for each in attrs])
    sun = np.nan if np.isnan(beam).any() else float((beam >= ensemble.sun_w_m2).mean())
    out["sun_probability"] = (), sun, {
        "long_name": f"share of members whose direct light across the beam is {ensemble.sun_w_m2:g} W m-2 or more at "
        "the observer (WMO-No. 8)", "units": "1"}  # fmt: skip
    out["member"] = ("member",), np.array(members, dtype=str), {"long_name": "run, time and member"}
    common = set.intersection(*map(set, attrs))
    for name in sorted(common):
        values = [each[name] for each in attrs]
        if name.endswith("irradiance_w_m2"):
            title = f"{name.removesuffix('_w_m2').replace('_', ' ')} at the observer"
            out[name] = ("member",), np.array(values, float), {"long_name": title, "units": "W m-2"}
            out.attrs[name] = round(float(np.mean(values)), 2)
        elif name == "illuminance_lx":
            out.attrs[name] = float(np.mean(values))
        elif name != "history" and any(not np.array_equal(value, values[0]) for value in values[1:]):
            del out.attrs[name]
    for name in out.attrs.keys() - common:
        del out.attrs[name]
    out.attrs["title"] = f"OpenSWIm ensemble of {len(members)} members"
    out.attrs["source"] = f"mean of {len(members)} members: {attrs[0].get('source', '')}"
    return out


def cloud_picture(probability: NDArray[np.floating], ground: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Probability (y, x) as a picture (y, x, 3) from blue to white, darker on ground; black where there is no pixel."""
    share = np.nan_to_num(probability)[..., None]
    colour = np.round((1 - share) * np.array(CLEAR) + share * np.array(CLOUDY))
    colour = np.where(ground[..., None], _GROUND * colour, colour)
    return np.where(np.isnan(probability)[..., None], 0, colour).astype(np.uint8)
