"""The observation operator: what cameras and pyranometers measure, its linearisation, its use in other tools."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from openswim.arguments import check_kind
from openswim.assimilation.observing.linearization import Linearization
from openswim.assimilation.observing.observations import observations
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError


@dataclass(frozen=True, eq=False, repr=False)
class Operator(Rows):
    """H(x); made by `observe`. Nothing that it is asked changes it, and it may be shared by threads."""

    def __repr__(self) -> str:
        names = ", ".join(v.name for v in self.controls.variables)
        seen = f"{len(self.instruments)} cameras, {len(self.points)} pyranometers"
        return f"<Operator: {seen}; {names}; {self.size} values>"

    def linearize(self, state: xr.Dataset, near: Linearization | None = None) -> Linearization:
        """H and its derivative about a state, no less than the least that may be (`Controls.lifted`). near: one about
        a state like it, from whose light this one's is begun, which is quicker."""
        return Linearization.about(self, state, near)

    def ensemble(self, states: Iterable[xr.Dataset] | xr.Dataset) -> xr.DataArray:
        """H(x) of members, (member, observation). Members do not know of each other: several processes or threads may
        share the work."""
        rows = [self(each).values for each in listed(states, "ensemble")]
        if not rows:
            raise UserError("ensemble: there are no states")
        return xr.DataArray(np.stack(rows), dims=("member", "observation"), coords=self._coords)

    def observations(self, images: Sequence[Any] = (), irradiance_w_m2: Any = None, **settings: Any) -> xr.Dataset:
        """What was observed, as `analyse` takes it: see `observations.observations`."""
        return observations(self, images, irradiance_w_m2, **settings)

    def as_jax(self) -> Any:
        """H as a function of JAX arrays, one for each control, with its gradient: see `bridges.as_jax`."""
        from openswim.assimilation.observing.bridges import as_jax

        return as_jax(self)

    def as_torch(self) -> Any:
        """H as a function of torch tensors, one for each control, with its gradient: see `bridges.as_torch`."""
        from openswim.assimilation.observing.bridges import as_torch

        return as_torch(self)


def listed(states: Iterable[xr.Dataset] | xr.Dataset, what: str) -> list[xr.Dataset]:
    """The states of members: several, or one Dataset along ``member``."""
    if isinstance(states, xr.Dataset):
        if "member" not in states.dims:
            raise UserError(f"{what}: this is a single state: give a list of states, or one Dataset along member")
        return [states.isel(member=n, drop=True) for n in range(states.sizes["member"])]
    check_kind(f"{what}: states", states, Iterable, "give a list of states, or one Dataset along member")
    return list(states)
