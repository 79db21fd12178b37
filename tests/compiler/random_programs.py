"""Random programs of one trajectory, as data that hypothesis can draw and shrink.

A program is a list of steps `(name, numbers)`. It works on a pool of values by kind: "f" floats,
"i" and "u" 32-bit integers, "l" 64-bit ones, "b" bools, "v" vectors of four floats. A number picks
an operand of the kind a step asks for, counted from the newest, so that any numbers make a program.

All floats are quarters of size up to 1024, or infinite, or NaN. Arithmetic on them is exact, fused
or not, so two engines must agree in every bit, through every comparison and branch. Quotients and
elementary functions are rounded to the nearest quarter, whose cell's ends they do not come near.
"""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st
from jax import lax

SIZE = 4
MATRIX = np.array([[1, 0, -1, 2], [0.5, 1, 0, 0], [0, -2, 1, 1], [1, 1, 1, -0.5]])
FAR = np.arange(45.0).reshape(9, 5) / 4.0
INSIDE = 3


def quarters(x):
    """The floats that programs may hold."""
    return lax.clamp(-1024.0, jnp.floor(4.0 * x) * 0.25, 1024.0)


def _nearest(x):
    return jnp.floor(4.0 * x + 0.5) * 0.25


def _vector(pool, a, b, c):
    parts = [pick(pool, "f", n) for n in (a, b, c, a + b)]
    return jnp.stack(parts)


def pick(pool, kind, number):
    """An operand, counted from the newest."""
    values = pool[kind]
    return values[-1 - number % len(values)]


def _index(pool, a):
    return pick(pool, "i", a) % SIZE


def _rolled_slice(v, i):
    return lax.dynamic_slice(jnp.concatenate([v, v]), (i,), (SIZE,))


