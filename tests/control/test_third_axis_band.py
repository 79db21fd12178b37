"""The band of the axis that no wheel drives: closed forms of what returns, and SciPy's flight."""

import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.control.third_axis_band import BandMemory
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.dynamics import PlantState

BALANCE, STIFFNESS, MOMENT = -0.0130720, 2.511452e-5, 960.0  # as undriven_balance says
RATE = math.sqrt(STIFFNESS / MOMENT)
AXIS, ALL = jnp.array([1.0, 0.0, 0.0]), jnp.ones(4)
PULSE = 0.01 * 0.0765 / math.sqrt(1 + 2 * 0.045**2) / MOMENT  # rad/s


@pytest.fixture(scope="module")
def law():
    return build(load("k2")).loop.controller


def state_of(roll, rate):
    half = roll / 2
    return PlantState(
        Quaternion(jnp.array([jnp.cos(half), jnp.sin(half), 0.0, 0.0])),
        jnp.array([rate, 0.0, 0.0]),
        (),
    )


def flown(band, law, roll, rate, end, period=20.0):
    """Times (s) of firings and the rate changes (rad/s), by the exact motion about the balance."""
    law = dataclasses.replace(law, period=jnp.asarray(period))
    correct = eqx.filter_jit(
        lambda roll, rate, memory: band.correct(
            state_of(roll, rate), law, AXIS, jnp.zeros(3), jnp.zeros(3), ALL, memory
        )
    )
    memory, firings = BandMemory.begin(), []
    grow, swing = math.cosh(RATE * period), math.sinh(RATE * period)
    for number in range(int(end / period)):
        done = correct(jnp.asarray(roll), jnp.asarray(rate), memory)
        memory = done.memory
        change = period * float((band.thrust @ done.duty)[0]) / MOMENT
        if change:
            firings.append((number * period, change))
        rate += change
        x = roll - BALANCE
        roll, rate = BALANCE + x * grow + rate / RATE * swing, rate * grow + x * RATE * swing
        assert abs(roll) < float(band.band) + period * abs(rate)
    return np.array(firings)


@pytest.mark.slow
def test_any_thrust_throws_the_error_back_to_where_it_came_from(law):
    """Between two firings it goes from the edge to where it began at rest, and returns."""
    any_width = dataclasses.replace(law.band, least=jnp.zeros(4))
    firings = flown(any_width, law.healthy, -0.002, 0.0, 45_000, period=15.0)
    edge, least = 0.006 - BALANCE, -0.002 - BALANCE
    between = 2 / RATE * math.acosh(edge / least)
    np.testing.assert_allclose(firings[0, 0], between / 2, rtol=0, atol=20)
    np.testing.assert_allclose(np.diff(firings[:, 0]), between, rtol=0.01)
    speed = RATE * math.sqrt(edge**2 - least**2)
    np.testing.assert_allclose(firings[:, 1], -2 * speed, rtol=0.01)


def test_pulses_are_whole_and_never_against_each_other(law):
    firings = flown(law.band, law.healthy, 0.0, 0.0, 43200)
    assert len(firings) > 2
    assert np.all(firings[:, 1] < 0)
    count = -firings[:, 1] / float(law.band.thrust[0].max() * 0.01 / MOMENT)
    np.testing.assert_allclose(count, np.round(count), atol=1e-6)
    most = STIFFNESS * (0.0061 - BALANCE) / MOMENT  # rad/s², at the edge
    assert -firings[1:, 1].sum() < most * np.ptp(firings[:, 0])


def test_an_error_that_crosses_is_turned_back_slowly(law):
    """One that came back to the edge of before is thrown back as fast as it came."""
    crossed = BandMemory(jnp.array(True), jnp.array(-1.0))
    came, rate = BandMemory(jnp.array(True), jnp.array(1.0)), 5e-6
    step = float(law.band.thrust[0].max()) * 0.01 / MOMENT

    def after(memory):
        done = law.band.correct(
            state_of(0.0061, rate), law.healthy, AXIS, jnp.zeros(3), jnp.zeros(3), ALL, memory
        )
        return rate + 5.0 * float((law.band.thrust @ done.duty)[0]) / MOMENT

    assert abs(after(came) + rate) <= step / 2 + 1e-12
    assert abs(after(crossed) + 0.01 * 0.02 * 0.006) <= step / 2 + 1e-12


