"""Plain steps of random programs: arithmetic, bits, indices, sorts, windows, random numbers.

Nothing asks for the sign or the payload of NaN, and integers are divided behind a barrier: XLA
folds divisions of constants by instructions that trap.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from compiler.program_writer import (
    FLOATS,
    SIGNED,
    TYPES,
    UNSIGNED,
    Writer,
    as_type,
    shaped,
    tame,
)

MODES = ("clip", "fill", "wrap")


def _guarded(x):
    return lax.optimization_barrier(x)


def _arithmetic(w: Writer):
    x, y = w.pair([t for t in TYPES if t != "bool"])
    found = w.one_of([lax.add, lax.sub, lax.mul])(x, y)
    return tame(found) if x.dtype.kind == "f" else found


def _choice(w: Writer):
    x, y = w.pair(TYPES)
    if w.below(3):
        return w.one_of([lax.max, lax.min])(x, y)
    if x.dtype == bool:
        return x ^ y
    z = w.like(x)
    mapped = jnp.where(y < z, x, x)  # JAX cannot map over the bounds of `clamp` alone
    return lax.clamp(y, mapped, z)


def _quotient(w: Writer):
    x, y = w.pair([t for t in TYPES if t != "bool"])
    if x.dtype.kind == "f":
        return tame(w.one_of([lax.div, jnp.remainder, lax.rem])(x, y))
    x, y = _guarded(x), _guarded(y)
    return w.one_of([lax.div, lax.rem, jnp.floor_divide, jnp.remainder])(x, y)


def _comparison(w: Writer):
    x, y = w.pair(TYPES)
    return w.one_of([lax.lt, lax.le, lax.gt, lax.ge, lax.eq, lax.ne])(x, y)


def _bits(w: Writer):
    x, y = w.pair((*SIGNED, *UNSIGNED, "bool"))
    if x.dtype == bool or w.below(2):
        return w.one_of([lambda x, y: x & y, lambda x, y: x | y, lambda x, y: x ^ ~y])(x, y)
    shifts = [lax.shift_left, lax.shift_right_logical, lax.shift_right_arithmetic]
    return w.one_of(shifts)(x, y % 9 if w.below(2) else y)


def _alone(w: Writer):
    x = w.any([t for t in TYPES if t != "bool"])
    if x.dtype.kind == "f":
        return w.one_of([jnp.abs, jnp.negative, jnp.floor, jnp.ceil, jnp.rint, lax.round, jnp.sign,
                         jnp.isfinite, jnp.isnan, jnp.trunc, jnp.nan_to_num])(x)  # fmt: skip
    found = w.one_of([jnp.abs, jnp.sign, jnp.negative, lax.population_count, jnp.square])
    return lax.clz(_guarded(x)) if w.below(5) == 0 else found(x)


def _elementary(w: Writer):
    x = w.any(("float64",))
    several = [jnp.sqrt, jnp.exp, jnp.log, jnp.sin, jnp.cos, jnp.tan, jnp.tanh, jnp.arctan,
               jnp.sinh, jnp.arcsin, jnp.log1p, jnp.expm1, jnp.cbrt, jax.nn.sigmoid, lax.erf,
               jnp.cosh, lax.rsqrt, lambda x: lax.integer_pow(x, 3), lambda x: x**-2,
               jnp.arcsinh]  # fmt: skip
    if w.below(4):
        return tame(w.one_of(several)(x))
    y = w.like(x)
    return tame(w.one_of([jnp.arctan2, jnp.hypot, lambda x, y: jnp.abs(x) ** y])(x, y))


def _conversion(w: Writer):
    return as_type(w.any(), w.one_of(TYPES))


def _float_bits(w: Writer):
    x = w.any(FLOATS)
    x = jnp.where(jnp.isnan(x), 1.5, x)
    word = jnp.int64 if x.dtype == jnp.float64 else jnp.uint32
    bits = lax.bitcast_convert_type(x, word)
    return bits, lax.bitcast_convert_type(bits, x.dtype), jnp.signbit(x), jnp.copysign(2.0, x)


def _where(w: Writer):
    x, y = w.pair(TYPES)
    if w.below(3):
        return jnp.where(w.any(("bool",), x.shape), x, y)
    number = jnp.clip(w.any(("int32",), x.shape), 0, 2)
    return lax.select_n(number, x, y, w.like(x))


def _moved(w: Writer):
    x = w.any(shape=(2, 3))
    y = w.any((x.dtype.name,), (2, 3))
    return w.one_of([
        lambda: x.T, lambda: jnp.concatenate([x, y], 1)[:, 1:5:2], lambda: jnp.flip(x, 1),
        lambda: lax.pad(x, y[0, 0], [(1, -1, 0), (0, 1, 1)])[:2, :3], lambda: jnp.roll(x, 1, 0),
        lambda: jnp.stack([x[0], y[1]]), lambda: jnp.tile(x[0], 2), lambda: jnp.split(x, 3, 1)[1],
        lambda: jnp.repeat(x[:, 0], 2), lambda: jnp.triu(x), lambda: jnp.diagonal(x),
        lambda: jnp.outer(x[0], jnp.arange(3) == 1)[:2].astype(x.dtype), lambda: x.reshape(3, 2)[1],
    ])()  # fmt: skip


def _reduction(w: Writer):
    x = w.any(shape=w.one_of([(2, 3), (3,), (5,)]))
    axis = w.one_of([0, -1, None])
    if x.dtype == bool:
        return w.one_of([jnp.any, jnp.all, jnp.sum, jnp.max, jnp.argmax])(x, axis=axis)
    several = [jnp.sum, jnp.max, jnp.min, jnp.argmax, jnp.argmin, jnp.count_nonzero]
    if x.dtype.kind != "f":
        several += [jnp.prod, jnp.bitwise_and.reduce, jnp.bitwise_xor.reduce]
    found = w.one_of(several)(x, axis=axis)
    return tame(found) if found.dtype.kind == "f" else found


def _convolved(x, y):
    """Of finite numbers: XLA multiplies padding with the others, but of 32-bit floats only."""
    x, y = (jnp.where(jnp.isfinite(z), z, 1) for z in (x, y))
    return jnp.convolve(x, y)


def _product(w: Writer):
    name = w.one_of([*FLOATS, "int8", "int32", "uint64"])
    x, y = w.any((name,), (2, 3)), w.any((name,), (3,))
    found = w.one_of([lambda: x @ y, lambda: x @ x.T, lambda: jnp.vdot(y, x[1]),
                      lambda: jnp.einsum("ij,j->ij", x, y), lambda: _convolved(y, x[0]),
                      lambda: jnp.prod(jnp.clip(y, 0, 8)), lambda: jnp.cross(x[0], y),
                      ])()  # fmt: skip
    return tame(found) if name in FLOATS else found


def _along(w: Writer):
    x = w.vector([t for t in TYPES if t != "bool"])
    if w.below(2):
        found = lax.cumsum(x, 0, reverse=bool(w.below(2)))
        return tame(found) if x.dtype.kind == "f" else found
    if w.below(2):
        return w.one_of([lax.cummax, lax.cummin])(x, 0, reverse=bool(w.below(2)))
    found = lax.associative_scan(w.one_of([jnp.add, jnp.maximum]), x)
    return tame(found) if x.dtype.kind == "f" else found


def _order(w: Writer):
    x = w.vector()
    y = w.any(shape=x.shape)
    several = [
        lambda: jnp.sort(x), lambda: jnp.argsort(x), lambda: lax.sort((x, y), num_keys=2),
        lambda: lax.sort((x, y), num_keys=1, is_stable=True), lambda: jnp.argsort(x, stable=True),
        lambda: jnp.sort(x, descending=True),
    ]  # fmt: skip
    if x.dtype != bool:
        several.append(lambda: lax.top_k(x, 2))
        several.append(lambda: jnp.searchsorted(jnp.sort(x), shaped(y, (2,)).astype(x.dtype)))
    return w.one_of(several)()


def _window(w: Writer):
    x = w.vector(("float64", "float32", "int32", "int8", "uint32"))
    join, first = w.one_of([(lax.max, None), (lax.min, None), (lax.add, 0)])
    if first is None:
        info = jnp.finfo(x.dtype) if x.dtype.kind == "f" else jnp.iinfo(x.dtype)
        first = info.min if join is lax.max else info.max
        if x.dtype.kind == "f":
            first = -np.inf if join is lax.max else np.inf
    first = np.asarray(first, x.dtype)
    padding = w.one_of(["VALID", "SAME"])
    return lax.reduce_window(x, first, join, (2,), (w.one_of([1, 2]),), padding)


def _reduced_by_program(w: Writer):
    x = w.vector(("int32", "uint8", "int64"))
    join = w.one_of([lambda a, b: a * 3 + b, lambda a, b: jnp.where(a > b, a, b - 1)])
    return lax.fori_loop(0, len(x), lambda i, y: join(y, x[i]), jnp.zeros((), x.dtype))


def _read(w: Writer):
    x, i = w.vector(), w.index()
    several = jnp.stack([i, i + 1, i // 2])
    mode, inside = w.one_of(MODES), w.one_of(MODES[:2])
    return w.one_of([
        lambda: x[i], lambda: jnp.take(x, several, mode=mode),
        lambda: x.at[several].get(mode=inside),
        lambda: lax.dynamic_slice(x, (i,), (2,)), lambda: x.at[i].get(mode=inside),
        lambda: jnp.take_along_axis(x, several, 0, mode=inside), lambda: x.at[i].get(mode="drop"),
        lambda: shaped(x, (2, 3))[i, i // 2], lambda: shaped(x, (2, 3))[:, i],
        lambda: lax.dynamic_slice(shaped(x, (2, 3)), (i, i + 1), (1, 2)),
        lambda: lax.dynamic_index_in_dim(x, i, keepdims=False), lambda: jnp.arange(40)[i],
    ])()  # fmt: skip


def _written(w: Writer):
    x, i = w.vector(), w.index()
    y = w.any((x.dtype.name,), ())
    place = x.at[jnp.stack([i, i, i + 2]) if w.below(2) else i]
    mode = w.one_of(["clip", "drop", "promise_in_bounds", None])
    if mode == "promise_in_bounds":
        place = x.at[jnp.clip(i.astype(jnp.int32), 0, len(x) - 1)]
    several = [lambda: place.set(y, mode=mode), lambda: place.max(y, mode=mode),
               lambda: lax.dynamic_update_slice(x, y[None], (i,)),
               lambda: shaped(x, (2, 3)).at[:, i].set(y)]  # fmt: skip
    if x.dtype != bool:
        several += [lambda: place.add(y, mode=mode), lambda: place.min(y, mode=mode)]
        if x.dtype.kind in "iu":
            several.append(lambda: place.multiply(y, mode=mode))
    found = w.one_of(several)()
    return tame(found) if x.dtype.kind == "f" else found


def _random(w: Writer):
    number, shape = w.any(("uint32", "int32", "int64"), ()), w.one_of([(), (3,)])
    key = jax.random.key(number) if w.below(2) else jax.random.PRNGKey(number)
    for _ in range(w.below(3)):
        key = w.one_of([lambda k: jax.random.split(k)[1], lambda k: jax.random.fold_in(k, 7)])(key)
    return w.one_of([
        lambda: jax.random.bits(key, shape), lambda: jax.random.bits(key, shape, "uint8"),
        lambda: tame(8 * jax.random.uniform(key, shape)), lambda: jax.random.bernoulli(key, 0.3),
        lambda: tame(jax.random.normal(key, shape)), lambda: jax.random.randint(key, shape, -5, 99),
        lambda: jax.random.permutation(key, 4), lambda: jax.random.bits(key, shape, "uint64"),
    ])()  # fmt: skip


PLAIN = [
    _arithmetic, _arithmetic, _choice, _quotient, _comparison, _bits, _alone, _elementary,
    _conversion, _float_bits, _where, _moved, _reduction, _product, _along, _order, _window,
    _reduced_by_program, _read, _read, _written, _written, _random,
]  # fmt: skip
