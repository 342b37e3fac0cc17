"""The operator as a function of JAX arrays and of torch tensors; each library is imported when it is asked for."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.assimilation.observing.linearization import Linearization
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError

F64 = NDArray[np.float64]


class _Latest:
    """The linearisation that was asked for last: a gradient comes right after its value."""

    def __init__(self, operator: Rows) -> None:
        self.operator = operator
        self.latest: tuple[bytes, Linearization] | None = None  # set at once, as threads may ask

    def at(self, arrays: list[F64]) -> Linearization:
        key, latest = b"".join(np.ascontiguousarray(a).tobytes() for a in arrays), self.latest
        if latest is None or key != latest[0]:
            near = None if latest is None else latest[1]
            latest = self.latest = key, Linearization.about(self.operator, self._state(arrays), near)
        return latest[1]

    def _state(self, arrays: list[F64]) -> xr.Dataset:
        first, names = self.operator.first(), [v.name for v in self.operator.controls.variables]
        given, wanted = [np.shape(a) for a in arrays], [first[name].shape for name in names]
        if given != wanted:
            listed = ", ".join(f"{name} {shape}" for name, shape in zip(names, wanted, strict=True))
            raise UserError(f"controls of shapes {', '.join(map(str, given))}: give {listed}")
        return first.assign({n: first[n].copy(data=np.asarray(a, float)) for n, a in zip(names, arrays, strict=True)})

    def back(self, arrays: list[F64], bar: Any) -> list[F64]:
        state = self.at(arrays).vjp(np.asarray(bar, float))
        return [np.asarray(state[v.name].values) for v in self.operator.controls.variables]


def as_jax(operator: Rows) -> Any:
    """``f(*controls)``: a row of observations, for `jax.grad`, `jax.jit`, `jax.vmap`, `jax.jacrev` and what is built on
    them.

    Needs 64-bit numbers (`jax.config.update("jax_enable_x64", True)`); gradients are first order, in reverse mode. What
    is mapped over is done one after the other.
    """
    try:
        import jax
        import jax.numpy as jnp
    except ImportError:
        raise UserError("as_jax needs JAX: pip install jax") from None
    if not jax.config.read("jax_enable_x64"):
        raise UserError('as_jax needs 64-bit numbers: jax.config.update("jax_enable_x64", True) first')
    latest = _Latest(operator)
    out = jax.ShapeDtypeStruct((operator.size,), jnp.float64)
    call = partial(jax.pure_callback, vmap_method="sequential")

    @jax.custom_vjp
    def observe(*arrays: Any) -> Any:
        return call(lambda *a: latest.at([np.asarray(x) for x in a]).value.values, out, *arrays)

    def forward(*arrays: Any) -> Any:
        return observe(*arrays), arrays

    def backward(arrays: Any, bar: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(a.shape, jnp.float64) for a in arrays)
        bars = call(lambda b, *a: tuple(latest.back([np.asarray(x) for x in a], b)), shapes, bar, *arrays)
        return tuple(one.astype(a.dtype) for one, a in zip(bars, arrays, strict=True))

    observe.defvjp(forward, backward)
    return observe


def as_torch(operator: Rows) -> Any:
    """``f(*controls)``: a row of observations in double precision, with `backward`, also for what `torch.func` is built
    of.

    The work is done on the CPU; values and gradients come back on the devices of the controls. Gradients are first
    order, in reverse mode. What `torch.func.vmap` maps over is done one after the other.
    """
    try:
        import torch
    except ImportError:
        raise UserError("as_torch needs PyTorch: pip install torch") from None
    latest = _Latest(operator)

    def plain(arrays: tuple[Any, ...]) -> list[F64]:
        return [a.detach().double().cpu().numpy() for a in arrays]

    class Alone(torch.autograd.Function):
        """What is computed of one member at a time."""

        @classmethod
        def vmap(cls, info: Any, in_dims: tuple[int | None, ...], *arrays: Any) -> Any:
            given = list(zip(arrays, in_dims, strict=True))
            each = [
                cls.apply(*(a if dim is None else a.select(dim, n) for a, dim in given)) for n in range(info.batch_size)
            ]
            if isinstance(each[0], tuple):
                return tuple(map(torch.stack, zip(*each, strict=True))), (0,) * len(each[0])
            return torch.stack(each), 0

    class Back(Alone):
        @staticmethod
        def forward(bar: Any, *arrays: Any) -> Any:
            bars = latest.back(plain(arrays), bar.detach().double().cpu().numpy())
            return tuple(torch.from_numpy(b.copy()).to(a) for a, b in zip(arrays, bars, strict=True))

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            pass

        @staticmethod
        def backward(ctx: Any, *bars: Any) -> Any:
            raise UserError("as_torch: gradients are of first order: leave out what differentiates one again")

    class Observe(Alone):
        @staticmethod
        def forward(*arrays: Any) -> Any:
            value = latest.at(plain(arrays)).value.values
            return torch.from_numpy(value.copy()).to(arrays[0].device)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            ctx.save_for_backward(*inputs)

        @staticmethod
        def backward(ctx: Any, bar: Any) -> Any:
            return Back.apply(bar, *ctx.saved_tensors)

    def observe(*arrays: Any) -> Any:
        for a in arrays:
            if not isinstance(a, torch.Tensor) or a.is_complex():
                found = "complex numbers" if isinstance(a, torch.Tensor) else shown(a)
                raise UserError(f"as_torch: {found}: give a tensor of real numbers for each control")
        return Observe.apply(*arrays)

    return observe
