"""The compiled engine against the scan engine, over the loops that all engines are checked with."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.trajectory import Outcome
from simulation.engine.examples import EXAMPLES, GAIN, KICKS, program, same_bits


def native(example, **options) -> NativeEngine:
    return NativeEngine(example.scan.stepper, **options)


def tolerance_of(example, fixed: float) -> float:
    """Fixed steps differ by rounding, adaptive ones by what their tolerance allows."""
    return 1e-7 if isinstance(example.scan.stepper, AdaptiveStepper) else fixed


@pytest.fixture(
    scope="module",
    params=[
        *("corners", "sampled", "continuous"),
        pytest.param("error", marks=pytest.mark.slow),
    ],
)
def example(request):
    """The loop with an estimator: tests/control/navigation/test_loop.py."""
    return EXAMPLES[request.param]()


@pytest.fixture(scope="module")
def found(example):
    return native(example).evaluate(program(example), KICKS, GAIN)


def close(found: Outputs, expected: Outputs, tolerance: float) -> None:
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        x, y = np.asarray(x), np.asarray(y)
        assert x.dtype == y.dtype
        assert x.shape == y.shape
        scale = np.abs(y[np.isfinite(y)]).max(initial=0.0)
        np.testing.assert_allclose(x, y, rtol=0, atol=tolerance * scale)


@pytest.mark.slow
def test_it_agrees_with_the_scan_engine_step_by_step(example):
    """One interval at a time from the same states, the scan engine's."""
    short = program(example, 0.1 if float(program(example).interval) < 1 else 1.0)
    expected = example.scan.evaluate(short, KICKS, GAIN)
    close(native(example).evaluate(short, KICKS, GAIN), expected, tolerance_of(example, 1e-12))


@pytest.mark.slow
def test_it_agrees_with_the_scan_engine_over_the_whole_run(example, found):
    expected = example.scan.evaluate(program(example), KICKS, GAIN)
    close(found, expected, tolerance_of(example, 1e-9))


@pytest.mark.slow
def test_bits_depend_on_neither_lanes_nor_threads_nor_companions(example, found):
    prog, order = program(example), np.random.default_rng(2).permutation(11)
    for numbers in (order, [4], range(3, 11), [6, 6, 1]):
        numbers = np.array(numbers)
        some = native(example).evaluate(prog, KICKS[numbers], GAIN)
        same_bits(some, jax.tree.map(lambda x, n=numbers: x[n], found))
    many = np.tile(KICKS, (17, 1))
    for workers in (1, 3):
        wide = native(example, workers=workers).evaluate(prog, many, GAIN)
        same_bits(wide, jax.tree.map(lambda x: np.concatenate([x] * 17), found))


@pytest.mark.slow
def test_a_diverging_case_is_coded_and_changes_no_other(example, found):
    kicks = np.array(KICKS)
    kicks[2], kicks[7] = np.nan, 1e7
    mixed = native(example).evaluate(program(example), kicks, GAIN)
    assert mixed.code[2] == mixed.code[7] == int(Outcome.STATE_LIMIT)
    assert np.all(np.isnan(mixed.cost[[2, 7]]))
    assert np.all(np.isinf(mixed.settling_time[[2, 7]]))
    assert mixed.ended_at[2] == 0
    others = np.delete(np.arange(11), [2, 7])
    same_bits(*[jax.tree.map(lambda x: x[others], outputs) for outputs in (mixed, found)])


@pytest.mark.slow
def test_a_replay_has_the_same_bits(example, found):
    prog, engine = program(example), native(example)
    replay = engine.replay(prog, KICKS[3], GAIN)
    same_bits(replay.outputs, jax.tree.map(lambda x: x[3], found))
    np.testing.assert_array_equal(replay.signals.omega[-1], found.omega[3])
    half = engine.evaluate(program(example, example.duration / 2), KICKS[:4], GAIN)
    middle = replay.signals.omega[len(replay.times) // 2]
    np.testing.assert_array_equal(half.omega[3], middle)
    several = engine.histories(prog, KICKS[:5], GAIN)
    np.testing.assert_array_equal(several.omega[3], replay.signals.omega)


@pytest.mark.slow
def test_other_numbers_need_no_new_machine_code(example, found):
    prog, engine = program(example), native(example)
    kernel = engine.kernel(prog, KICKS, GAIN)
    stiffer = eqx.tree_at(lambda p: p.case_factory.loop.plant.orbit.rate, prog, jnp.array(0.002))
    assert engine.kernel(stiffer, KICKS, GAIN) is kernel
    other = engine.evaluate(stiffer, KICKS, GAIN)
    assert np.abs(other.omega - found.omega).max() > 1e-9
    close(other, example.scan.evaluate(stiffer, KICKS, GAIN), tolerance_of(example, 1e-9))


@pytest.mark.slow
@pytest.mark.parametrize("example", ["sampled"], indirect=True, scope="module")
def test_machine_code_is_given_no_arrays_but_those_it_was_made_for(example):
    prog, engine = program(example), native(example)
    kernel, trees = engine.kernel(prog, KICKS), engine.trees(KICKS, prog, None)
    wrong = [
        ({"cases": KICKS[:, :2]}, ValueError, r"`cases` must have the shape \(cases, 3\)"),
        ({"cases": KICKS.astype(complex)}, TypeError, "`cases` must hold real numbers"),
        ({"cases": (KICKS, KICKS)}, ValueError, "`cases` must be a tree"),
        ({"gains": 1.0}, ValueError, "`gains` must be a tree"),
        ({"numbers": jax.tree.map(lambda x: x[None], trees["numbers"])}, ValueError, "numbers"),
    ]
    for change, error, words in wrong:
        for call in (lambda t: kernel.run(t, 1, 1), lambda t: kernel.replay(t, [0, 1])):
            with pytest.raises(error, match=words):
                call(trees | change)
    with pytest.raises(ValueError, match="`intervals` must be at least 1, but got"):
        kernel.run(trees, 1 << 63, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "example", ["corners", "sampled", "continuous", "estimated"], indirect=True, scope="module"
)
def test_gradient_against_central_differences(example):
    prog, gain, step, engine = program(example), GAIN, 1e-5, native(example)
    found = engine.gradient(prog, KICKS[:2], gain)
    costs = [engine.evaluate(prog, KICKS[:2], gain + shift).cost for shift in (step, -step)]
    exact = (costs[0] - costs[1]) / (2 * step)
    assert np.abs(exact).min() > 1e-3
    np.testing.assert_allclose(found.derivatives, exact, rtol=1e-5)
    close(found.outputs, engine.evaluate(prog, KICKS[:2], gain), 1e-12)


def test_without_64_bit_numbers_it_refuses(example):
    with jax.enable_x64(False), pytest.raises(RuntimeError, match="64-bit"):
        native(example).kernel(program(example), KICKS, GAIN)