def test_accelerations_across_the_axis_are_those_of_the_torque(law):
    """For any inertia, with what the pulse makes: NumPy solves for the accelerations."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(3, 3))
    inertia = root @ root.T + 3 * np.eye(3)
    axis = rng.normal(size=3)
    axis = axis / np.linalg.norm(axis)
    spacecraft = dataclasses.replace(
        law.healthy.model.spacecraft, inertia=jnp.asarray(inertia * 300)
    )
    model = dataclasses.replace(law.healthy.model, spacecraft=spacecraft)
    other = dataclasses.replace(law.healthy, model=model)
    turn = 0.0061 * axis
    attitude = Quaternion(jnp.array([1.0, *(turn / 2)])).normalised()
    torque = rng.normal(size=3)
    state = PlantState(attitude, jnp.asarray(1e-7 * axis), ())
    memory = BandMemory(jnp.array(True), jnp.array(0.0))
    done = law.band.correct(
        state, other, jnp.asarray(axis), jnp.asarray(torque), jnp.zeros(3), ALL, memory
    )
    pulse = np.asarray(law.band.thrust @ done.duty)
    assert axis @ pulse < 0
    assert abs(axis @ np.asarray(done.torque)) < 1e-9
    wanted = np.linalg.solve(inertia * 300, torque)
    given = np.linalg.solve(inertia * 300, np.asarray(done.torque) + pulse)
    np.testing.assert_allclose(given - wanted, axis * (axis @ (given - wanted)), atol=1e-12)


@pytest.mark.slow
def test_a_flight_drifts_and_is_turned_back_as_scipy_has_it():
    """The roll alone, by the force on each plate, with the same rule at the edge every 5 s."""
    scenario = load("k2", ["simulation.duration_s=36000"])
    trajectory = build(scenario).simulate()
    roll = 2 * np.asarray(trajectory.signals.quaternion)[:, 1]
    panels = [
        (one.area_m2, np.array(one.normal), np.array(one.centre_m), one.specular, one.diffuse)
        for one in scenario.panel
    ]

    def slope(t, state):
        sun = np.array([0.0, -math.sin(state[0]), -math.cos(state[0])])
        torque = 0.0
        for area, normal, centre, specular, diffuse in panels:
            cosine = normal @ sun
            push = (1 - specular) * sun + 2 * (specular * cosine + diffuse / 3) * normal
            torque += np.cross(centre, -4.56e-6 * area * cosine * push)[0]
        return [state[1], torque / MOMENT]

    state, now, rolls = np.zeros(2), 0.0, [np.zeros(1)]

    def leaves(t, state):
        return abs(state[0]) - 0.006

    leaves.terminal, leaves.direction = True, 1
    while now < 36000:
        saved = np.arange(60 * math.floor(now / 60 + 1), 36001, 60)
        arc = solve_ivp(
            slope, (now, 36000), state, dense_output=True, events=leaves, rtol=1e-9, atol=1e-13
        )
        sampled = 5 * math.ceil(arc.t[-1] / 5)  # the first sample beyond the edge
        rolls.append(arc.sol(saved[saved <= sampled])[0])
        state, now = arc.sol(sampled), sampled
        outwards = state[1] * np.sign(state[0])
        count = max(1.0, round((outwards + max(outwards, PULSE / 2)) / PULSE))
        state = state - np.array([0.0, np.sign(state[0]) * count * PULSE])
    rolls = np.concatenate(rolls)
    np.testing.assert_allclose(roll, rolls, atol=1e-4)


def test_a_band_without_wheels_or_thrusters_is_refused():
    with pytest.raises(ScenarioError, match="must be omitted without tables"):
        load("wheels-fail", ["control.third_axis_band_rad=0.01"])
