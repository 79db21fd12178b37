"""Primitives that only move elements: they move the scalars of object arrays when lowered."""

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Scalar
from jaxsat.compiler.lowering import Elements, as_elements, filled, lowers


@lowers("reshape")
def _reshape(b: Builder, eqn, x: Elements) -> Elements:
    del b
    order = eqn.parameters["dimensions"]
    return (x if order is None else x.transpose(order)).reshape(eqn.parameters["new_sizes"])


@lowers("squeeze")
def _squeeze(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return x.reshape(eqn.outputs[0].aval.shape)


@lowers("broadcast_in_dim")
def _broadcast_in_dim(b: Builder, eqn, x: Elements) -> Elements:
    del b
    shape, dims = eqn.parameters["shape"], eqn.parameters["broadcast_dimensions"]
    widened = [1] * len(shape)
    for size, dim in zip(x.shape, dims, strict=True):
        widened[dim] = size
    return np.broadcast_to(x.reshape(widened), shape)


@lowers("transpose")
def _transpose(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return x.transpose(eqn.parameters["permutation"])


@lowers("slice")
def _slice(b: Builder, eqn, x: Elements) -> Elements:
    del b
    begins, ends = eqn.parameters["start_indices"], eqn.parameters["limit_indices"]
    strides = eqn.parameters["strides"] or (1,) * x.ndim
    return x[tuple(map(slice, begins, ends, strides))]


@lowers("concatenate")
def _concatenate(b: Builder, eqn, *arrays: Elements) -> Elements:
    del b
    return np.concatenate(arrays, axis=eqn.parameters["dimension"])


@lowers("stack")
def _stack(b: Builder, eqn, *arrays: Elements) -> Elements:
    del b
    return np.stack(arrays, axis=eqn.parameters["axis"])


@lowers("split")
def _split(b: Builder, eqn, x: Elements) -> list[Elements]:
    del b
    ends = np.cumsum(eqn.parameters["sizes"])[:-1]
    return np.split(x, ends, axis=eqn.parameters["axis"])


@lowers("rev")
def _rev(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return np.flip(x, eqn.parameters["dimensions"])


@lowers("pad")
def _pad(b: Builder, eqn, x: Elements, padding: Elements) -> Elements:
    del b
    for axis, widths in enumerate(eqn.parameters["padding_config"]):
        x = _padded(np.moveaxis(x, axis, 0), padding[()], *map(int, widths))
        x = np.moveaxis(x, 0, axis)
    return x


def _padded(x: Elements, scalar: Scalar, low: int, high: int, between: int) -> Elements:
    """Padded along the first axis; what is negative is cut off."""
    size, rest = len(x), x.shape[1:]
    spread = filled((size + max(size - 1, 0) * between, *rest), scalar)
    spread[:: between + 1] = x
    before, after = (filled((max(width, 0), *rest), scalar) for width in (low, high))
    whole = np.concatenate([before, spread, after])
    return whole[max(-low, 0) : len(whole) - max(-high, 0)]


@lowers("iota")
def _iota(b: Builder, eqn) -> Elements:
    del b
    shape, dim = eqn.parameters["shape"], eqn.parameters["dimension"]
    along = np.arange(shape[dim]).astype(eqn.parameters["dtype"])
    spread = along.reshape([-1 if axis == dim else 1 for axis in range(len(shape))])
    return as_elements(np.broadcast_to(spread, shape))


@lowers("platform_index")
def _platform_index(b: Builder, eqn) -> Elements:
    """Which branch is for this platform: the processor's, else the one for all."""
    del b
    platforms = eqn.parameters["platforms"]
    chosen = next((i for i, names in enumerate(platforms) if names and "cpu" in names), None)
    if chosen is None:
        chosen = next(i for i, names in enumerate(platforms) if names is None)
    return as_elements(np.int32(chosen))


@lowers("empty", "empty2")
def _empty(b: Builder, eqn) -> Elements:
    del b
    return as_elements(np.zeros(eqn.outputs[0].aval.shape, eqn.outputs[0].aval.dtype))


@lowers("unstack")
def _unstack(b: Builder, eqn, x: Elements) -> list[Elements]:
    """What unpacking an array that is known gives."""
    del b
    first = np.moveaxis(x, eqn.parameters["axis"], 0)
    return [first[i : i + 1].reshape(first.shape[1:]) for i in range(len(first))]
