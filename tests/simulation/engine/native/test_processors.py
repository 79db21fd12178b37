"""Machine code for older processors than this one, and for 32-bit floats."""

import platform

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from compiler.user_programs import SUBJECTS, arguments
from jaxsat.compiler import Mapped
from jaxsat.compiler.llvm.target import host, named

CASES = 37
NAMES = ("x86-64", "x86-64-v3")


def _can_run(name: str) -> bool:
    needed = {"x86-64": 16, "x86-64-v3": 32}[name]
    return platform.machine() in ("x86_64", "AMD64") and host().register >= needed


def _check(function, cases, name: str) -> None:
    """Bits of the interpreter where nothing can be fused, else its numbers."""
    if not _can_run(name):
        pytest.skip(f"this processor is no {name}")
    mapped = Mapped(function, jax.tree.map(lambda x: x[0], cases), cpu=named(name))
    register = "%xmm" if name == "x86-64" else "%ymm"
    assert register in mapped.assembly()
    assert "%zmm" not in mapped.assembly()
    found, expected = mapped(cases), mapped.interpreted(cases)
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        if name == "x86-64":
            np.testing.assert_array_equal(x, y)
        else:
            np.testing.assert_allclose(x, y, rtol=1e-11, atol=1e-13)


def _pendulum(x, shared):
    """Roots, roundings, gathers by lane, and a loop whose lanes end at different times."""
    del shared
    table = jnp.linspace(0.0, 1.0, 40)
    swung = lax.while_loop(lambda y: jnp.abs(y) < 9, lambda y: 1.5 * y + jnp.sin(y) + 0.1, x)
    parts = jnp.floor(swung), jnp.round(swung), jnp.fmod(swung, 0.7), jnp.trunc(swung)
    return parts, table[jnp.abs(swung).astype(jnp.int32) % 40], jnp.sort(jnp.stack([x, swung]))


@pytest.mark.parametrize("name", NAMES)
def test_older_processors_give_the_same_numbers(name):
    _check(_pendulum, np.linspace(0.1, 5.0, CASES), name)


@pytest.mark.slow
@pytest.mark.parametrize("subject", SUBJECTS)
def test_the_oldest_processor_gives_the_same_numbers_of_everything(subject):
    """Nothing is fused there, so that the bits are those of the interpreter."""
    programs = SUBJECTS[subject]
    cases = {key: arguments(letters, CASES) for key, (letters, _) in programs.items()}

    def all_of_them(case, shared):
        del shared
        return {key: function(*case[key]) for key, (_, function) in programs.items()}

    _check(all_of_them, cases, NAMES[0])


def test_32_bit_floats_need_no_64_bit_numbers():
    def function(case, shared):
        x, n = case
        moved = lax.fori_loop(0, n, lambda i, y: 0.5 * y + jnp.cos(x) * shared, x)
        return moved, jnp.exp(x), x**2, jnp.stack([x, moved]) @ jnp.ones(2), n + 1

    rng = np.random.default_rng(0)
    cases = rng.normal(size=CASES).astype(np.float32), rng.integers(0, 9, CASES).astype(np.int32)
    shared = np.float32(0.3)
    with jax.enable_x64(False):
        mapped = Mapped(function, (cases[0][0], cases[1][0]), shared)
        expected = jax.vmap(lambda case: function(case, shared))(cases)
        expected = jax.tree.map(np.asarray, expected)
    for found in (mapped(cases, shared), mapped.interpreted(cases, shared)):
        for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            assert x.dtype == y.dtype
            np.testing.assert_allclose(x, y, rtol=3e-6)