# What a step does: the kind of its result, the kinds of its operands, the function.
STEPS = {
    "add": ("f", "ff", lambda x, y: x + y),
    "sub": ("f", "ff", lambda x, y: x - y),
    "mul": ("f", "ff", lambda x, y: x * y),
    "mul_add": ("f", "fff", lambda x, y, z: x * y + z),
    "max": ("f", "ff", jnp.maximum),
    "min": ("f", "ff", jnp.minimum),
    "neg": ("f", "f", lambda x: -x),
    "abs": ("f", "f", jnp.abs),
    "floor": ("f", "f", jnp.floor),
    "ceil": ("f", "f", jnp.ceil),
    "round": ("f", "f", jnp.round),
    "sign": ("f", "f", jnp.sign),
    "square": ("f", "f", jnp.square),
    "cube": ("f", "f", lambda x: quarters(x) ** 3),
    "mod": ("f", "ff", lambda x, y: jnp.mod(x, jnp.abs(y) + 0.25)),
    "rem": ("f", "ff", lambda x, y: lax.rem(x, y)),
    "sqrt": ("f", "f", lambda x: jnp.floor(jnp.sqrt(jnp.abs(x)))),
    "select": ("f", "bff", jnp.where),
    "div": ("f", "ff", lambda x, y: x / y),
    "inverse": ("f", "f", lambda x: _nearest(1.0 / x)),
    "sin": ("f", "f", lambda x: _nearest(4.0 * jnp.sin(x))),
    "cos": ("f", "f", lambda x: _nearest(4.0 * jnp.cos(x))),
    "tanh": ("f", "f", lambda x: _nearest(4.0 * jnp.tanh(x))),
    "exp": ("f", "f", lambda x: _nearest(jnp.exp(x / 64.0))),
    "log": ("f", "f", lambda x: _nearest(jnp.log(jnp.abs(x) + 0.25))),
    "log1p": ("f", "f", lambda x: _nearest(jnp.log1p(jnp.abs(x)))),
    "atan2": ("f", "ff", lambda x, y: _nearest(jnp.arctan2(x, y))),
    "asinh": ("f", "f", lambda x: _nearest(4.0 * jnp.arcsinh(x))),
    "acos": ("f", "f", lambda x: _nearest(4.0 * jnp.arccos(x / 1024.0))),
    "erf": ("f", "f", lambda x: _nearest(8.0 * lax.erf(x / 4.0))),
    "cbrt": ("f", "f", lambda x: _nearest(jnp.cbrt(x))),
    "pow": ("f", "ff", lambda x, y: _nearest((jnp.abs(x) + 0.25) ** lax.clamp(-2.0, y, 2.0))),
    "clamp": ("f", "fff", lambda x, y, z: lax.clamp(jnp.minimum(x, z), y, jnp.maximum(x, z))),
    "float_of_int": ("f", "i", lambda x: (x % 256).astype(float)),
    "float_of_unsigned": ("f", "u", lambda x: (x >> np.uint32(22)).astype(float)),
    "float_of_long": ("f", "l", lambda x: (x >> 50).astype(float)),
    "float_of_bool": ("f", "b", lambda x: x.astype(float)),
    "single": ("f", "f", lambda x: x.astype(jnp.float32).astype(float)),
    "dot": ("f", "vv", lambda x, y: quarters(x) @ quarters(y)),
    "sum": ("f", "v", jnp.sum),
    "largest": ("f", "v", jnp.max),
    "smallest": ("f", "v", jnp.min),
    "prod": ("f", "v", lambda v: jnp.prod(lax.clamp(-16.0, v, 16.0))),
    "third": ("f", "v", lambda v: v[2]),
    "element": ("f", "vi", lambda v, i: v[i % SIZE]),
    "element_beyond": ("f", "vi", lambda v, i: v.at[i].get(mode="clip")),
    "corner": ("f", "vii", lambda v, i, j: v.reshape(2, 2)[i % 2, j % 2]),
    "far_table": ("f", "ii", lambda i, j: jnp.asarray(FAR)[i % 9, j % 5]),
    "norm": ("f", "v", lambda v: jnp.sum(jnp.abs(v) * v)),
    "i_add": ("i", "ii", lambda x, y: x + y),
    "i_sub": ("i", "ii", lambda x, y: x - y),
    "i_mul": ("i", "ii", lambda x, y: x * y),
    "i_div": ("i", "ii", lambda x, y: lax.div(x, y)),
    "i_rem": ("i", "ii", lambda x, y: lax.rem(x, y)),
    "i_floor_mod": ("i", "ii", lambda x, y: jnp.mod(x, jnp.abs(y % 1000) + 1)),
    "i_max": ("i", "ii", jnp.maximum),
    "i_abs": ("i", "i", jnp.abs),
    "i_neg": ("i", "i", lambda x: -x),
    "i_sign": ("i", "i", jnp.sign),
    "i_and": ("i", "ii", lambda x, y: x & y),
    "i_or": ("i", "ii", lambda x, y: x | y),
    "i_not": ("i", "i", lambda x: ~x),
    "i_left": ("i", "ii", lambda x, y: lax.shift_left(x, y % 40)),
    "i_right": ("i", "ii", lambda x, y: lax.shift_right_arithmetic(x, y % 40)),
    "i_logical": ("i", "ii", lambda x, y: lax.shift_right_logical(x, y % 40)),
    "i_of_float": ("i", "f", lambda x: x.astype(jnp.int32)),
    "i_of_bool": ("i", "b", lambda x: x.astype(jnp.int32)),
    "i_of_long": ("i", "l", lambda x: x.astype(jnp.int32)),
    "i_of_unsigned": ("i", "u", lambda x: x.astype(jnp.int32)),
    "i_select": ("i", "bii", jnp.where),
    "i_count": ("i", "i", lax.population_count),
    "argmax": ("i", "v", lambda v: jnp.argmax(v).astype(jnp.int32)),
    "argmin": ("i", "v", lambda v: jnp.argmin(v).astype(jnp.int32)),
    "how_many": ("i", "vf", lambda v, x: jnp.sum(v > x[None]).astype(jnp.int32)),
    "i_table": ("i", "i", lambda i: jnp.asarray(np.arange(7, dtype=np.int32) ** 2)[i % 7]),
    "u_add": ("u", "uu", lambda x, y: x + y),
    "u_mul": ("u", "uu", lambda x, y: x * y),
    "u_rotate": ("u", "u", lambda x: (x << np.uint32(13)) | (x >> np.uint32(19))),
    "u_xor": ("u", "uu", lambda x, y: x ^ y),
    "u_of_int": ("u", "i", lambda x: lax.bitcast_convert_type(x, jnp.uint32)),
    "u_of_float": ("u", "f", lambda x: x.astype(jnp.uint32)),
    "u_div": ("u", "uu", lambda x, y: lax.div(x, y)),
    "u_min": ("u", "uu", jnp.minimum),
    "l_of_int": ("l", "i", lambda x: x.astype(jnp.int64)),
    "l_mul": ("l", "ll", lambda x, y: x * y),
    "l_sub": ("l", "ll", lambda x, y: x - y),
    "l_of_float": ("l", "f", lambda x: (x * 2.0**40).astype(jnp.int64)),
    "l_of_unsigned": ("l", "u", lambda x: x.astype(jnp.int64)),
    "l_shift": ("l", "li", lambda x, y: x >> (y % 64).astype(jnp.int64)),
    "less": ("b", "ff", lambda x, y: x < y),
    "equal": ("b", "ff", lambda x, y: x == y),
    "at_least": ("b", "ff", lambda x, y: x >= y),
    "differs": ("b", "ff", lambda x, y: x != y),
    "i_less": ("b", "ii", lambda x, y: x < y),
    "u_less": ("b", "uu", lambda x, y: x < y),
    "l_less": ("b", "ll", lambda x, y: x <= y),
    "nan": ("b", "f", jnp.isnan),
    "finite": ("b", "f", jnp.isfinite),
    "and": ("b", "bb", jnp.logical_and),
    "or": ("b", "bb", jnp.logical_or),
    "xor": ("b", "bb", jnp.logical_xor),
    "not": ("b", "b", jnp.logical_not),
    "any": ("b", "v", lambda v: jnp.any(v > 1.0)),
    "all": ("b", "v", lambda v: jnp.all(v < 1.0)),
    "odd": ("b", "i", lambda x: x % 2 == 1),
    "stack": ("v", "fff", lambda x, y, z: jnp.stack([x, y, z, x])),
    "v_add": ("v", "vv", lambda x, y: x + y),
    "v_mul": ("v", "vv", lambda x, y: x * y),
    "v_scale": ("v", "vf", lambda x, y: x * y),
    "v_where": ("v", "vvf", lambda x, y, z: jnp.where(x > z, x, y)),
    "v_sort": ("v", "v", jnp.sort),
    "v_order": ("v", "vv", lambda x, y: y[jnp.argsort(x)]),
    "v_cumsum": ("v", "v", jnp.cumsum),
    "v_cummax": ("v", "v", lax.cummax),
    "v_reverse": ("v", "v", lambda v: v[::-1]),
    "v_roll": ("v", "v", lambda v: jnp.roll(v, 1)),
    "v_slide": ("v", "vi", lambda v, i: _rolled_slice(v, i % SIZE)),
    "v_set": ("v", "vif", lambda v, i, x: v.at[i % SIZE].set(x)),
    "v_set_static": ("v", "vf", lambda v, x: v.at[1].add(x)),
    "v_add_at": ("v", "vif", lambda v, i, x: v.at[i % SIZE].add(x)),
    "v_take": ("v", "vi", lambda v, i: v[(i + jnp.arange(SIZE, dtype=jnp.int32)) % SIZE]),
    "v_matrix": ("v", "v", lambda v: jnp.asarray(MATRIX) @ quarters(v)),
    "v_outer": ("v", "vv", lambda x, y: jnp.sum(jnp.outer(quarters(x), quarters(y)), axis=0)),
    "v_square": ("v", "v", lambda v: (quarters(v).reshape(2, 2) @ MATRIX[:2, :2]).reshape(SIZE)),
    "v_row": ("v", "vi", lambda v, i: jnp.tile(v.reshape(2, 2)[i % 2], 2)),
    "v_turn": ("v", "v", lambda v: v.reshape(2, 2).T.reshape(SIZE)),
    "v_pad": ("v", "v", lambda v: lax.pad(v, jnp.asarray(0.5), [(1, -1, 0)])),
    "v_cross": ("v", "vv", lambda x, y: jnp.append(jnp.cross(x[:3], y[:3]), x[3])),
    "v_max": ("v", "vf", jnp.maximum),
}
CONTROL = ("cond", "switch", "while", "fori", "scan", "scan_back", "table", "jit")
KINDS = "fiulbv"


