"""Adaptive steps in the plain loop against diffrax's, SciPy's numbers and their own bits."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.paper import PAPER_THREE_AXIS, three_axis_loop, three_axis_start
from helpers.references import THREE_AXIS_STATES
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.program import program_of
from jaxsat.simulation.engine.runge_kutta import stage_rates, tableau_of, weighted
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.trajectory import Outcome
from simulation.engine.examples import Kicked, same_bits
from studies.studies import tumbling

COPIES = Kicked(three_axis_loop(PAPER_THREE_AXIS), three_axis_start(PAPER_THREE_AXIS))
KICKS = np.array([[0.0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.02, -0.01, 0], [np.nan, 0, 0]])


def engine(batch_size=4, **options):
    stepper = AdaptiveStepper(diffrax.Dopri5(), Tolerance(1e-10, 1e-10, **options))
    return ScanEngine(stepper, batch_size)


@pytest.fixture(scope="module")
def found():
    return engine().evaluate(program_of(COPIES, COPIES.loop, 10.0), KICKS)


@pytest.mark.slow
def test_the_printed_law_has_its_reference_numbers(found):
    state = [*found.w[0], found.z[0], *found.omega[0, :2]]
    np.testing.assert_allclose(state, THREE_AXIS_STATES[10], atol=2e-8)


@pytest.mark.slow
def test_bits_depend_on_no_other_case(found):
    program = program_of(COPIES, COPIES.loop, 10.0)
    for numbers in ([3, 0], [2], [4, 4, 1, 1, 3]):
        some = engine().evaluate(program, KICKS[numbers])
        same_bits(some, jax.tree.map(lambda x, n=numbers: x[n], found))


@pytest.mark.slow
def test_a_case_that_is_no_number_leaves_at_once(found):
    assert found.code.tolist() == [0, 0, 0, 0, int(Outcome.STATE_LIMIT)]
    assert np.isnan(found.cost[4])
    assert found.ended_at.tolist() == [10, 10, 10, 10, 0]


@pytest.mark.slow
def test_a_replay_has_the_same_bits(found):
    replay = engine().replay(program_of(COPIES, COPIES.loop, 10.0), KICKS[3])
    same_bits(replay.outputs, jax.tree.map(lambda x: x[3], found))
    first = engine().replay(program_of(COPIES, COPIES.loop, 10.0), KICKS[0]).signals
    np.testing.assert_allclose(first.w[1], THREE_AXIS_STATES[1][:2], atol=1e-8)


@pytest.mark.slow
def test_a_block_of_one_case_goes_without_padding(found):
    program, alone = program_of(COPIES, COPIES.loop, 10.0), engine(batch_size=1)
    assert (alone.padded_size, engine().padded_size) == (1, 12)
    several = alone.evaluate(program, KICKS[[3, 4, 0]])
    one, other = (jax.tree.map(lambda x, n=n: x[n], several) for n in (0, 2))
    same_bits(alone.replay(program, KICKS[3]).outputs, one)
    same_bits(jax.tree.map(lambda x: x[0], alone.evaluate(program, KICKS[:1])), other)
    assert several.code.tolist() == found.code[[3, 4, 0]].tolist()
    for name in ("w", "z", "omega", "cost"):
        expected = getattr(found, name)[[3, 4, 0]]
        np.testing.assert_allclose(getattr(several, name), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_case_out_of_steps_is_coded():
    program = program_of(COPIES, COPIES.loop, 10.0)
    some = engine(max_steps=20).evaluate(program, KICKS[:2])
    assert some.code.tolist() == [int(Outcome.MAX_STEPS)] * 2
    assert np.all(some.ended_at < 10)
    assert np.all(np.isnan(some.z))


def test_the_error_estimate_is_that_of_diffrax():
    def rate(t, y):
        return -y * jnp.cos(t)

    y, t, h = jnp.array([1.0, 2.0]), jnp.array(0.3), jnp.array(0.2)
    for solver in (diffrax.Bosh3(), diffrax.Tsit5(), diffrax.Dopri5(), diffrax.Dopri8()):
        term = diffrax.ODETerm(lambda t, y, args: rate(t, y))
        state = solver.init(term, t, t + h, y, None)
        after, error, *_ = solver.step(term, t, t + h, y, None, state, made_jump=False)
        tableau = tableau_of(solver)
        rates = stage_rates(tableau, rate, t, h, y, rate(t, y))
        np.testing.assert_allclose(y + h * weighted(tableau.b_sol, rates), after, rtol=1e-14)
        np.testing.assert_allclose(h * weighted(tableau.b_error, rates), error, atol=4e-16)


def test_impossible_tolerances_are_refused():
    for wrong in ({"rtol": 0.0}, {"min_step": -1.0}, {"max_steps": 0}):
        with pytest.raises(ValueError, match="Argument"):
            Tolerance(**wrong)


def test_a_study_tells_its_tolerance():
    study = tumbling(4)
    assert "tolerance" not in study.engine.identity()
    assert engine().identity()["tolerance"][:2] == [1e-10, 1e-10]
