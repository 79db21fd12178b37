"""Random programs by their numbers: what is written depends on a seed alone, not on any value.

Floats lie on a grid so coarse that sums and products of a few are exact, whether they are fused or
not, and what is rounded comes back to it (`tame`). All results can therefore be compared bit for
bit. Nothing asks for the sign or the payload of NaN, and integers are divided behind a barrier: XLA
folds divisions of constants by instructions that trap.
"""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

FLOATS = ("float64", "float32")
SIGNED = ("int8", "int16", "int32", "int64")
UNSIGNED = ("uint8", "uint16", "uint32", "uint64")
TYPES = (*FLOATS, *FLOATS, *SIGNED, *UNSIGNED, "bool")
SHAPES = ((), (), (), (3,), (4,), (5,), (2, 3), (1,))
MODES = ("clip", "fill", "wrap")

Pool = list[jax.Array]


def tame(x: jax.Array) -> jax.Array:
    """Eighths up to 64, rounded where no simple number is halfway; NaN and infinities stay."""
    near = jnp.clip(jnp.floor(x * 8 + 0.3) / 8, -64, 64)
    return jnp.where(jnp.isfinite(x), near, x)


class Writer:
    """Writes one block of a program with its own random choices."""

    def __init__(self, seed: int, pool: Sequence[jax.Array], depth: int = 0):
        self.rng = np.random.default_rng(seed)
        self.pool: Pool = list(pool)
        self.depth = depth

    def one_of(self, several: Sequence):
        return several[int(self.rng.integers(len(several)))]

    def below(self, number: int) -> int:
        return int(self.rng.integers(number))

    def seed(self) -> int:
        return self.below(2**31)

    def any(self, types: Sequence[str] = TYPES, shape: tuple[int, ...] | None = None) -> jax.Array:
        """Something that there is already, new things more often, as one of these types."""
        i = len(self.pool) - 1 - min(self.below(len(self.pool)), self.below(len(self.pool)))
        x = self.pool[i]
        if x.dtype.name not in types:
            x = as_type(x, self.one_of(types))
        return x if shape is None else shaped(x, shape)

    def pair(self, types: Sequence[str]) -> tuple[jax.Array, jax.Array]:
        x = self.any(types)
        return x, self.like(x)

    def like(self, x: jax.Array) -> jax.Array:
        y = self.any((x.dtype.name,), x.shape)
        if self.below(6) == 0:
            y = jnp.full(x.shape, self.constant(x.dtype.name), x.dtype)
        return y

    def constant(self, name: str):
        dtype = np.dtype(name)
        if dtype.kind == "f":
            return self.one_of([0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -3.25, np.inf, np.nan])
        if dtype.kind == "b":
            return bool(self.below(2))
        info = np.iinfo(dtype)
        return self.one_of([0, 1, 2, 3, info.min, info.max, info.max // 2, max(info.min, -1)])

    def index(self) -> jax.Array:
        """A number of any integer type, in range mostly."""
        x = self.any((*SIGNED, *UNSIGNED), ())
        return x % 7 - (self.below(3) if x.dtype.name in SIGNED else 0) if self.below(3) else x

    def truth(self) -> jax.Array:
        return self.any(("bool",), ())

    def vector(self, types: Sequence[str] = TYPES) -> jax.Array:
        return self.any(types, self.one_of([(3,), (5,), (4,)]))

    def write(self, steps: int) -> None:
        """So many steps, each of which adds what it gives."""
        for _ in range(steps):
            nests = self.below(3 + 7 * self.depth) == 0 and self.depth < 2
            found = self.one_of(NESTED if nests else PLAIN)(self)
            self.pool += [jnp.asarray(x) for x in jax.tree.leaves(found)][-3:]

    def block(self, steps: int, wanted: Sequence[jax.Array]) -> Callable[..., list[jax.Array]]:
        """A function of further values that gives new ones of the same kinds as `wanted`."""
        seed, outer, depth = self.seed(), list(self.pool), self.depth + 1

        def function(*values) -> list[jax.Array]:
            inner = Writer(seed, [*outer, *jax.tree.leaves(values)], depth)
            inner.write(steps)
            return [inner.any((x.dtype.name,), x.shape) for x in wanted]

        return function


def as_type(x: jax.Array, name: str) -> jax.Array:
    """Another type, on the grid."""
    y = x.astype(name)
    return tame(y) if name in FLOATS else y


def shaped(x: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """The elements in another shape, from the first again where there are too few."""
    size = int(np.prod(shape))
    if not x.shape:
        return lax.broadcast(x, shape)
    flat = lax.reshape(x, (x.size,))
    if size > x.size:
        flat = lax.concatenate([flat] * (-(-size // x.size)), 0)
    return lax.reshape(lax.slice(flat, (0,), (size,)), shape)


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
    return lax.clamp(y, x, w.like(x)) if x.dtype != bool else x ^ y


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


def _product(w: Writer):
    name = w.one_of([*FLOATS, "int8", "int32", "uint64"])
    x, y = w.any((name,), (2, 3)), w.any((name,), (3,))
    found = w.one_of([lambda: x @ y, lambda: x @ x.T, lambda: jnp.vdot(y, x[1]),
                      lambda: jnp.einsum("ij,j->ij", x, y), lambda: jnp.convolve(y, x[0]),
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


def _cond(w: Writer):
    wanted = [w.any(), w.any()]
    branches = [w.block(2, wanted), w.block(1, wanted)]
    return lax.cond(w.truth(), *branches, *wanted)


def _switch(w: Writer):
    wanted = [w.any(), w.any()]
    branches = [w.block(steps, wanted) for steps in (0, 1, 2)]
    return lax.switch(w.any(("int32", "int8", "uint32"), ()), branches, *wanted)


def _while(w: Writer):
    carry = [w.any(), w.any()]
    count, body, ask = w.any(("int32",), ()) & 3, w.block(2, carry), w.block(1, [w.truth()])
    uniform = w.below(3) == 0

    def going(state):
        i, *values = state
        more = ask(*values)[0] if w.depth < 1 else True
        return i < 3 if uniform else (i < count) & more

    return lax.while_loop(going, lambda s: [s[0] + 1, *body(*s[1:])], [0, *carry])[1:]


def _for(w: Writer):
    carry = [w.any(), w.any()]
    body = w.block(2, carry)
    last = w.one_of([3, w.any(("int32",), ()) & 3])
    return lax.fori_loop(0, last, lambda i, s: body(*s, jnp.asarray(i)), carry)


def _scan(w: Writer):
    carry, out = [w.any(), w.any()], [w.any(shape=()), w.any()]
    length = w.one_of([1, 3, 5, 20])
    rows, body = w.any(shape=(length,)), w.block(2, [*carry, *out])

    def step(state, row):
        found = body(*state, row)
        return found[:2], found[2:]

    state, stacked = lax.scan(step, carry, rows, reverse=bool(w.below(2)))
    return *state, *(x[:3] for x in stacked)


def _jit(w: Writer):
    x = w.any()
    called = jax.jit(lambda *args: w_block(*args)[0])
    w_block = w.block(2, [x])
    return called(called(x))


def _vmap(w: Writer):
    x = w.vector()
    body = w.block(2, [w.any(), x[0]])
    return jax.vmap(lambda one: body(one))(x)


def _map(w: Writer):
    x = w.vector()
    body = w.block(2, [x[0]])
    return lax.map(lambda one: body(one)[0], x)


@jax.custom_jvp
def _bent(x):
    return jnp.abs(x)


_bent.defjvp(lambda primals, tangents: (_bent(*primals), 3.0 * tangents[0]))


@jax.custom_vjp
def _bowed(x):
    return x * x


_bowed.defvjp(lambda x: (_bowed(x), x), lambda x, g: (g * 2.5 * x,))


SMOOTH: list[Callable] = [
    jnp.sin, jnp.tanh, jnp.square, jnp.exp, jnp.cumsum, jnp.sort, _bent,
    lambda x: jnp.where(x > 0, x, -2 * x), lambda x: x / (1 + x * x), lambda x: x[::-1] * x,
    lambda x: jnp.maximum(x, 0.5), lambda x: x[jnp.array([0, 0, 2])] + x,
    lambda x: lax.fori_loop(0, 2, lambda i, y: y * 0.5 + x[i], x), jax.jit(jnp.cos),
    lambda x: lax.scan(lambda c, r: (c * r, c + r), x[0], x)[1], jax.vmap(lambda x: x * x + 1),
    lambda x: lax.cond(x[0] > 1, jnp.cos, jnp.sin, x),
]  # fmt: skip


def _smooth(w: Writer, several: Sequence[Callable]) -> Callable:
    """A function of a vector that has derivatives, made of two."""
    first, second = w.one_of(several), w.one_of(several)
    return lambda x: second(jnp.clip(first(x), -3, 3))


def _derivative(w: Writer):
    x = jnp.clip(jnp.nan_to_num(w.any(("float64",), (3,))), -4, 4)
    forwards = w.below(2)
    function = _smooth(w, SMOOTH if forwards else [*SMOOTH, _bowed, _bowed])
    total = lambda x: function(x).sum()  # noqa: E731
    if forwards:
        tangent = jnp.nan_to_num(w.any(("float64",), (3,)))
        found = w.one_of([
            lambda: jax.jacfwd(function)(x)[1], lambda: jax.jvp(function, (x,), (tangent,)),
            lambda: jax.hessian(total)(x)[0], lambda: jax.linearize(function, x)[1](tangent),
        ])()  # fmt: skip
        return jax.tree.map(tame, found)
    found = w.one_of([
        lambda: jax.grad(total)(x), lambda: jax.jacrev(function)(x)[0],
        lambda: jax.vjp(function, x)[1](x)[0], lambda: jax.value_and_grad(total)(x),
        lambda: jax.grad(jax.checkpoint(total))(x),
    ])()  # fmt: skip
    return jax.tree.map(tame, found)


NESTED = [_cond, _switch, _while, _for, _scan, _jit, _vmap, _map, _derivative]


def program(seed: int, steps: int = 4) -> Callable[[dict, dict], list[jax.Array]]:
    """The program of a seed: a function of one case and of what all cases share."""

    def function(case: dict, shared: dict) -> list[jax.Array]:
        first = [jnp.asarray(x) for x in (*jax.tree.leaves(shared), *jax.tree.leaves(case))]
        writer = Writer(seed, first)
        writer.write(steps)
        return writer.pool[len(first) :]

    return function


def inputs(count: int, seed: int = 0) -> tuple[dict, dict]:
    """Inputs of many cases, and of all: grid points, ends of types, NaN and infinities."""
    rng = np.random.default_rng(seed)

    def numbers(name: str, *shape: int) -> np.ndarray:
        dtype = np.dtype(name)
        if dtype.kind == "b":
            return rng.random(shape) < 0.5
        rare = rng.random(shape) < 0.15
        if dtype.kind == "f":
            usual = rng.integers(-80, 80, shape) / 8
            odd = rng.choice([np.nan, np.inf, -np.inf, 0.0, -0.0, 64.0], shape)
            return np.where(rare, odd, usual).astype(dtype)
        info = np.iinfo(dtype)
        ends = rng.choice(np.array([info.min, info.max, info.max // 2 + 1], dtype), shape)
        low = -9 if dtype.kind == "i" else 0
        return np.where(rare, ends, rng.integers(low, 12, shape).astype(dtype))

    shapes = {"float64": (4,), "float32": (2,)}
    case = {name: numbers(name, count, *shapes.get(name, ())) for name in dict.fromkeys(TYPES)}
    shared = {name: numbers(name) for name in ("float64", "int32", "bool")}
    return case, {name: np.asarray(x) for name, x in shared.items()}