def run(program, pool):
    """The pool after a program."""
    pool = {kind: list(values) for kind, values in pool.items()}
    for name, numbers, *inner in program:
        if name in CONTROL:
            for kind, value in zip("fiv", _control(name, numbers, inner, pool), strict=True):
                pool[kind].append(_tame(kind, value))
            continue
        kind, operands, function = STEPS[name]
        with jax.numpy_rank_promotion("allow"):
            args = [pick(pool, k, n) for k, n in zip(operands, numbers, strict=False)]
            pool[kind].append(_tame(kind, function(*args)))
    return pool


def newest(pool):
    """What a program gives: the newest of each kind."""
    return {kind: pool[kind][-1] for kind in KINDS}


def _tame(kind, value):
    return quarters(value) if kind in "fv" else value


def _inner(program, pool, carry):
    """A program inside another's loop or branch: the newest float, integer and vector."""
    extended = {k: list(v) for k, v in pool.items()}
    for kind, value in zip("fiv", carry, strict=True):
        extended[kind].append(value)
    after = run(program, extended)
    return tuple(after[kind][-1] for kind in "fiv")


def _control(name, numbers, inner, pool):
    a, b, c = numbers[:3]
    carry = tuple(pick(pool, kind, n) for kind, n in zip("fiv", (a, b, c), strict=True))
    first, second, third = inner
    work = [lambda carry, p=p: _inner(p, pool, carry) for p in (first, second, third)]
    match name:
        case "cond":
            return lax.cond(pick(pool, "b", a), *work[:2], carry)
        case "switch":
            return lax.switch(pick(pool, "i", b) % 5 - 1, work, carry)
        case "jit":
            return jax.jit(work[0])(carry)
        case "fori":
            return lax.fori_loop(0, 1 + a % 9, lambda _, carry: work[0](carry), carry)
        case "while":
            return _while(work[0], second, pool, carry, a)
        case "table":
            rows = jnp.asarray(np.arange(80.0).reshape(20, SIZE) / 4)
            return carry[0], carry[1], quarters(rows[carry[1] % 20] + carry[2])
    return _scan(work[0], carry, a, name == "scan_back")


