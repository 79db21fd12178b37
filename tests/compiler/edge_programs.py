"""Uses of every primitive that is no function of one or two numbers, on vectors of edge values.

Sums and products have so few terms, and factors so simple, that their order does not matter.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core.primitives import empty2_p
from jax.extend.random import threefry_2x32

from compiler.edge_values import ALL, BOOLS, FLOATS, MISSING, NUMBERS, WHOLE

LENGTH = 6

ALIASES = {
    "empty": "empty2", "stop_gradient": "copy", "pvary": "copy", "name": "copy",
    "xla_metadata_value": "copy", "sharding_constraint": "copy", "reshard": "copy",
}  # fmt: skip
"""What has the very rule of another primitive."""


@dataclass(frozen=True)
class Use:
    """`function(x, y, i)` of two vectors and an index, and the types of the vectors."""

    function: Callable
    dtypes: tuple[np.dtype, ...] = ALL
    ulps: int = 0


def _pairs(x):
    return x.reshape(3, 2)


def _reducing(function, dtypes) -> Use:
    return Use(lambda x, y, i: [function(_pairs(x), axes=(1,)), function(x[:2], axes=(0,))], dtypes)


def _along(function, dtypes) -> Use:
    return Use(
        lambda x, y, i: [function(_pairs(x), axis=1, reverse=r) for r in (True, False)], dtypes
    )


def _scattered(method: str, dtypes) -> Use:
    def function(x, y, i):
        modes = ("clip", "drop")
        one = [getattr(x.at[i], method)(y[0], mode=mode) for mode in modes]
        return one, [getattr(_pairs(x).at[:, i], method)(y[1], mode=mode) for mode in modes]

    return Use(function, dtypes)


def _windows(function, dtypes) -> Use:
    return Use(lambda x, y, i: function(x), dtypes)


def _custom_jvp(x):
    @jax.custom_jvp
    def own(x):
        return x

    own.defjvp(lambda primals, tangents: (own(*primals), tangents[0]))
    return own(x)


def _custom_vjp(x):
    @jax.custom_vjp
    def own(x):
        return x

    own.defvjp(lambda x: (x, None), lambda _, g: (g,))
    return own(x)


def _solved(x, y, i):
    """By `custom_linear_solve`, of a diagonal matrix of powers of two."""
    return lax.custom_linear_solve(lambda v: v * 4.0, y, lambda _, side: side / 4.0, symmetric=True)


def _nothing(x):
    """What nobody has written to, which XLA and the native engine both fill with zeros."""
    return empty2_p.bind(dtype=x.dtype, memory_space=jax.memory.Space.Device)


def _threefry():
    kind: Any = jax.random.key(0).dtype
    return kind._impl


def _key(i):
    return jax.random.key(i.astype(jnp.uint32))


def _while(x, y, i):
    return lax.while_loop(lambda s: s[0] < i % 5, lambda s: (s[0] + 1, s[2], s[1]), (i * 0, x, y))


def _scan(x, y, i):
    return lax.scan(lambda c, row: (row[0], (c, row[1])), x[0], (x, y), reverse=True)


def _long_scan(x, y, i):
    rows = jnp.tile(x, 20)
    return lax.scan(lambda c, row: (jnp.stack([c[1], row]), c[0]), y[:2], rows)[0]


def _triangle(x):
    return x.dtype.type(1) * np.array([[4, 0], [2, 2]], x.dtype)


PROGRAMS: dict[str, list[Use]] = {
    "reshape": [
        Use(lambda x, y, i: x.reshape(2, 3)),
        Use(lambda x, y, i: lax.reshape(x.reshape(2, 3), (6,), dimensions=(1, 0))),
    ],
    "squeeze": [Use(lambda x, y, i: lax.squeeze(x[None], (0,)))],
    "broadcast_in_dim": [Use(lambda x, y, i: jnp.broadcast_to(x[:, None], (6, 2)))],
    "transpose": [Use(lambda x, y, i: _pairs(x).T)],
    "slice": [Use(lambda x, y, i: lax.slice(x, (1,), (6,), (2,)))],
    "concatenate": [Use(lambda x, y, i: lax.concatenate([x, y], 0))],
    "stack": [Use(lambda x, y, i: jnp.stack([x, y], 1))],
    "unstack": [Use(lambda x, y, i: lax.unstack(_pairs(x), axis=1))],
    "split": [Use(lambda x, y, i: jnp.split(x, [1, 4]))],
    "rev": [Use(lambda x, y, i: lax.rev(x, (0,)))],
    "tile": [Use(lambda x, y, i: jnp.tile(x, 2))],
    "pad": [Use(lambda x, y, i: lax.pad(x, y[0], [(2, -1, 1)]))],
    "iota": [Use(lambda x, y, i: lax.iota(x.dtype, 7), NUMBERS)],
    "empty2": [Use(lambda x, y, i: _nothing(x))],
    "platform_index": [
        Use(lambda x, y, i: lax.platform_dependent(x, cpu=lambda v: v, default=jnp.flip)),
    ],
    "gather": [
        Use(lambda x, y, i: [x.at[i].get(mode=mode) for mode in ("clip", "fill")]),
        Use(lambda x, y, i: x[i]),
        Use(lambda x, y, i: jnp.tile(x, 6)[i]),
        Use(lambda x, y, i: _pairs(x).at[i, i].get(mode="fill")),
    ],
    "dynamic_slice": [
        Use(lambda x, y, i: lax.dynamic_slice(x, (i,), (2,))),
        Use(lambda x, y, i: lax.dynamic_slice(_pairs(x), (i, i), (1, 2))),
    ],
    "dynamic_update_slice": [Use(lambda x, y, i: lax.dynamic_update_slice(x, y[:2], (i,)))],
    "scatter": [_scattered("set", ALL)],
    "scatter-add": [_scattered("add", NUMBERS)],
    "scatter-sub": [_scattered("subtract", NUMBERS)],
    "scatter-mul": [_scattered("multiply", NUMBERS)],
    "scatter-min": [_scattered("min", ALL)],
    "scatter-max": [_scattered("max", ALL)],
    "reduce_sum": [_reducing(lax.reduce_sum, NUMBERS)],
    "reduce_prod": [_reducing(lax.reduce_prod, NUMBERS)],
    "reduce_max": [_reducing(lax.reduce_max, ALL),
                   Use(lambda x, y, i: lax.reduce_max(x, axes=(0,)))],
    "reduce_min": [_reducing(lax.reduce_min, ALL),
                   Use(lambda x, y, i: lax.reduce_min(x, axes=(0,)))],
    "reduce_and": [_reducing(lax.reduce_and, WHOLE + BOOLS)],
    "reduce_or": [_reducing(lax.reduce_or, WHOLE + BOOLS)],
    "reduce_xor": [_reducing(lax.reduce_xor, WHOLE + BOOLS)],
    "reduce": [
        Use(lambda x, y, i: lax.reduce(
        x, x.dtype.type(1), lambda a, b: jnp.where(a == b, a, b), (0,))),
    ],
    "argmax": [Use(lambda x, y, i: [lax.argmax(x, 0, d) for d in (np.int32, np.uint8)])],
    "argmin": [Use(lambda x, y, i: lax.argmin(_pairs(x), 0, np.int64))],
    "cumsum": [_along(lax.cumsum, NUMBERS)],
    "cumprod": [_along(lax.cumprod, NUMBERS)],
    "cummax": [_along(lax.cummax, NUMBERS)],
    "cummin": [_along(lax.cummin, NUMBERS)],
    "cumlogsumexp": [Use(lambda x, y, i: lax.cumlogsumexp(_pairs(x), axis=1), FLOATS, ulps=16)],
    "sort": [
        Use(lambda x, y, i: lax.sort(x)),
        Use(lambda x, y, i: lax.sort((x, y), num_keys=1)),
        Use(lambda x, y, i: lax.sort((x, y, x), num_keys=2)),
    ],
    "polynomial": [
        Use(lambda x, y, i: lax.polynomial(x, (y, jnp.full_like(x, 2))), FLOATS),
    ],
    "top_k": [Use(lambda x, y, i: lax.top_k(x, 3), NUMBERS)],
    "reduce_window": [
        Use(lambda x, y, i: lax.reduce_window(
        x, x.dtype.type(3), lambda a, b: a ^ b, (2,), (1,), "SAME"), WHOLE),
    ],
    "reduce_window_sum": [
        Use(lambda x, y, i: lax.reduce_window(x, x.dtype.type(0), lax.add, (2,), (2,), "VALID"),
            NUMBERS),
    ],
    "reduce_window_max": [
        Use(lambda x, y, i: lax.reduce_window(x, _end(x, -1), lax.max, (2,), (1,), "SAME"),
            NUMBERS),
    ],
    "reduce_window_min": [
        Use(lambda x, y, i: lax.reduce_window(x, _end(x, 1), lax.min, (2,), (1,), "SAME"), NUMBERS),
    ],
    "conv_general_dilated": [
        Use(lambda x, y, i: lax.conv_general_dilated(
            x[None, None], jnp.ones((1, 1, 1), x.dtype), (2,), [(0, 0)]), NUMBERS),
    ],
    "dot_general": [
        Use(lambda x, y, i: [lax.dot_general(x[:, None], y[None], (((1,), (0,)), ((), ()))),
                             lax.dot_general(x[:2], y[:2], (((), ()), ((0,), (0,))))], NUMBERS),
        Use(lambda x, y, i: x @ y, WHOLE),
        Use(lambda x, y, i: (x * 0) @ jnp.ones_like(x), FLOATS),
    ],
    "custom_linear_solve": [Use(_solved, FLOATS)],
    "lu": [Use(lambda x, y, i: lax.linalg.lu(_triangle(x) + 0 * y[:4].reshape(2, 2))[1:], FLOATS)],
    "cholesky": [
        Use(lambda x, y, i: lax.linalg.cholesky(jnp.diag(jnp.nan_to_num(x[:2]))), FLOATS),
    ],
    "triangular_solve": [
        Use(lambda x, y, i: lax.linalg.triangular_solve(
            _triangle(x), y[:2, None] * 0 + 8, left_side=True, lower=True), FLOATS),
    ],
    "while": [Use(_while)],
    "scan": [Use(_scan), Use(_long_scan)],
    "cond": [
        Use(lambda x, y, i: lax.switch(i, [lambda: x, lambda: y, lambda: x[::-1]])),
        Use(lambda x, y, i: lax.cond(x[0] == y[0], lambda: x, lambda: y)),
    ],
    "call": [
        Use(lambda x, y, i: jax.jit(lambda v: v[::-1])(x)),
        Use(lambda x, y, i: jax.checkpoint(lambda v: v[::-1])(x)),
        Use(lambda x, y, i: _custom_jvp(x)),
        Use(lambda x, y, i: _custom_vjp(x)),
    ],
    "random_seed": [Use(lambda x, y, i: jax.random.key_data(jax.random.key(i)))],
    "random_wrap": [Use(lambda x, y, i: jax.random.bits(jax.random.wrap_key_data(
        jnp.stack([i, i + 1]).astype(jnp.uint32))))],
    "random_unwrap": [Use(lambda x, y, i: jax.random.key_data(jax.random.split(_key(i))))],
    "random_bits": [Use(lambda x, y, i: [jax.random.bits(_key(i), (3,), d)
                                         for d in ("uint8", "uint16", "uint32", "uint64")])],
    "random_split": [Use(lambda x, y, i: jax.random.key_data(jax.random.split(_key(i), 3)))],
    "random_fold_in": [Use(lambda x, y, i: jax.random.key_data(jax.random.fold_in(_key(i), i)))],
    "random_clone": [Use(lambda x, y, i: jax.random.key_data(jax.random.clone(_key(i))))],
    "threefry2x32": [Use(lambda x, y, i: threefry_2x32(
        jnp.stack([i, i + 1]).astype(jnp.uint32), jnp.arange(3, dtype=jnp.uint32)))],
    "iota_2x32_shape": [Use(lambda x, y, i: _threefry().random_bits(
        jnp.stack([i, i + 1]).astype(jnp.uint32), 32, (3,)))],
}  # fmt: skip
PROGRAMS = {name: uses for name, uses in PROGRAMS.items() if name not in MISSING}


def _end(x, sign: int):
    if x.dtype.kind == "f":
        return x.dtype.type(sign * np.inf)
    info = jnp.iinfo(x.dtype)
    return x.dtype.type(info.max if sign > 0 else info.min)
