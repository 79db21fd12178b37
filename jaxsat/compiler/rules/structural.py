"""Rules of primitives that only move elements: they move the scalars of object arrays."""

from collections.abc import Callable, Sequence

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Scalar
from jaxsat.compiler.lowering import Elements, as_elements, filled, lowers


def _reshape(eqn, x: Elements) -> Elements:
    order = eqn.parameters["dimensions"]
    return (x if order is None else x.transpose(order)).reshape(eqn.parameters["new_sizes"])


def _broadcast_in_dim(eqn, x: Elements) -> Elements:
    shape, dims = eqn.parameters["shape"], eqn.parameters["broadcast_dimensions"]
    widened = [1] * len(shape)
    for size, dim in zip(x.shape, dims, strict=True):
        widened[dim] = size
    return np.broadcast_to(x.reshape(widened), shape)


def _slice(eqn, x: Elements) -> Elements:
    begins, ends = eqn.parameters["start_indices"], eqn.parameters["limit_indices"]
    strides = eqn.parameters["strides"] or (1,) * x.ndim
    return x[tuple(map(slice, begins, ends, strides))]


def _pad(eqn, x: Elements, padding: Elements) -> Elements:
    for axis, widths in enumerate(eqn.parameters["padding_config"]):
        x = _padded(np.moveaxis(x, axis, 0), padding[()], *map(int, widths))
        x = np.moveaxis(x, 0, axis)
    return x


def _padded(x: Elements, scalar: Scalar, low: int, high: int, between: int) -> Elements:
    """Pad an array along the first axis; a negative width cuts off."""
    size, rest = len(x), x.shape[1:]
    spread = filled((size + max(size - 1, 0) * between, *rest), scalar)
    spread[:: between + 1] = x
    before, after = (filled((max(width, 0), *rest), scalar) for width in (low, high))
    whole = np.concatenate([before, spread, after])
    return whole[max(-low, 0) : len(whole) - max(-high, 0)]


def _iota(eqn) -> Elements:
    shape, dim = eqn.parameters["shape"], eqn.parameters["dimension"]
    along = np.arange(shape[dim]).astype(eqn.parameters["dtype"])
    spread = along.reshape([-1 if axis == dim else 1 for axis in range(len(shape))])
    return as_elements(np.broadcast_to(spread, shape))


def _platform_index(eqn) -> Elements:
    """Return the branch of the CPU platform, else the one for all."""
    platforms = eqn.parameters["platforms"]
    branch = next((i for i, names in enumerate(platforms) if names and "cpu" in names), None)
    if branch is None:
        branch = next(i for i, names in enumerate(platforms) if names is None)
    return as_elements(np.int32(branch))


def _empty(eqn) -> Elements:
    return as_elements(np.zeros(eqn.outputs[0].aval.shape, eqn.outputs[0].aval.dtype))


def _unstack(eqn, x: Elements) -> list[Elements]:
    """Return the parts of a constant array."""
    first = np.moveaxis(x, eqn.parameters["axis"], 0)
    return [first[i : i + 1].reshape(first.shape[1:]) for i in range(len(first))]


MOVES: dict[str, Callable[..., Elements | Sequence[Elements]]] = {
    "broadcast_in_dim": _broadcast_in_dim,
    "concatenate": lambda eqn, *arrays: np.concatenate(arrays, eqn.parameters["dimension"]),
    "empty": _empty,
    "empty2": _empty,
    "iota": _iota,
    "pad": _pad,
    "platform_index": _platform_index,
    "reshape": _reshape,
    "rev": lambda eqn, x: np.flip(x, eqn.parameters["dimensions"]),
    "slice": _slice,
    "split": lambda eqn, x: np.split(
        x, np.cumsum(eqn.parameters["sizes"])[:-1], eqn.parameters["axis"]
    ),
    "squeeze": lambda eqn, x: x.reshape(eqn.outputs[0].aval.shape),
    "stack": lambda eqn, *arrays: np.stack(arrays, eqn.parameters["axis"]),
    "transpose": lambda eqn, x: x.transpose(eqn.parameters["permutation"]),
    "unstack": _unstack,
}
"""Functions of arrays for each primitive, given its equation."""


@lowers(*MOVES)
def _moved(b: Builder, eqn, *arrays: Elements) -> Elements | Sequence[Elements]:
    del b
    return MOVES[eqn.name](eqn, *arrays)
