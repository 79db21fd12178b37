"""Arguments are checked before machine code gets an address: wrong ones are refused, never read."""

import subprocess
import sys
import threading
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from compiler.wrong_arguments import COUNT, compiled, examples, picked
from jaxsat.compiler import Mapped
from jaxsat.compiler.llvm import emitter
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.scan import ScanEngine
from simulation.engine.examples import KICKS, continuous_example, program

TESTS = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def one():
    """A compiled function, with cases and what is shared."""
    (function, cases, shared), *_ = examples()
    mapped = compiled(function, cases, shared)
    mapped(cases, shared)
    return mapped, cases, shared


@pytest.mark.slow
def test_a_campaign_of_wrong_arguments_crashes_nothing():
    found = subprocess.run(
        [sys.executable, "-m", "compiler.wrong_arguments", "3", "200"],
        cwd=TESTS, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert found.returncode == 0, found.stdout + found.stderr


X, INDEX, TABLE = np.zeros((COUNT, 3)), np.zeros(COUNT, np.int64), np.zeros(40)


@pytest.mark.parametrize(
    ("cases", "shared", "error", "words"),
    [
        ({"x": X[:5], "index": INDEX}, TABLE, ValueError, "must have 13 cases, as .* but got 5"),
        ({"x": X[:, :2], "index": INDEX}, TABLE, ValueError, r"must have the shape \(cases, 3\)"),
        ({"x": X[0], "index": INDEX}, TABLE, ValueError, r"cases\['x'\]` must have the shape"),
        ({"x": 1.0, "index": INDEX}, TABLE, ValueError, "must have the shape"),
        ({"x": X, "index": INDEX}, TABLE[:39], ValueError, r"`shared` must have the shape \(40\)"),
        ({"x": X, "index": INDEX}, 1.0, ValueError, r"`shared` must have the shape \(40\)"),
        ({"x": X, "index": INDEX}, None, ValueError, "`shared` must be a tree"),
        ({"x": X}, TABLE, ValueError, "`cases` must be a tree"),
        ((X, INDEX), TABLE, ValueError, "`cases` must be a tree"),
        ({"x": X, "index": INDEX + 0.5}, TABLE, TypeError, "type int64, .* but got float64"),
        ({"x": X, "index": INDEX.astype(np.uint64)}, TABLE, TypeError, "but got uint64"),
        ({"x": X + 0j, "index": INDEX}, TABLE, TypeError, "real numbers .* but got complex128"),
        ({"x": X.astype(object), "index": INDEX}, TABLE, TypeError, "but got object"),
        ({"x": X.astype("U8"), "index": INDEX}, TABLE, TypeError, "but got <U"),
        ({"x": X.astype(np.longdouble), "index": INDEX}, TABLE, TypeError, "at most 64 bits"),
    ],
)
def test_every_class_of_wrong_arguments_has_its_message(one, cases, shared, error, words):
    for call in (one[0], one[0].interpreted):
        with pytest.raises(error, match=words):
            call(cases, shared)


def test_a_key_is_no_number_and_a_number_no_key():
    keys = jax.vmap(jax.random.key)(jnp.arange(COUNT))
    drawn = Mapped(lambda key, _: jax.random.uniform(key), keys[0])
    with pytest.raises(TypeError, match=r"must have the type key<fry>.* but got uint64"):
        drawn(np.arange(COUNT, dtype=np.uint64))
    with pytest.raises(TypeError, match=r"must hold real numbers .* but got key<fry>"):
        Mapped(lambda x, _: x, np.uint64(0))(keys)


def test_other_forms_of_the_same_numbers_give_the_same_bits(one):
    mapped, cases, table = one
    expected, x = mapped(cases, table), cases["x"]
    frozen = x.copy()
    frozen.setflags(write=False)
    room = np.zeros(x.nbytes + 1, np.uint8)
    unaligned = np.ndarray(x.shape, x.dtype, room.data, offset=1)
    unaligned[...] = x
    forms = [
        np.asfortranarray(x), np.repeat(x, 3, 1)[:, ::3], x[::-1].copy()[::-1], frozen, unaligned,
        x.astype(x.dtype.newbyteorder()), jnp.asarray(x), np.ma.masked_array(x, mask=True),
    ]  # fmt: skip
    for form in forms:
        found = mapped({"x": form, "index": jnp.asarray(cases["index"])}, table)
        jax.tree.map(np.testing.assert_array_equal, found, expected)


def test_numbers_are_taken_where_their_type_represents_them():
    function = Mapped(lambda x, y: x * y, 0.0, np.int8(0))
    assert function(np.arange(3), 2).tolist() == [0.0, 2.0, 4.0]
    assert function(np.float32([0.5]), True).tolist() == [0.5]
    with pytest.raises(ValueError, match="`shared` must be in the range of int8, but got 300"):
        function(np.arange(3), 300)
    with pytest.raises(TypeError, match="but got float"):
        function(np.arange(3), 2.0)


def test_what_an_argument_tells_of_itself_is_not_believed(one):
    class Liar:
        shape, dtype, ndim, size = TABLE.shape, TABLE.dtype, 1, TABLE.size

        def __array__(self, dtype=None, copy=None):
            return np.zeros(2)

    mapped, cases, _ = one
    with pytest.raises(ValueError, match=r"`shared` must have the shape \(40\), but got \(2,\)"):
        mapped(cases, Liar())


def test_no_cases_give_no_outputs():
    function = Mapped(lambda x, _: (x.sum(), x), np.zeros(3))
    total, same = function(np.zeros((0, 3)))
    assert total.shape == (0,)
    assert same.shape == (0, 3)
    with pytest.raises(ValueError, match="at least one array of cases"):
        Mapped(lambda case, x: x, (), 1.0)((), 1.0)


def test_64_bit_numbers_may_be_switched_between_tracing_and_calling():
    x = np.linspace(0.0, 1.0, 7)
    wide = Mapped(lambda x, _: 3.0 * x, 0.0)
    with jax.enable_x64(False):
        narrow = Mapped(lambda x, _: 3.0 * x, 0.0)
        np.testing.assert_array_equal(wide(x), 3.0 * x)
        assert wide(jnp.asarray(x)).dtype == np.float64
        assert narrow(jnp.asarray(x)).dtype == np.float32
    assert narrow(np.float32(x)).dtype == np.float32
    with pytest.raises(TypeError, match=r"type float32, .* but got float64"):
        narrow(x)


@pytest.mark.parametrize("lanes", [-1, 3, 5, 17, 32, 1 << 40])
def test_only_vectors_without_gaps_are_made(lanes):
    with pytest.raises(ValueError, match="`lanes` must be 1, 2, 4, 8 or 16, but got"):
        Mapped(lambda x, _: x, 0.0, lanes=lanes)
    if lanes > 0:
        with pytest.raises(ValueError, match="`simd_lanes` must be"):
            NativeEngine(simd_lanes=lanes)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    [np.int8, np.uint32, np.int64, np.uint64, np.uint8, np.int16, np.int32],
)
def test_no_index_reads_or_writes_outside(kind, monkeypatch):
    """As XLA: clamped, filled or dropped, whatever the index; the arrays are in the arena."""
    monkeypatch.setattr(emitter, "ON_STACK", 0)
    info = np.iinfo(kind)
    edges = [info.min, info.max, info.max // 2 + 1, 0, 1, 39, 40, 41, 2, 119, 120, info.max - 1]
    index = np.array([n for n in edges if n <= info.max] + [info.min + 1], kind)
    rows = np.random.default_rng(1).standard_normal((len(index), 40))

    def function(case, table):
        i, row = case
        cut = lax.dynamic_slice(row, (i,), (3,))
        put = lax.dynamic_update_slice(row, cut[:2] * 2, (i,))
        scattered = row.at[i].add(5.0, mode="drop").at[i].mul(2.0, mode="clip")
        gathered = [row.at[i].get(mode=m) for m in ("fill", "clip", "promise_in_bounds")]
        return table[i], table[i, i], cut, put, scattered, gathered[:2], gathered[2] * 0 == 0

    table = jnp.asarray(np.random.default_rng(2).standard_normal((40, 3)))
    mapped = Mapped(function, (index[0], rows[0]), table)
    expected = jax.vmap(function, (0, None))((jnp.asarray(index), jnp.asarray(rows)), table)
    jax.tree.map(np.testing.assert_array_equal, mapped((index, rows), table), expected)


def test_arguments_may_be_freed_or_written_meanwhile():
    """A run has copies of its own: changing what it was given changes no bit of it."""

    def slow(x, table):
        many = lax.fori_loop(0, 20_000, lambda i, c: c + table[i % 40] * x, 0.0)
        return many + table[5]

    mapped, rng = Mapped(slow, 0.0, np.zeros(40)), np.random.default_rng(0)
    x, table = rng.standard_normal(256), rng.standard_normal(40)
    expected, found = mapped(x, table), []
    mine, own = x.copy(), table.copy()
    caller = threading.Thread(target=lambda: found.append(mapped(mine, own)))
    caller.start()
    while caller.is_alive():
        if "jaxsat-native-own" in "".join(t.name for t in threading.enumerate()):
            mine[...] = np.nan
            own.resize(4, refcheck=False)
            break
    caller.join()
    np.testing.assert_array_equal(found[0], expected)


def test_threads_may_call_at_once(one):
    mapped, cases, table = one
    expected = mapped(cases, table)
    fresh, found = compiled(picked, cases, table), []
    threads = [
        threading.Thread(target=lambda: found.extend(fresh(cases, table) for _ in range(5)))
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 30
    for each in found:
        jax.tree.map(np.testing.assert_array_equal, each, expected)


def test_code_for_a_larger_processor_is_not_run():
    from jaxsat.compiler.llvm.target import Host

    mapped = Mapped(
        lambda x, _: x, 0.0, cpu=Host("x86-64-v4", "", 4096, "x86_64-linux-gnu"), lanes=8
    )
    with pytest.raises(RuntimeError, match="cannot run code for x86-64-v4"):
        mapped(np.zeros(3))


@pytest.mark.parametrize(
    ("cases", "error", "words"),
    [
        ((KICKS, KICKS[:5]), ValueError, r"`cases\[1\]` must have 11 cases, as `cases\[0\]` has"),
        ((), ValueError, "at least one array"),
        (KICKS[:0], ValueError, "at least one case"),
        (1.0, ValueError, "an axis of cases"),
    ],
)
@pytest.mark.parametrize("kind", [NativeEngine, ScanEngine])
def test_engines_want_as_many_cases_in_every_array(kind, cases, error, words):
    engine, prog = kind(), program(continuous_example())
    for call in (engine.evaluate, engine.histories, lambda *a: engine.gradient(*a, 1.0)):
        with pytest.raises(error, match=words):
            call(prog, cases)


def test_the_native_engine_wants_numbers():
    engine, prog = NativeEngine(), program(continuous_example())
    with pytest.raises(TypeError, match=r"`cases` must hold real numbers .* but got object"):
        engine.evaluate(prog, np.asarray(KICKS).astype(object))
    with pytest.raises(TypeError, match=r"`gains\['k'\]` must hold real numbers"):
        engine.evaluate(prog, KICKS, {"k": "1"})
    with pytest.raises(TypeError, match="`gains` must be floating-point, but got int64"):
        engine.gradient(prog, KICKS, 1)
