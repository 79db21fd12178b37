"""One list of checks over every loop and engine."""

import dataclasses

import diffrax
import jax
import numpy as np
import pytest

from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Outcome
from simulation.engine.examples import (
    EXAMPLES,
    GAIN,
    KICKS,
    WIDE,
    program,
    same_bits,
    sampled_example,
)


@pytest.fixture(
    scope="module",
    params=["sampled", "continuous", "corners", pytest.param("error", marks=pytest.mark.slow)],
)
def example(request):
    return EXAMPLES[request.param]()


of_each_stepper = pytest.mark.parametrize(
    "example", ["sampled", "continuous", "corners"], indirect=True, scope="module"
)
"""What the loops that share a stepper have in common."""


@pytest.fixture(scope="module")
def found(example):
    return example.scan.evaluate(program(example), KICKS, GAIN)


@pytest.fixture(scope="module")
def expected(example):
    return example.reference.evaluate(program(example), KICKS)


@pytest.mark.slow
def test_engines_agree(example, found, expected):
    assert np.all(found.code == 0)
    for name in ("w", "z", "quaternion", "omega", "cost", "effort", "peak_rate"):
        values = getattr(expected, name)
        corners = name == "effort" and example.agreement > 1e-6  # |u| has some, a hold has none
        tolerance = np.abs(values).max() * (1e-4 if corners else example.agreement)
        np.testing.assert_allclose(getattr(found, name), values, atol=tolerance, err_msg=name)
    late = 2e-3 if isinstance(example.case_factory.loop, SampledLoop) else 2e-4
    np.testing.assert_allclose(found.settling_time, expected.settling_time, atol=late)
    np.testing.assert_array_equal(found.ended_at, expected.ended_at)
    np.testing.assert_array_equal(found.drawn["kick"], KICKS)


@pytest.mark.slow
def test_bits_depend_on_no_other_case(example, found):
    """Not on the number of cases, their order or what is beside them."""
    prog, order = program(example), np.random.default_rng(2).permutation(11)
    for numbers in (order, [4], range(3, 11), [6, 6, 1]):
        numbers = np.array(numbers)
        some = example.scan.evaluate(prog, KICKS[numbers], GAIN)
        same_bits(some, jax.tree.map(lambda x, n=numbers: x[n], found))


@pytest.mark.slow
def test_a_diverging_case_is_coded_and_changes_no_other(example, found):
    kicks = np.array(KICKS)
    kicks[2], kicks[7] = np.nan, 1e7
    mixed = example.scan.evaluate(program(example), kicks, GAIN)
    assert mixed.code[2] == mixed.code[7] == int(Outcome.STATE_LIMIT)
    for name in ("cost", "effort", "z", "peak_rate"):
        assert np.all(np.isnan(getattr(mixed, name)[[2, 7]]))
    assert np.all(np.isinf(mixed.settling_time[[2, 7]]))
    assert mixed.ended_at[2] == 0
    others = np.delete(np.arange(11), [2, 7])
    same_bits(*[jax.tree.map(lambda x: x[others], outputs) for outputs in (mixed, found)])


@pytest.mark.slow
@pytest.mark.parametrize("example", ["sampled", "continuous"], indirect=True, scope="module")
def test_a_block_of_one_case_has_bits_of_its_own(example, found):
    """No padding and no companion: run, replay and history of a case go through one program."""
    prog, alone = program(example), dataclasses.replace(example.scan, batch_size=1)
    several = alone.evaluate(prog, KICKS[[3, 0]])
    one = jax.tree.map(lambda x: x[0], several)
    replay = alone.replay(prog, KICKS[3])
    same_bits(replay.outputs, one)
    history = alone.histories(prog, KICKS[3:4])
    same_bits(jax.tree.map(lambda x: x[0], history), replay.signals)
    for name in ("w", "z", "omega", "cost"):
        expected = getattr(found, name)[[3, 0]]
        np.testing.assert_allclose(getattr(several, name), expected, rtol=1e-8, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("example", ["sampled", "corners"], indirect=True, scope="module")
def test_the_reference_keeps_cases_apart(example, expected):
    """The same bits in another order and beside a case that diverges, and again in a replay."""
    prog, kicks = program(example), np.array(KICKS)
    order = np.random.default_rng(3).permutation(11)
    shuffled = example.reference.evaluate(prog, kicks[order])
    same_bits(shuffled, jax.tree.map(lambda x: x[order], expected))
    kicks[1] = np.nan
    mixed = example.reference.evaluate(prog, kicks)
    assert mixed.code[1] != int(Outcome.SUCCESS)
    others = np.delete(np.arange(11), 1)
    same_bits(*[jax.tree.map(lambda x: x[others], outputs) for outputs in (mixed, expected)])
    replay = example.reference.replay(prog, KICKS[3])
    same_bits(replay.outputs, jax.tree.map(lambda x: x[3], expected))


@pytest.mark.slow
@of_each_stepper
def test_a_replay_has_the_same_bits_and_the_history_of_simulate(example, found):
    replay = example.scan.replay(program(example), KICKS[3], GAIN)
    same_bits(replay.outputs, jax.tree.map(lambda x: x[3], found))
    case = example.case_factory(KICKS[3], None)
    method = example.reference.method
    whole = simulate(case.loop, case.start, replay.times, method=method, tolerances=WIDE)
    run = whole.signals
    for name in ("w", "z", "omega", "torque", "relative_rate"):
        values = getattr(run, name)
        tolerance = 100 * example.agreement * np.abs(values).max()
        np.testing.assert_allclose(getattr(replay.signals, name), values, atol=tolerance)
    settled = whole.assessment.settled_from
    np.testing.assert_allclose(replay.outputs.settling_time, settled, atol=2e-4)
    rates = np.linalg.norm(run.omega, axis=1)
    np.testing.assert_allclose(replay.outputs.peak_rate, rates.max(), rtol=1e-5)
    np.testing.assert_array_equal(replay.signals.omega[-1], found.omega[3])


@pytest.mark.slow
def test_effort_of_a_sampled_loop_is_that_of_its_held_torques():
    """Every period's torque is held 0.07 s, and 0.03 s of the next."""
    example = sampled_example()
    replay = example.scan.replay(program(example), KICKS[3], GAIN)
    torque = np.abs(replay.signals.torque).sum(axis=1)  # what is made until the delay is over
    expected = 0.03 * torque[:-1].sum() + 0.07 * torque[1:].sum()
    np.testing.assert_allclose(replay.outputs.effort, expected, rtol=1e-12)


@pytest.mark.slow
@of_each_stepper
def test_the_horizon_is_no_part_of_the_compiled_loop(example):
    """Half the way gives what the whole way passes through: `replay` rests on it.

    The rates are decoded from the state by two programs, which may differ in the last bit.
    """
    longer, shorter = program(example), program(example, example.duration / 2)
    half = example.scan.evaluate(shorter, KICKS[:3], GAIN)
    replay = example.scan.replay(longer, KICKS[1], GAIN)
    middle = replay.signals.omega[len(replay.times) // 2]
    np.testing.assert_array_max_ulp(half.omega[1], middle, maxulp=1)


def test_an_unknown_duration_is_refused(example):
    with pytest.raises(ValueError, match="whole number of intervals"):
        program(example, 12.03)


@pytest.mark.parametrize("solver", [diffrax.ImplicitEuler(), diffrax.SemiImplicitEuler()])
def test_only_explicit_tableaus_are_taken(solver):
    with pytest.raises(ValueError, match="explicit Runge-Kutta"):
        FixedStepper(solver)
