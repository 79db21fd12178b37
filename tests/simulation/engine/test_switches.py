"""Located switches: exact solutions, an independent program, derivatives, and clear ends."""

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.paper import (
    PAPER_RATE,
    PAPER_THREE_AXIS,
    bodies,
    rate_loop,
    rate_start,
    three_axis_law,
)
from jaxsat.core.attitude import WZ
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.program import program_of
from jaxsat.simulation.engine.progress import RunningCost
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.trajectory import Outcome
from jaxsat.spacecraft.dynamics import PlantState
from oracle.rate_law import simulate_rate_law
from oracle.three_axis_law import simulate_three_axis
from simulation.engine.examples import Kicked
from simulation.engine.relay import Relays, exact_relay, relay

STARTS = np.array([[1.0, 0.0], [0.3, 1.0], [-2.0, 0.5], [0.7, -0.4]])
POSITION = RunningCost(w=0.0, z=1.0, relative_rate=0.0, torque=0.0, attitude="wz")


def engine(tolerance, batch_size=4, solver=None, **options):
    judged = Tolerance(tolerance, tolerance, **options)
    return ScanEngine(AdaptiveStepper(solver or diffrax.Tsit5(), judged), batch_size)


@pytest.fixture(scope="module")
def relays():
    loop = relay()
    return program_of(Relays(loop), loop, 20.0, cost=POSITION)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [diffrax.Tsit5(), diffrax.Dopri8()])
def test_a_relay_follows_its_parabolas(relays, solver):
    """About 10 switches, the pieces being of second order: all that is left is rounding."""
    found = engine(1e-11, solver=solver).evaluate(relays, STARTS)
    for i, (position, velocity) in enumerate(STARTS):
        exact = exact_relay(1.0, position, velocity, 20.0)
        mine = [found.z[i], found.omega[i, 0], found.cost[i], found.effort[i]]
        np.testing.assert_allclose(mine, exact, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [diffrax.Tsit5(), diffrax.Dopri8()])
def test_a_relay_gradient_has_the_jumps_of_its_switches(relays, solver):
    slopes = []
    for step in (1e-4, 2e-4):
        costs = [[exact_relay(1.0 + shift, *start, 20.0)[2] for start in STARTS]
                 for shift in (step, -step)]  # fmt: skip
        slopes.append(np.subtract(*costs) / (2 * step))
    exact = (4 * slopes[0] - slopes[1]) / 3
    found = engine(1e-13, solver=solver).gradient(relays, STARTS, jnp.array(1.0)).derivatives
    np.testing.assert_allclose(found, exact, rtol=1e-7)


@pytest.mark.slow
def test_a_relay_that_slides_is_passed_or_coded():
    """x' = -sgn x reaches 0 and stays there, switching without end."""
    loop = relay(inertia=False)
    program = program_of(Relays(loop), loop, 10.0)
    coded = engine(1e-8, max_steps=300).evaluate(program, STARTS)
    assert coded.code.tolist() == [int(Outcome.MAX_STEPS)] * 4
    np.testing.assert_allclose(coded.ended_at, np.abs(STARTS[:, 0]), atol=1e-3)
    passed = engine(1e-8, min_step=1e-2).evaluate(program, STARTS)
    assert passed.code.tolist() == [0] * 4
    assert np.abs(passed.z).max() <= 2e-2
    np.testing.assert_allclose(passed.effort, 10.0, rtol=1e-9)


@pytest.mark.slow
def test_a_touch_is_no_trouble():
    """From (1, 0) and (0.5, 1) the motion below a level of 1 just touches it."""
    loop = relay(level=1.0)
    starts = np.array([[1.0, 0.0], [0.5, 1.0], [0.5, 1.0 - 1e-9], [0.5, 1.0 + 1e-9]])
    found = engine(1e-8).evaluate(program_of(Relays(loop), loop, 10.0), starts)
    assert np.all((found.code == 0) | (found.code == int(Outcome.MAX_STEPS)))
    assert np.all(np.isfinite(found.z[found.code == 0]))


@pytest.fixture(scope="module")
def dispersed():
    """Dopri8 over 256 cases of the three-axis law: a study by duration, and a stepper."""

    def study(duration):
        overrides = [f"simulation.duration_s={duration}"]
        return build_study(load("benchmark-three-axis", overrides), 256, seed=1, engine="scan")

    def evaluated(study, tolerance, count=256, **options):
        stepper = engine(tolerance, 256, diffrax.Dopri8(), **options)
        return stepper.evaluate(study.program, study.cases(np.arange(count)))

    return study, evaluated


@pytest.mark.slow
def test_a_surface_just_left_does_not_hide_the_next_one(dispersed):
    """A step that begins on one surface and crosses another ends there, not where it began.

    Rounding leaves what has just been crossed next to zero on either side; taken for a switch it
    is one again and again, hundreds of times in four of these cases, which need 85 to 161 steps.
    """
    study, evaluated = dispersed
    found = evaluated(study(50), 3e-8, max_steps=200)
    assert np.all(found.code == int(Outcome.SUCCESS))


@pytest.mark.slow
def test_the_effort_of_long_steps_is_that_of_short_ones(dispersed):
    """In some steps of Dopri8 a torque changes its sign twice."""
    study, evaluated = dispersed
    long, short = (evaluated(study(200), tolerance, 16) for tolerance in (3e-7, 1e-12))
    np.testing.assert_allclose(long.effort, short.effort, rtol=1e-4)


CASE = {**PAPER_THREE_AXIS, "amplitude": (0.015, 0.01, 0.0), "phase": (1.0, 2.0, 0.0)}
KICK = np.array([0.02, -0.01, 0.0])


def three_axis():
    loop = ErrorCoordinateLoop(bodies(CASE)[0], three_axis_law(CASE))
    return Kicked(loop, PlantState(WZ([-0.6, 0.5], 0.8), [0.1, -0.11, 0.0]))


@pytest.mark.slow
def test_the_three_axis_law_against_an_independent_program():
    copies = three_axis()
    found = engine(1e-10).replay(program_of(copies, copies.loop, 60.0), KICK)
    run = simulate_three_axis(
        found.times,
        w0=(-0.6, 0.5),
        z0=0.8,
        omega0=tuple(copies.start.omega + KICK),
        **{k: v for k, v in CASE.items() if k not in ("w0", "z0", "omega0")},
    )
    np.testing.assert_allclose(found.signals.w, run.w, atol=2e-8)
    np.testing.assert_allclose(found.signals.omega, run.omega, atol=2e-8)
    np.testing.assert_allclose(found.signals.torque[:, :2], run.torque, atol=1e-5)
    assert found.outputs.ended_at == 60


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-10, pytest.param(5e-10, marks=pytest.mark.slow)])
def test_the_rate_law_through_a_zero_of_the_third_rate(tolerance):
    """At 31 s, where the reference's slope is unbounded; the smallest step passes it.

    Where exactly the step before ends depends on the tolerance, and must not matter.
    """
    loop = rate_loop(PAPER_RATE)
    program = program_of(Kicked(loop, rate_start(PAPER_RATE)), loop, 40.0)
    found = engine(tolerance, batch_size=1).replay(program, np.zeros(3))
    run = simulate_rate_law(found.times, **PAPER_RATE)
    assert len(run.crossings) == 1
    before = found.times < run.crossings[0]
    np.testing.assert_allclose(found.signals.omega[before], run.omega[before], atol=1e-7)
    np.testing.assert_allclose(found.signals.omega, run.omega, atol=1e-6)
