"""What makes two traced programs the same, and what does not."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core import trees
from jaxsat.core.fingerprint import fingerprint
from jaxsat.core.jaxprs import jaxpr_of

X = jnp.array([0.3, -0.7, 1.1])


def of(function, *examples):
    return fingerprint({"program": jaxpr_of(function, *(examples or (X,)))})


def jitted(sign, name="inner"):
    def inner(x):
        return sign * x + jnp.sin(x)

    inner.__name__ = name
    return lambda x: jax.jit(inner)(x) * 2


def scanned(sign, name=None):
    return lambda x: jax.lax.scan(lambda c, y: (c + sign * y, c), 0.0, x)[1]


def looped(sign, name=None):
    return lambda x: jax.lax.while_loop(lambda c: c[0] < 3, lambda c: c + sign * 1.0, x)


def switched(sign, name=None):
    return lambda x: jax.lax.cond(x[0] > 0, lambda y: sign * y, lambda y: y * y, x)


def custom_jvp(sign, name="f"):
    @jax.custom_jvp
    def f(x):
        return sign * x

    f.defjvp(lambda x, t: (f(*x), t[0]))
    f.__name__ = name
    return f


def custom_jvp_rule(sign, name=None):
    @jax.custom_jvp
    def f(x):
        return x

    f.defjvp(lambda x, t: (f(*x), sign * t[0]))
    return lambda x: jax.jvp(f, (x,), (x,))


def custom_vjp(sign, name=None):
    @jax.custom_vjp
    def f(x):
        return sign * x

    f.defvjp(lambda x: (f(x), x), lambda x, t: (t,))
    return f


def batched(sign, name=None):
    return jax.vmap(jitted(sign))


def baked_array(sign, name=None):
    table = sign * np.arange(100.0)
    return lambda x: x + jnp.asarray(table)[:3]


def baked_inside(sign, name=None):
    table = jnp.asarray(sign * np.arange(3.0))
    return jax.jit(lambda x: jax.lax.cond(x[0] > 0, lambda: x + table, lambda: x))


def called_back(sign, name=None):
    kind = jax.ShapeDtypeStruct((3,), X.dtype)
    function = np.negative if sign < 0 else np.positive
    return lambda x: jax.pure_callback(function, kind, x)


def called_back_by_name(sign, name=None):
    kind = jax.ShapeDtypeStruct((3,), X.dtype)
    function = (lambda x: 1.0 * x) if sign > 0 else (lambda x: -1.0 * x)
    return lambda x: jax.pure_callback(function, kind, x)


NESTED = (
    jitted,
    scanned,
    looped,
    switched,
    custom_jvp,
    custom_jvp_rule,
    custom_vjp,
    batched,
    baked_array,
    baked_inside,
    called_back,
    called_back_by_name,
)


@pytest.mark.parametrize("program", NESTED)
def test_a_sign_changes_it_however_deep_and_a_name_does_not(program):
    assert of(program(1.0)) == of(program(1.0, name="other"))
    assert of(program(1.0)) != of(program(-1.0))


def plain(x, gain):
    y = x * gain
    return jnp.where(y > 0, y, 0.5 * y)


def told_otherwise(state, k):
    """The same, as somebody else writes it."""
    product = state * k  # which may be negative
    jax.debug.print("product {}", product)
    half = 0.5
    return trees.apart(jax.jit(jnp.negative), jnp.where(product > 0, product, half * product))


def negated(x, gain):
    return jax.jit(jnp.negative)(plain(x, gain))


def test_names_comments_prints_and_wishes_to_the_compiler_are_no_part_of_it(monkeypatch):
    assert of(negated, X, 2.0) == of(told_otherwise, X, 2.0)
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")  # where nothing is wished
    assert of(negated, X, 2.0) == of(told_otherwise, X, 2.0)


def test_inputs_are_no_part_of_it_and_their_kinds_are():
    assert of(plain, X, 2.0) == of(plain, 2 * X, 3.0)
    assert of(plain, X, 2.0) != of(plain, X[:2], 2.0)
    assert of(plain, X, 2.0) != of(plain, X.astype(jnp.float32), 2.0)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (lambda x: x[0] - x[1], lambda x: x[1] - x[0]),  # which is read is told
        (lambda x: (x[0], x[1]), lambda x: (x[1], x[0])),
        (lambda x: x + 0.0, lambda x: x + -0.0),
        (lambda x: x + 1.0, lambda x: x + (1.0 + 2**-52)),
        (lambda x: jnp.sum(x), lambda x: jnp.max(x)),
        (lambda x: x.reshape(3, 1), lambda x: x.reshape(1, 3)),
        (lambda x: x @ x, lambda x: jnp.matmul(x, x, precision="highest")),
        (
            lambda x: x + jax.random.normal(jax.random.key(1), (3,)),
            lambda x: x + jax.random.normal(jax.random.key(2), (3,)),
        ),
    ],
)
def test_what_else_changes_it(one, other):
    assert of(one) != of(other)
    assert of(one) == of(one)


OF_ALL = """
import jax, sys
jax.config.update("jax_enable_x64", True)
from core import test_fingerprint as tests
print([tests.of(program(1.0)) for program in tests.NESTED])
"""


@pytest.mark.slow
def test_every_process_comes_to_the_same():
    told = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", OF_ALL],
            capture_output=True,
            text=True,
            check=True,
            cwd=os.path.dirname(os.path.dirname(__file__)),
            env=environment,
        )
        told.add(done.stdout.strip())
    assert told == {str([of(program(1.0)) for program in NESTED])}
