"""Steps of random programs that hold others: branches, loops, calls, maps, derivatives."""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
from jax import lax

from compiler.program_writer import Writer, tame


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
