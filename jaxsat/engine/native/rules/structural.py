"""Primitives that only move elements: they move the scalars of object arrays when lowered."""

import numpy as np

from jaxsat.engine.native.builder import Builder
from jaxsat.engine.native.lowering import Elements, as_elements, lowers


@lowers("reshape")
def _reshape(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return x.reshape(eqn.params["new_sizes"])


@lowers("squeeze")
def _squeeze(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return x.reshape(eqn.outvars[0].aval.shape)


@lowers("expand_dims")
def _expand_dims(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return x.reshape(eqn.outvars[0].aval.shape)


@lowers("broadcast_in_dim")
def _broadcast_in_dim(b: Builder, eqn, x: Elements) -> Elements:
    del b
    shape, dims = eqn.params["shape"], eqn.params["broadcast_dimensions"]
    widened = [1] * len(shape)
    for size, dim in zip(x.shape, dims, strict=True):
        widened[dim] = size
    return np.broadcast_to(x.reshape(widened), shape)


@lowers("transpose")
def _transpose(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return x.transpose(eqn.params["permutation"])


@lowers("slice")
def _slice(b: Builder, eqn, x: Elements) -> Elements:
    del b
    begins, ends = eqn.params["start_indices"], eqn.params["limit_indices"]
    strides = eqn.params["strides"] or (1,) * x.ndim
    return x[tuple(map(slice, begins, ends, strides))]


@lowers("concatenate")
def _concatenate(b: Builder, eqn, *arrays: Elements) -> Elements:
    del b
    return np.concatenate(arrays, axis=eqn.params["dimension"])


@lowers("stack")
def _stack(b: Builder, eqn, *arrays: Elements) -> Elements:
    del b
    return np.stack(arrays, axis=eqn.params["axis"])


@lowers("split")
def _split(b: Builder, eqn, x: Elements) -> list[Elements]:
    del b
    ends = np.cumsum(eqn.params["sizes"])[:-1]
    return np.split(x, ends, axis=eqn.params["axis"])


@lowers("rev")
def _rev(b: Builder, eqn, x: Elements) -> Elements:
    del b
    return np.flip(x, eqn.params["dimensions"])


@lowers("pad")
def _pad(b: Builder, eqn, x: Elements, padding: Elements) -> Elements:
    del b
    config = eqn.params["padding_config"]
    apart = [size + max(size - 1, 0) * between for size, (_, _, between) in zip(x.shape, config)]
    spread = np.full(apart, padding[()], object)
    spread[tuple(slice(None, None, between + 1) for _, _, between in config)] = x
    widths = [(max(low, 0), max(high, 0)) for low, high, _ in config]
    grown = np.full([s + low + high for s, (low, high) in zip(apart, widths)], padding[()], object)
    grown[tuple(slice(low, low + s) for s, (low, _) in zip(apart, widths))] = spread
    cut = [
        slice(max(-low, 0), size - max(-high, 0))
        for size, (low, high, _) in zip(grown.shape, config, strict=True)
    ]
    return grown[tuple(cut)]


@lowers("iota")
def _iota(b: Builder, eqn) -> Elements:
    del b
    shape, dim = eqn.params["shape"], eqn.params["dimension"]
    along = np.arange(shape[dim]).astype(eqn.params["dtype"])
    spread = along.reshape([-1 if axis == dim else 1 for axis in range(len(shape))])
    return as_elements(np.broadcast_to(spread, shape))


@lowers("platform_index")
def _platform_index(b: Builder, eqn) -> Elements:
    """Which branch is for this platform: the processor's, else the one for all."""
    del b
    platforms = eqn.params["platforms"]
    chosen = next((i for i, names in enumerate(platforms) if names and "cpu" in names), None)
    if chosen is None:
        chosen = next(i for i, names in enumerate(platforms) if names is None)
    return as_elements(np.int32(chosen))


@lowers("sharding_constraint", "mesh_cast", "reshard")
def _sharded(b: Builder, eqn, x: Elements) -> Elements:
    del b, eqn
    return x


@lowers("empty")
def _empty(b: Builder, eqn) -> Elements:
    del b
    return as_elements(np.zeros(eqn.outvars[0].aval.shape, eqn.outvars[0].aval.dtype))
