"""What people write in `jax.numpy` for one trajectory, by subject: a function and its arguments.

Letters stand for arguments: x, y, z numbers; u from -0.95 to 0.95; p positive; v, w vectors of
three; q of four; r of six; m, n 3x3 matrices; i a small whole number; j three of them; k the two
words of a random key.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax, nn, random
from jax.scipy import linalg, special

SHAPES = {"v": (3,), "w": (3,), "q": (4,), "r": (6,), "m": (3, 3), "n": (3, 3), "j": (3,)}
# fmt: off
PLAIN_NAMES = (
    "asinh", "atan", "cbrt", "cos", "cosh", "erf", "erfc", "exp", "exp2", "expm1", "is_finite",
    "logistic", "sin", "sinh", "tan", "tanh", "sign", "floor", "ceil", "round", "square",
)
UNIT_NAMES = ("acos", "asin", "atanh", "erf_inv", "log1p")
NETWORK_NAMES = (
    "celu", "elu", "gelu", "hard_tanh", "leaky_relu", "log_sigmoid", "log_softmax", "logsumexp",
    "mish", "relu", "relu6", "sigmoid", "silu", "softmax", "softplus", "soft_sign",
)
SPECIAL_NAMES = ("entr", "erf", "erfc", "expit", "log_ndtr", "ndtr")
# fmt: on
TABLE = np.linspace(-1.0, 1.0, 9)


def arguments(letters: str, count: int) -> list[np.ndarray]:
    """Arguments of `count` cases."""
    return [_argument(letter, count) for letter in letters]


def _argument(letter: str, count: int) -> np.ndarray:
    rng = np.random.default_rng(ord(letter))
    shape = (count, *SHAPES.get(letter, ()))
    match letter:
        case "k":
            return rng.integers(0, 2**32, (count, 2)).astype(np.uint32)
        case "i" | "j":
            return rng.integers(0, 5, shape).astype(np.int32)
        case "u":
            return rng.uniform(-0.95, 0.95, shape)
        case "p":
            return rng.uniform(0.1, 2.0, shape)
    return rng.normal(size=shape)


def _positive(m):
    return m @ m.T + jnp.eye(3)


def _inverse(m):
    """By cross products."""
    columns = [jnp.cross(m[1], m[2]), jnp.cross(m[2], m[0]), jnp.cross(m[0], m[1])]
    return jnp.stack(columns, axis=1) / jnp.dot(m[0], columns[0])


def _turned(q, v):
    """A vector turned by a quaternion, scalar last."""
    q = q / jnp.linalg.norm(q)
    return v + 2 * jnp.cross(q[:3], jnp.cross(q[:3], v) + q[3] * v)


def _tumble(v):
    inertia = jnp.diag(jnp.array([1.0, 2.0, 3.0]))

    def rate(omega):
        return jnp.linalg.solve(inertia, -jnp.cross(omega, inertia @ omega))

    def step(omega, _):
        a = rate(omega)
        b = rate(omega + 0.05 * a)
        return omega + 0.1 * b, jnp.linalg.norm(omega)

    return lax.scan(step, v, None, length=20)


def _buffer(x):
    """The oldest of eight numbers kept in a ring."""
    return lax.scan(
        lambda c, t: (c.at[t % 8].set(t * x), c[(t + 1) % 8]), jnp.zeros(8), jnp.arange(20)
    )[1]


def _typed(draw):
    return lambda k: draw(random.wrap_key_data(k))


@jax.custom_vjp
def _bent(x):
    return jnp.sin(x)


_bent.defvjp(lambda x: (jnp.sin(x), x), lambda x, g: (3 * g * jnp.cos(x),))

KEY, WIDE = random.key(5), np.arange(484.0).reshape(22, 22)

ELEMENTARY = {
    name: ("x", getattr(lax, name))
    for name in [
        "asinh",
        "atan",
        "cbrt",
        "cos",
        "cosh",
        "erf",
        "erfc",
        "exp",
        "exp2",
        "expm1",
        "is_finite",
        "logistic",
        "sin",
        "sinh",
        "tan",
        "tanh",
        "sign",
        "floor",
        "ceil",
        "round",
        "square",
    ]
}
ELEMENTARY |= {name: ("u", getattr(lax, name)) for name in UNIT_NAMES}
ELEMENTARY |= {
    "acosh": ("p", lambda p: lax.acosh(1 + p)),
    "logarithms": ("p", lambda p: (jnp.log(p), jnp.log2(p), jnp.log10(p), lax.rsqrt(p))),
    "powers": ("x", lambda x: [lax.integer_pow(x, n) for n in (-5, -1, 0, 1, 2, 3, 7, 31)]),
    "pow": ("pxi", lambda p, x, i: (p**x, x**i, jnp.power(i, 3), jnp.float_power(p, x))),
    "two": ("px", lambda p, x: (jnp.hypot(p, x), jnp.logaddexp(p, x), jnp.copysign(p, x))),
    "remainders": ("px", lambda p, x: (x % p, jnp.fmod(x, p), x // p, *jnp.divmod(x, p))),
    "parts": ("x", lambda x: (*jnp.modf(x), *jnp.frexp(x), jnp.ldexp(x, 3), jnp.round(x, 2))),
    "next": ("xy", lambda x, y: (jnp.nextafter(x, y), jnp.nextafter(jnp.zeros_like(x), y))),
    "coarser": ("x", lambda x: [lax.reduce_precision(x, *n) for n in ((8, 23), (5, 10), (11, 3))]),
    "bits": ("i", lambda i: (lax.clz(i), lax.population_count(i), ~i, i << 2, i >> 1)),
}
ARRAYS = {
    "products": ("mnv", lambda m, n, v: (m @ n, m @ v, jnp.outer(v, v), jnp.trace(m), v @ m @ v)),
    "einsum": ("mnv", lambda m, n, v: jnp.einsum("ij,kj,j->ik", m, n, v)),
    "of_bools": ("mv", lambda m, v: (m > 0) @ (v > 0)),
    "mapped_products": ("mn", lambda m, n: jax.vmap(jnp.dot)(m, n)),
    "norms": ("vm", lambda v, m: [jnp.linalg.norm(v, a) for a in (None, 1, jnp.inf)] + [m.std()]),
    "cross": ("vwq", lambda v, w, q: (jnp.cross(v, w), _turned(q, v))),
    "along": ("r", lambda r: (jnp.cumsum(r), jnp.cumprod(r), lax.cummax(r), lax.cummin(r))),
    "cumlogsumexp": ("r", lambda r: (lax.cumlogsumexp(r), lax.cumlogsumexp(r, reverse=True))),
    "order": ("r", lambda r: (jnp.sort(r), jnp.argsort(r), jnp.argsort(r, descending=True))),
    "top_k": ("r", lambda r: lax.top_k(r, 3)),
    "middle": ("r", lambda r: (jnp.median(r), jnp.quantile(r, 0.3), jnp.argmax(r), jnp.ptp(r))),
    "ends": ("r", lambda r: (lax.pad(r, 0.0, [(2, -1, 1)]), jnp.pad(r, 2, mode="wrap"))),
    "moved": (
        "rim",
        lambda r, i, m: (jnp.roll(r, 2), jnp.roll(r, i), jnp.rot90(m), jnp.tile(r, 2)),
    ),
    "choices": ("xi", lambda x, i: lax.select_n(i % 3, x, -x, x * x)),
    "pieces": ("x", lambda x: jnp.piecewise(x, [x < -0.5, x > 0.5], [jnp.sin, jnp.exp, 0.0])),
    "cases": ("x", lambda x: jnp.select([x < -0.5, x > 0.5], [x, x**2], 0.0)),
    "interp": ("x", lambda x: jnp.interp(x, TABLE, TABLE**2, left=-1.0)),
    "search": ("v", lambda v: [jnp.searchsorted(TABLE, v, side=s) for s in ("left", "right")]),
    "search_by_all": ("x", lambda x: jnp.searchsorted(TABLE, x, method="compare_all")),
    "polynomials": ("qx", lambda q, x: (jnp.polyval(q, x), jnp.polyder(q), jnp.polymul(q, q))),
    "convolve": ("rv", lambda r, v: [jnp.convolve(r, v, mode=m) for m in ("full", "same")]),
    "windows": ("r", lambda r: lax.reduce_window(r, 0.0, lax.add, (3,), (2,), "SAME")),
    "highest": ("r", lambda r: lax.reduce_window(r, -np.inf, lax.max, (3,), (1,), "VALID")),
    "own_window": ("r", lambda r: lax.reduce_window(r, 0.0, jnp.hypot, (2,), (1,), "VALID")),
    "own_reduction": ("v", lambda v: lax.reduce(v, 0.0, lambda a, b: a + b * b, (0,))),
    "logic": ("v", lambda v: (jnp.all(v > 0), jnp.any(v > 0), jnp.isclose(v, v), v.argmin())),
    "take": ("rj", lambda r, j: (r[j], jnp.take_along_axis(r, j, 0), r.at[j].add(1.0))),
    "applied": ("v", lambda v: (v.at[1].apply(jnp.sin), v.at[0].multiply(2.0), v.at[2].power(2))),
    "counted": ("j", lambda j: (jnp.bincount(j, length=5), jax.ops.segment_sum(j, j, 5))),
    "unwrap": ("r", lambda r: (jnp.unwrap(4 * r), jnp.trapezoid(r), jnp.diff(r), jnp.gradient(r))),
}
CONTROL = {
    "tumble": ("v", _tumble),
    "buffer": ("x", _buffer),
    "map": ("r", lambda r: lax.map(jnp.sin, r)),
    "associative": ("r", lambda r: lax.associative_scan(jnp.add, r)),
    "products": ("mn", lambda m, n: lax.associative_scan(jnp.matmul, jnp.stack([m, n, m, n, m]))),
    "unrolled": ("x", lambda x: lax.scan(lambda c, t: (c * x + t, c), x, TABLE, unroll=4)),
    "mapped_loop": (
        "v",
        jax.vmap(lambda x: lax.while_loop(lambda c: c < 9, lambda c: jnp.abs(c) * 1.5 + 0.1, x)),
    ),
    "mapped_branch": ("v", jax.vmap(lambda x: lax.cond(x > 0, jnp.sin, jnp.cos, x))),
    "mapped_index": ("rj", lambda r, j: jax.vmap(lambda n: lax.dynamic_index_in_dim(r, n))(j)),
    "gradient": ("x", jax.grad(lambda x: lax.fori_loop(0, 9, lambda _, c: jnp.sin(c), x))),
    "hessian": ("v", jax.hessian(lambda v: jnp.sum(jnp.sin(v) * v[0]))),
    "own_derivative": ("x", jax.grad(_bent)),
    "derivatives": (
        "u",
        lambda u: [
            jax.jvp(f, (u,), (1.0,))
            for f in (lax.erf, jnp.arcsinh, jnp.arctanh, jnp.cbrt, jnp.sinc)
        ],
    ),
}
NETWORKS = {
    name: ("v", getattr(nn, name))
    for name in [
        "celu",
        "elu",
        "gelu",
        "hard_tanh",
        "leaky_relu",
        "log_sigmoid",
        "log_softmax",
        "logsumexp",
        "mish",
        "relu",
        "relu6",
        "sigmoid",
        "silu",
        "softmax",
        "softplus",
        "soft_sign",
    ]
}
NETWORKS |= {name: ("p", getattr(special, name)) for name in SPECIAL_NAMES}
MATRICES = {
    "by_hand": ("m", lambda m: _inverse(_positive(m))),
    "inverse": ("m", lambda m: jnp.linalg.inv(_positive(m))),
    "inverse_2x2": ("m", lambda m: jnp.linalg.inv(_positive(m)[:2, :2])),
    "solve": ("mv", lambda m, v: jnp.linalg.solve(m + 3 * jnp.eye(3), v)),
    "pivots": ("m", linalg.lu_factor),
    "determinant": ("m", lambda m: (jnp.linalg.det(m), *jnp.linalg.slogdet(m))),
    "cholesky": ("m", lambda m: jnp.linalg.cholesky(_positive(m))),
    "by_factor": ("mv", lambda m, v: linalg.cho_solve(linalg.cho_factor(_positive(m)), v)),
    "triangular": ("mv", lambda m, v: linalg.solve_triangular(jnp.tril(m) + 3 * jnp.eye(3), v, 1)),
    "exponential": ("m", lambda m: linalg.expm(0.1 * m)),
    "tangent": ("m", lambda m: jax.jvp(jnp.linalg.inv, (_positive(m),), (m,))),
}
RANDOM = {
    "normal": ("k", lambda k: random.normal(k, (2,))),
    "typed": ("k", _typed(lambda key: random.normal(key, (2,)))),
    "uniform": ("k", _typed(lambda key: random.uniform(key, (2,), minval=-1.0))),
    "bits": ("k", _typed(lambda key: [random.bits(key, (2,), t) for t in ("uint8", "uint64")])),
    "split": ("k", _typed(lambda key: [random.normal(part) for part in random.split(key)])),
    "folded": ("ki", lambda k, i: random.uniform(random.fold_in(random.wrap_key_data(k), i))),
    "seeded": ("i", lambda i: random.uniform(random.key(i))),
    "given": ("i", lambda i: random.uniform(random.fold_in(KEY, i))),
    "chosen": ("i", lambda i: random.uniform(random.split(KEY, 4)[i % 4])),
    "carried": (
        "k",
        _typed(
            lambda key: lax.scan(
                lambda c, _: (random.split(c)[0], random.uniform(c)), key, None, length=30
            )[1]
        ),
    ),
    "along": (
        "k",
        _typed(
            lambda key: lax.scan(
                lambda c, one: (c + random.uniform(one), None), 0.0, random.split(key, 30)
            )[0]
        ),
    ),
    "branches": (
        "ki",
        lambda k, i: random.uniform(
            lax.cond(i > 2, lambda a: random.fold_in(a, 1), lambda a: a, random.wrap_key_data(k))
        ),
    ),
    "others": (
        "k",
        lambda k: (
            random.randint(k, (2,), 0, 10),
            random.bernoulli(k, 0.3),
            random.exponential(k),
            random.permutation(k, 4),
            random.multivariate_normal(k, jnp.zeros(2), jnp.eye(2)),
            random.truncated_normal(k, -1.0, 1.0),
        ),
    ),
}
SUBJECTS = {
    "elementary": ELEMENTARY,
    "arrays": ARRAYS,
    "control": CONTROL,
    "networks": NETWORKS,
    "matrices": MATRICES,
    "random": RANDOM,
}

IMPOSSIBLE = {
    "eigh": ("m", jnp.linalg.eigvalsh),
    "svd": ("m", lambda m: jnp.linalg.svd(m)[1]),
    "complex128": ("x", lambda x: jnp.abs(jnp.exp(1j * x))),
    "float16": ("x", lambda x: x.astype(jnp.float16)),
    "bfloat16": ("x", lambda x: x.astype(jnp.bfloat16)),
    "lgamma": ("p", special.gammaln),
    "random_gamma": ("k", lambda k: random.gamma(k, 2.0)),
    "rbg": ("i", lambda i: random.uniform(random.key(i, impl="rbg"))),
    "pure_callback": ("x", lambda x: jax.pure_callback(np.sin, jax.ShapeDtypeStruct((), float), x)),
    "debug_print": ("x", lambda x: (jax.debug.print("{}", x), x)[1]),
    "dot_general": ("x", lambda x: (x * WIDE) @ (x + WIDE)),
}
