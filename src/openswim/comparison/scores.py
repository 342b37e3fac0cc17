"""All scores of one frame beside one simulated picture, as an xarray Dataset."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.comparison.categories import SCORES, contingency
from openswim.comparison.cloud_rules import CLEAR_SKY, FIXED
from openswim.comparison.correlation import Truth, bias, root_mean_square
from openswim.comparison.neighbourhoods import lambert_map, neighbourhoods
from openswim.comparison.prepared import Prepared
from openswim.comparison.response import Curve, fit_curve
from openswim.comparison.tiles import Interval, Tiles

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]
LIGHTS = ("as stored", "decoded", "response undone")
WEIGHTINGS = ("solid angle", "pixel")
BOUNDS = ("low", "high")
NO_SCALE = "the camera's scale is not known: give radiance_per_unit in its file, or irradiance beside it (--dhi, --ghi)"
NO_DAYLIGHT = "the sun is below the horizon: rules with fixed ratios of colours are of daylight"
NO_BALANCE = "the camera's white balance is not known: give a clear frame (--clear-frame), or red_blue in its file"


@dataclass
class Scores:
    """Scores as they come, beside the pictures that they are of, and why some are NaN."""

    variables: dict[str, Any] = field(default_factory=dict)
    coords: dict[str, Any] = field(default_factory=dict)
    attrs: dict[str, Any] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)

    def dataset(self) -> xr.Dataset:
        """All of it, put together once: xarray aligns the whole of a Dataset with each variable that is added."""
        return xr.Dataset(self.variables, self.coords, self.attrs)

    def add(self, name: str, dims: tuple[str, ...], intervals: NDArray, text: str, **attrs: str) -> None:
        """Intervals (array of `Interval`) as a variable and, beside it, its bounds."""
        values = np.vectorize(lambda i: i.value, otypes=[float])(intervals)
        ends = [np.vectorize(lambda i, end=end: getattr(i, end), otypes=[float])(intervals) for end in BOUNDS]
        self.variables[name] = (dims, values, {"long_name": text, "ancillary_variables": f"{name}_bounds", **attrs})
        bounds = {"long_name": f"95 % interval of {text}"}
        self.variables[f"{name}_bounds"] = ((*dims, "bound"), np.stack(ends, axis=-1), bounds)
        missing = {each.reason for each in intervals.ravel() if each.reason and not np.isfinite(each.value)}
        self.reasons += [f"{name}: {reason}" for reason in sorted(missing)]


@dataclass(frozen=True, eq=False)
class Region:
    """Valid pixels (ny, nx) with their weights (n,) and tiles."""

    valid: Mask
    weight: F64
    tiles: Tiles

    @classmethod
    def of(cls, frame: Prepared, valid: Mask) -> "Region":
        weight = frame.pixels.solid_angle_sr[valid]
        if not weight.size:
            return cls(valid, weight, Tiles(np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)))
        return cls(valid, weight, Tiles.numbered(frame.pixels.tile[valid], weight))


def correlations(
    scores: Scores, frame: Prepared, simulated: F64, regions: dict[float, Region], curves: list[Curve] | None
) -> None:
    """r of each channel and their mean: as stored, decoded, and with the response undone; by solid angle and by pixel;
    for several masks around the sun (degrees)."""
    channels = (*frame.channels, "mean")
    shape = (len(LIGHTS), len(WEIGHTINGS), len(regions), len(channels))
    found = np.empty(shape, object)
    for m, region in enumerate(regions.values()):
        truth = simulated[region.valid]
        seen = [np.asarray(part[region.valid], float) for part in (frame.stored, frame.linear)]
        seen.append(undone(seen[1], truth, region, curves))
        for j, weight in enumerate((region.weight, np.ones(len(region.weight)))):
            shared = Truth.of(truth, weight, region.tiles)
            for i, light in enumerate(seen):
                found[i, j, m] = shared.correlations(light)
    scores.coords |= {
        "light": list(LIGHTS), "weighting": list(WEIGHTINGS), "score_channel": list(channels), "bound": list(BOUNDS),
        "sun_mask": ("sun_mask", list(regions), {"units": "degree"}),
    }  # fmt: skip
    scores.add(
        "r", ("light", "weighting", "sun_mask", "score_channel"), found, "correlation of observed and simulated light",
        source="Albers et al. 2020, Eq. 37",
    )  # fmt: skip


def undone(linear: F64, truth: F64, region: Region, curves: list[Curve] | None) -> F64:
    """Linear light (n, channels) with the response undone: by given curves, or each half of the tiles by a curve that
    is fitted to the other half, so that no pixel's score is of a curve that knows it. NaN of too few pixels."""
    if curves is not None:
        return np.stack([curve(part) for curve, part in zip(curves, linear.T, strict=True)], axis=-1)
    found = np.full(linear.shape, np.nan)
    halves = [np.flatnonzero(region.tiles.number % 2 == part) for part in (0, 1)]
    seen = [np.ascontiguousarray(linear[half].T) for half in halves]
    for part, own in enumerate(halves):
        other = halves[1 - part]
        weight, radiance = region.weight[other], truth[other].T
        for k, light in enumerate(seen[part]):
            curve = fit_curve(seen[1 - part][k], radiance[k], weight)
            if curve is not None:
                found[own, k] = curve(light)
    return found


