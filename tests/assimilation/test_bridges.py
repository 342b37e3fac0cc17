"""The operator as a function of JAX and PyTorch, where these are installed."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest
from tests.assimilation.test_operator import operator

from openswim import UserError
from openswim.assimilation import Operator
from openswim.assimilation.observing.bridges import _Latest


def slope(op: Operator, way: dict[str, np.ndarray]) -> float:
    """Of the sum of squares of H, by differences."""
    step = 1e-4
    change = op.first().assign({name: (op.first()[name].dims, v) for name, v in way.items()})
    ends = [float((op(op.first() + sign * step * change)
                   ** 2).sum()) for sign in (1, -1)]  # fmt: skip
    return (ends[0] - ends[1]) / (2 * step)


def ways(op: Operator) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {str(name): values.values * rng.random(values.shape) for name, values in op.first().items()}


def test_jax() -> None:
    jax = pytest.importorskip("jax")
    op = operator()
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(UserError, match="64-bit"):
        op.as_jax()
    jax.config.update("jax_enable_x64", True)
    f = op.as_jax()
    arrays = [jax.numpy.asarray(v.values) for v in op.first().values()]
    gradient = jax.jit(jax.grad(lambda *a: (f(*a) ** 2).sum(), argnums=(0, 1, 2)))(*arrays)
    way = ways(op)
    found = sum(float((g * v).sum()) for g, v in zip(gradient, way.values(), strict=True))
    assert found == pytest.approx(slope(op, way), rel=1e-6)


def test_jax_maps_over_members_and_rows() -> None:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    op = operator()
    f = op.as_jax()
    arrays = [jax.numpy.asarray(v.values) for v in op.first().values()]
    members = [jax.numpy.stack([a, 1.1 * a]) for a in arrays]
    both = jax.vmap(f)(*members)
    np.testing.assert_allclose(both[1], op(1.1 * op.first()), rtol=1e-12)
    rows = jax.jacrev(lambda *a: f(*a)[-2:])(*arrays)
    np.testing.assert_allclose(rows, op.linearize(op.first()).jacobian([op.size - 2, op.size - 1]).extinction_cloud)


@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_torch(device: str) -> None:
    torch = pytest.importorskip("torch")
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("no CUDA device")
    op = operator()
    arrays = [
        torch.tensor(v.values, dtype=torch.float64, device=device, requires_grad=True) for v in op.first().values()
    ]
    row = op.as_torch()(*arrays)
    assert row.device.type == device
    (row**2).sum().backward()
    way = ways(op)
    found = sum(float((a.grad.cpu().numpy() * v).sum()) for a, v in zip(arrays, way.values(), strict=True))
    assert found == pytest.approx(slope(op, way), rel=1e-6)


def test_torch_in_single_precision() -> None:
    """Controls of a network are singles: their gradients are too."""
    torch = pytest.importorskip("torch")
    op = operator()
    arrays = [torch.tensor(v.values, dtype=torch.float32, requires_grad=True) for v in op.first().values()]
    op.as_torch()(*arrays).sum().backward()
    assert all(a.grad.dtype is torch.float32 and a.grad.abs().sum() > 0 for a in arrays)


def test_torch_maps_over_members_and_rows() -> None:
    torch = pytest.importorskip("torch")
    op = operator()
    f = op.as_torch()
    arrays = [torch.tensor(v.values, dtype=torch.float64) for v in op.first().values()]
    both = torch.func.vmap(f)(*(torch.stack([a, 1.1 * a]) for a in arrays))
    np.testing.assert_allclose(both[1], op(1.1 * op.first()), rtol=1e-12)
    rows = torch.func.jacrev(lambda a: f(a, *arrays[1:])[-2:])(arrays[0])
    np.testing.assert_allclose(rows, op.linearize(op.first()).jacobian([op.size - 2, op.size - 1]).extinction_cloud)


def test_torch_has_no_second_derivative_and_says_so() -> None:
    """A penalty on a gradient was differentiated as if it were constant."""
    torch = pytest.importorskip("torch")
    op = operator()
    arrays = [torch.tensor(v.values, requires_grad=True) for v in op.first().values()]
    gradient = torch.autograd.grad(op.as_torch()(*arrays).sum(), arrays, create_graph=True)
    with pytest.raises(UserError, match="first order"):
        sum((each**2).sum() for each in gradient).backward()


def test_torch_takes_tensors_of_real_numbers() -> None:
    torch = pytest.importorskip("torch")
    op = operator()
    arrays = [torch.tensor(v.values) for v in op.first().values()]
    for wrong in (arrays[0].numpy(), arrays[0].to(torch.complex128)):
        with pytest.raises(UserError, match="give a tensor of real numbers"):
            op.as_torch()(wrong, *arrays[1:])


def test_jax_in_single_precision() -> None:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    op = operator()
    arrays = [jax.numpy.asarray(v.values, "float32") for v in op.first().values()]
    gradient = jax.grad(lambda *a: op.as_jax()(*a).sum(), argnums=(0, 1, 2))(*arrays)
    assert [each.dtype.name for each in gradient] == ["float32"] * 3


def test_a_thread_gets_its_own_value_whatever_another_asks_meanwhile() -> None:
    """Each attribute that is set is followed by another's question."""
    op = operator()
    mine, others = ([v.values * share for v in op.first().values()] for share in (1.0, 0.7))

    class Interrupted(_Latest):
        meanwhile = False

        def __setattr__(self, name: str, value: Any) -> None:
            super().__setattr__(name, value)
            if self.meanwhile:
                type(self).meanwhile = False
                super().at(others)
                type(self).meanwhile = True

    latest, alone = Interrupted(op), _Latest(op)
    expected = [alone.at(arrays).value.values for arrays in (mine, others)]
    Interrupted.meanwhile = True
    found = [latest.at(mine).value.values]
    Interrupted.meanwhile = False
    found.append(latest.at(others).value.values)
    assert np.array_equal(found, expected)


def test_arrays_of_other_shapes_are_one_line() -> None:
    op = operator()
    arrays = [v.values for v in op.first().values()]
    for wrong in (arrays[:2], [arrays[0][:2], *arrays[1:]]):
        with pytest.raises(UserError, match=r"give extinction_cloud \(8, 10, 12\), surface_albedo"):
            _Latest(op).at(wrong)


@pytest.mark.parametrize("name", ["jax", "torch"])
def test_without_the_library(name: str) -> None:
    if importlib.util.find_spec(name) is not None:
        pytest.skip(f"{name} is installed")
    with pytest.raises(UserError, match="pip install"):
        getattr(operator(), f"as_{name}")()