def _while(work, stop, pool, carry, a):
    """Until the number of turns, which may differ between cases, or a bool says so."""
    turns = pick(pool, "i", a) % 7

    def going(state):
        count, carry = state
        inner = {k: list(v) for k, v in pool.items()}
        for kind, value in zip("fiv", carry, strict=True):
            inner[kind].append(value)
        return (count < turns) & ~run(stop, inner)["b"][-1]

    return lax.while_loop(going, lambda state: (state[0] + 1, work(state[1])), (0, carry))[1]


def _scan(work, carry, a, reverse):
    """Along a table of numbers, the results of each turn stacked."""
    length = (1, 3, 20, 40)[a % 4]
    xs = jnp.asarray(np.arange(length * 2.0).reshape(length, 2) % 7 - 3)

    def turn(carry, x):
        f, i, v = carry
        f, i, v = work((f + x[0], i + 1, v * x[1]))
        f, v = quarters(f), quarters(v)
        return (f, i, v), (f, v[1] + x[1])

    carry, (fs, vs) = lax.scan(turn, carry, xs, reverse=reverse)
    at = carry[1] % length
    return quarters(fs[at] + vs[0]), carry[1], quarters(carry[2] + jnp.max(vs))


_numbers = st.tuples(*[st.integers(0, 6)] * 3)


def _step(inner):
    plain = st.tuples(st.sampled_from(sorted(STEPS)), _numbers)
    if inner is None:
        return plain
    control = st.tuples(st.sampled_from(CONTROL), _numbers, inner, inner, inner)
    return st.one_of(plain, plain, control)


_leaf = st.lists(_step(None), max_size=INSIDE)
_middle = st.lists(_step(_leaf), max_size=INSIDE)
programs = st.lists(_step(_middle), min_size=1, max_size=10)