def radiance_errors(scores: Scores, frame: Prepared, simulated: F64, region: Region, scale: F64 | str) -> None:
    """Root mean square and mean of observed less simulated radiance where the scale (channels,) is known; or why it is
    not."""
    parts: dict[str, list[Interval]] = {"rmse": [], "bias": []}
    for k in range(simulated.shape[-1]):
        if isinstance(scale, str):
            parts["rmse"].append(Interval(np.nan, reason=scale))
            parts["bias"].append(Interval(np.nan, reason=scale))
            continue
        pair = scale[k] * frame.linear[region.valid][:, k].astype(float), simulated[region.valid][:, k]
        parts["rmse"].append(root_mean_square(*pair, region.weight, region.tiles))
        parts["bias"].append(bias(*pair, region.weight, region.tiles))
    for name, text in (("rmse", "root mean square of"), ("bias", "mean of")):
        intervals = np.array([None, *parts[name]], object)[1:]
        scores.add(name, ("channel",), intervals, f"{text} observed less simulated radiance", units="W m-2 sr-1 nm-1")


def cloud_scores(
    scores: Scores, frame: Prepared, masks: dict[str, tuple[Mask, Mask]], region: Region, why: str = NO_BALANCE
) -> None:
    """Contingency tables by rule, and FSS of the first rule on a map of equal area; `masks`: observed and simulated, of
    the rules that can be applied; `why` the first cannot."""
    names = (CLEAR_SKY, *FIXED)
    found = np.full((len(SCORES), len(names)), Interval(np.nan, reason=NO_DAYLIGHT), object)
    found[:, names.index(CLEAR_SKY)] = Interval(np.nan, reason=why)
    cells = np.full((len(names), 4), np.nan)
    for j, name in enumerate(names):
        if name not in masks:
            continue
        observed, simulated = masks[name]
        table = contingency(observed[region.valid], simulated[region.valid], region.weight, region.tiles)
        found[:, j] = [table.scores[score] for score in SCORES]
        cells[j] = table.hits, table.false_alarms, table.misses, table.both_clear
    scores.coords |= {"rule": list(names), "cell": ["hits", "false alarms", "misses", "both clear"]}
    scores.variables["contingency"] = (("rule", "cell"), cells, {"long_name": "share of the solid angle", "units": "1"})
    texts = ("probability of detection", "false alarm ratio", "equitable threat score", "observed cloud cover",
             "simulated cloud cover")  # fmt: skip
    for score, row, text in zip(SCORES, found, texts, strict=True):
        scores.add(score, ("rule",), row, text, units="1")
    row, column, there, direction = lambert_map(frame.camera)
    valid = there & region.valid[row, column]
    observed, simulated = (mask[row, column] for mask in masks.get(CLEAR_SKY, (np.zeros_like(region.valid),) * 2))
    if CLEAR_SKY not in masks:
        valid = np.zeros_like(valid)
    parts = neighbourhoods(simulated, observed, valid, direction)
    if CLEAR_SKY not in masks:
        scores.reasons.append(f"fss: {why}")
    scores.coords["window"] = ("window", [part.window_deg for part in parts], {"units": "degree"})
    intervals = np.array([None, *(part.score for part in parts)], object)[1:]
    if CLEAR_SKY in masks:
        scores.add("fss", ("window",), intervals, "fractions skill score of cloud in windows of equal area")
    else:
        scores.variables["fss"] = ("window", np.full(len(parts), np.nan))
        scores.variables["fss_bounds"] = (("window", "bound"), np.full((len(parts), 2), np.nan))
    scores.variables["fss_random"] = ("window", [part.random for part in parts],
                                      {"long_name": "FSS of the observed clouds in random order"})  # fmt: skip
    useful = {"long_name": "FSS from which on a simulation is useful: .5 + cover / 2"}
    scores.variables["fss_useful"] = ("window", [part.useful for part in parts], useful)
