"""Arrays of machine code: on the stack, in the arena, or too large."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from compiler.wrong_arguments import COUNT, narrow
from jaxsat.compiler import CannotLower, Mapped
from jaxsat.compiler.llvm import emitter
from jaxsat.compiler.rules import indexing

STACKED = """
import sys, threading
import jax, jax.numpy as jnp, numpy as np
from jax import lax
jax.config.update("jax_enable_x64", True)
from jaxsat.compiler import CannotLower, Mapped
from jaxsat.compiler.llvm import emitter

rows = int(sys.argv[1])

def function(x, shared):
    last, seen = lax.scan(lambda c, i: (0.5 * c + shared, c + i), x, jnp.arange(float(rows)))
    return last, seen[-1], seen[rows // 2]

x = np.linspace(-1.0, 1.0, 21)
mapped = Mapped(function, x[0], 1.0)
expected = jax.vmap(function, (0, None))(x, 1.0)

def check():
    for found, wanted in zip(mapped(x, 1.0), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-14)
    print("checked")

check()
threading.stack_size(64 << 10)
thread = threading.Thread(target=check)
thread.start()
thread.join()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="has no ulimit")
@pytest.mark.parametrize(("rows", "stack"), [(2_000, "96"), (200_000, "8192")])
def test_large_arrays_and_small_stacks(rows, stack):
    """Python itself does not start with less than some 80 kB."""
    found = subprocess.run(
        ["sh", "-c", f'ulimit -s {stack}; exec "$0" -c "$1" {rows}', sys.executable, STACKED],
        capture_output=True, text=True, check=False, env=os.environ | {"COLUMNS": "80"},
    )  # fmt: skip
    assert found.returncode == 0, found.stderr
    assert found.stdout == "checked\n" * 2


def test_the_stack_holds_little_and_the_arena_has_a_limit(monkeypatch):
    """The same bits from either; nothing is made whose memory or code would be too large."""

    def function(rows):
        def stacked(x, shared):
            seen = lax.scan(lambda c, i: (0.9 * c + shared, c), x, jnp.arange(rows))[1]
            again = lax.scan(lambda c, i: (0.7 * c, c), x, jnp.arange(rows))[1]
            return seen[rows - 1] + again[rows - 2]

        return Mapped(stacked, 0.0, 1.0)

    def in_arena(mapped):
        return mapped.text.count("%arena, i64")

    small, large = function(300), function(3000)
    assert (in_arena(small), in_arena(large)) == (0, 2)
    x = np.linspace(0, 1, 9)
    monkeypatch.setattr(emitter, "ON_STACK", 1 << 20)
    on_stack = function(3000)
    assert in_arena(on_stack) == 0
    np.testing.assert_array_equal(large(x, 1.0), on_stack(x, 1.0))
    monkeypatch.setattr(indexing, "LARGEST", 2000)
    with pytest.raises(CannotLower, match="An array of 3000 numbers is larger than 2000"):
        function(3000)
    monkeypatch.undo()
    monkeypatch.setattr(emitter, "MAX_ARENA", 1 << 17)
    with pytest.raises(CannotLower, match="take more than 0 MiB in every thread"):
        function(3000)(x, 1.0)
    monkeypatch.setattr(emitter, "LARGEST", 1 << 10)
    with pytest.raises(CannotLower, match=r"would become \d+ lines of LLVM code"):
        function(300)(x, 1.0)


def test_small_types_and_flags_in_the_arena(monkeypatch):
    monkeypatch.setattr(emitter, "ON_STACK", 0)
    cases = (np.arange(COUNT, dtype=np.int8), np.float32(np.arange(COUNT)), np.arange(COUNT) > 3)
    shared = {"gain": np.float32(3.0)}

    def stacked(case, shared):
        small, single, flag = case
        rows = lax.scan(lambda c, i: (c, (small + i, flag ^ (i > 50), single)), 0, counts)[1]
        return narrow((rows[0][40], rows[2][5], rows[1][99]), shared)

    counts = jnp.arange(100, dtype=jnp.int8)
    expected = jax.vmap(stacked, (0, None))(jax.tree.map(jnp.asarray, cases), shared)
    for lanes in (1, 2, 16):
        mapped = Mapped(stacked, jax.tree.map(lambda x: x[0], cases), shared, lanes)
        assert mapped.text.count("%arena, i64") >= 2
        np.testing.assert_array_equal(mapped(cases, shared), expected)


def test_a_constant_array_has_one_name_in_all_functions():
    def function(x, shared):
        table = jnp.array([3.0, 5.0, 7.0, 9.0, 2.0, 1.0, 8.0, 4.0, 6.0])
        other = table[::-1] * 2

        def far(x):
            return table[jnp.int32(x)] + other[jnp.int32(x)]

        return lax.cond(x > shared, far, lambda x: table[jnp.int32(x)] - other[0], x)

    x = np.arange(9.0)
    found = Mapped(function, x[0], 4.0)(x, 4.0)
    np.testing.assert_array_equal(found, jax.vmap(function, (0, None))(x, 4.0))
    module = emitter.Module(4)
    first, second = (indexing.memory_of(np.dtype(float), 3, True, x[n : n + 3]) for n in (0, 1))
    names = [module.constant(one) for one in (first, second, first)]
    assert names == ["@c0", "@c1", "@c0"]
    assert module.text("").count("internal constant") == 2
