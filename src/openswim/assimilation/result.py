"""What an analysis has found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.assimilation.departures import scene_of
from openswim.assimilation.observing.rows import Rows
from openswim.assimilation.signal import Told
from openswim.scene import Scene

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Found:
    """What `Analysis` is but for its page.

    state: the analysis, with less than the floor where there is no cloud; first: the guess before. costs: of the guess
    and after each iteration. before, after: what is seen of both, by ``departures``.
    interrupted: whether it was stopped, to go on from its checkpoint. told: by the observations, of each control, where
    it was asked for.
    """

    rows: Rows
    state: xr.Dataset
    first: xr.Dataset
    observed: xr.Dataset
    costs: F64
    before: xr.DataArray
    after: xr.DataArray
    departures: str
    interrupted: bool = False
    told: tuple[Told, ...] = ()

    @property
    def used(self) -> int:
        """How many observations count."""
        return int(self.observed["use"].values.astype(bool).sum())

    @property
    def scene(self) -> Scene:
        """The scene with the analysis in it; what is not above the floor is clear air."""
        out = scene_of(self.rows, self.state)
        out.notes.append(f"analysis of {self.used} observations in {len(self.costs) - 1} iterations")
        return out

    def rms(self, seen: xr.DataArray) -> list[float]:
        """Root mean square of departures over their errors, of each instrument; 1 is what errors explain."""
        use = self.observed["use"].values.astype(bool)
        ratio = np.where(use, (seen.values - self.observed["value"].values) / self.observed["error"].values, np.nan)
        out = []
        for part in self.rows.parts:
            here = ratio[part.here]
            out.append(float(np.sqrt(np.nanmean(here**2))) if np.isfinite(here).any() else float("nan"))
        return out

    def to_dataset(self) -> xr.Dataset:
        """First guess, analysis, costs, and rows of observations, as one Dataset."""
        out = xr.Dataset({f"{name}_analysis": values for name, values in self.state.items()})
        for name, values in self.first.items():
            out[f"{name}_first"] = values
        out["cost"] = (("iteration",), self.costs)
        for name in ("value", "error", "use"):
            out[f"observed_{name}"] = self.observed[name]
        out["seen_before"], out["seen_after"] = self.before, self.after
        # beside "wavelength", which is an axis of albedo
        out = out.assign_coords(observed_wavelength=("observation", self.before["wavelength"].values))
        out.attrs = {"departures": self.departures, "observations_used": self.used}
        return out
