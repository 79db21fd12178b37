"""Settling and effort of a run, judged on the integrator's steps: nothing that is saved matters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.paper import (
    PAPER_THREE_AXIS,
    actuators,
    bodies,
    three_axis_loop,
    three_axis_start,
)
from helpers.switching import CASE, start, switching_loop
from jaxsat.control.controller import Coast
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, program_of
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from oracle import simulate_three_axis

LOOSE = Tolerances(1.1, 1.27, 0.3)
"""So loose that the paper's start is within them from 11.8 s on."""


def continuous(times):
    loop, begin = three_axis_loop(PAPER_THREE_AXIS), three_axis_start(PAPER_THREE_AXIS)
    return simulate(loop, begin, times, tolerances=LOOSE)


def sampled(times):
    return simulate(switching_loop(CASE), start(), times, tolerances=LOOSE)


@pytest.mark.slow
@pytest.mark.parametrize("run", [continuous, sampled])
def test_the_saved_times_do_not_matter(run):
    """The same instant and effort from two saved times, and from many unequal ones."""
    many = np.delete(np.linspace(0, 20, 201), [2, 3, 73, 118])
    few, other = (run(jnp.array(times)).assessment for times in ([0.0, 20.0], many))
    assert 0 < few.settled_from < 18
    for one, same in zip(*map(jax.tree.leaves, (few, other)), strict=True):
        np.testing.assert_allclose(one, same, rtol=1e-12)


@pytest.mark.slow
def test_the_instant_is_that_of_an_independent_program():
    """The instant is that of the rate's fall by 0.6 of its tolerance within 6 ms, by DOP853."""
    times = np.union1d(np.linspace(0, 20, 201), np.linspace(11.77, 11.78, 1001))
    run = simulate_three_axis(times, **PAPER_THREE_AXIS)
    relative_rate = run.omega + np.array([0.0, PAPER_THREE_AXIS["orbit_rate"], 0.0])
    parts = (
        np.linalg.norm(run.w, axis=1) / LOOSE.w,
        np.abs((run.z + np.pi) % (2 * np.pi) - np.pi) / LOOSE.z,
        np.linalg.norm(relative_rate, axis=1) / LOOSE.relative_rate,
    )
    worst = np.max(parts, axis=0) - 1
    last = int(np.flatnonzero(worst >= 0)[-1])
    step = times[last + 1] - times[last]
    expected = times[last] + step * worst[last] / (worst[last] - worst[last + 1])
    found = continuous(jnp.array([0.0, 20.0])).assessment.settled_from
    np.testing.assert_allclose(found, expected, atol=1e-8, rtol=0)


class Alone(AbstractCaseFactory):
    def __call__(self, case, gains):
        del gains
        loop, begin = three_axis_loop(PAPER_THREE_AXIS), three_axis_start(PAPER_THREE_AXIS)
        kicked = PlantState(begin.attitude, begin.omega + case)
        return Case(loop, kicked, {}, jnp.array(True))


@pytest.mark.slow
def test_engines_do_not_look_at_their_interval():
    """A case settles at the same instant whether it is looked at every 0.5 s or every 4 s."""
    loop = three_axis_loop(PAPER_THREE_AXIS)
    engine = ScanEngine(AdaptiveStepper(tolerance=Tolerance(1e-10, 1e-10)), 1)
    settled = [
        engine.evaluate(
            program_of(Alone(), loop, 20.0, interval, tolerances=LOOSE), np.zeros((1, 3))
        ).settling_time[0]
        for interval in (0.5, 4.0)
    ]
    assert settled[0] == settled[1]
    expected = continuous(jnp.array([0.0, 20.0])).assessment.settled_from
    np.testing.assert_allclose(settled[0], expected, atol=1e-6)


@pytest.mark.slow
def test_effort_is_the_change_of_momentum():
    """Without disturbance or third rate ∫|u_i| dt is J_i times the variation of ω_i."""
    loop, begin = three_axis_loop(PAPER_THREE_AXIS), three_axis_start(PAPER_THREE_AXIS)
    times = jnp.linspace(0, 20, 20001)
    whole = simulate(loop, begin, times)
    spins = np.asarray(whole.signals.omega[:, :2])
    moments = np.asarray(loop.plant.spacecraft.moments[:2])
    pushed = np.asarray(whole.signals.disturbance[:, :2])
    impulse = 0.001 * (pushed[1:] + pushed[:-1]) / 2
    expected = np.abs(moments * np.diff(spins, axis=0) - impulse).sum(axis=0)
    np.testing.assert_allclose(whole.assessment.effort[:2], expected, rtol=2e-3)
    torque = np.abs(whole.signals.constraint_torque)
    held = np.trapezoid(torque, times)
    np.testing.assert_allclose(whole.assessment.constraint_effort, held, rtol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("general", [False, True])
def test_the_constraint_torque_is_what_euler_lacks(general):
    """e3 · (J dω/dt + ω × Jω - T - T_d) for the rate that the plant itself gives."""
    inertia = np.diag([449.5, 264.6, 312.5])
    if general:
        inertia = inertia + np.array([[0, 9, -20], [9, 0, 30], [-20, 30, 0.0]])
    disturbance = PeriodicTorque([0.01, 0.02, 0.3], [0.7, 0.8, 0.1], [0.1, 0.2, 0.3])
    plant = RigidBody(Spacecraft(inertia), ExactOrbit(0.0011), disturbance, True)
    begin = three_axis_start(PAPER_THREE_AXIS)
    omega, torque, t = np.array([0.1, -0.11, 0.2]), jnp.array([4.0, -2.0, 0.7]), jnp.array(3.0)
    state = PlantState(begin.attitude, omega)
    rate = np.asarray(plant.rate(t, state, torque).omega)
    driven = np.asarray(torque + plant.disturbance_torque(t, state))
    missing = inertia @ rate + np.cross(omega, inertia @ omega) - driven
    np.testing.assert_allclose(missing[:2], 0, atol=1e-12)
    np.testing.assert_allclose(plant.constraint_torque(t, state, torque), missing[2], rtol=1e-12)
    assert rate[2] == 0
    free = RigidBody(Spacecraft(inertia), ExactOrbit(0.0011), disturbance)
    assert free.constraint_torque(t, state, torque) is None


@pytest.mark.slow
def test_gradients_go_past_the_assessment():
    """Reverse mode through a run whose settling is judged."""

    loop = ContinuousLoop(bodies(PAPER_THREE_AXIS)[0].with_effectors((actuators(),)), Coast())

    def last(factor):
        begin = three_axis_start(PAPER_THREE_AXIS)
        begin = PlantState(begin.attitude, begin.omega * factor)
        return simulate(loop, begin, jnp.array([0.0, 2.0])).signals.z[-1]

    slope = jax.grad(last)(jnp.array(1.0))
    difference = (last(jnp.array(1 + 1e-4)) - last(jnp.array(1 - 1e-4))) / 2e-4
    np.testing.assert_allclose(slope, difference, rtol=1e-5)


@pytest.mark.slow
def test_the_reference_engine_agrees():
    loop = three_axis_loop(PAPER_THREE_AXIS)
    program = program_of(Alone(), loop, 20.0, 4.0, tolerances=LOOSE)
    found = ReferenceEngine(batch_size=1).evaluate(program, np.zeros((1, 3))).settling_time[0]
    expected = continuous(jnp.array([0.0, 20.0])).assessment.settled_from
    np.testing.assert_allclose(found, expected, atol=1e-6)
