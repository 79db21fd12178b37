"""The tracker of a plan that is data: its torque, when it follows, and its flights."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.plan_tracking import PlanTracking, PlanTrackingMode
from jaxsat.control.planning.tracking import PlanTable
from jaxsat.control.supervisor import Phase
from jaxsat.core.attitude import Quaternion
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.engine.single import fly
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.spacecraft import Spacecraft

COUNT, DURATION = 32, 20.0


def run_of(*overrides):
    given = ["control.law=planned", "simulation.duration_s=150", "simulation.save_every_s=0.1"]
    run: Any = build(load("acceptance-nominal", [*given, *overrides]))
    return run


class Stepped(NamedTuple):
    """A tracker of a plan of no meaning, and the start."""

    law: Any
    start: PlantState


@pytest.fixture(scope="module")
def stepped():
    run = run_of("control.observe_ripple=false", "spacecraft.torque_limit_N_m=20")
    rng = np.random.default_rng(1)
    attitude = rng.normal(size=(COUNT, 4))
    attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    sizes = {"rate": (COUNT, 3), "torque": (COUNT, 2)}
    gains = {"attitude_gain": (COUNT, 2, 4), "rate_gain": (COUNT, 2, 3)}
    rows = {name: jnp.asarray(0.02 * rng.normal(size=size)) for name, size in sizes.items()}
    rows |= {name: jnp.asarray(rng.normal(size=size)) for name, size in gains.items()}
    plan = PlanTable(jnp.array(0.0), jnp.array(DURATION), jnp.asarray(attitude), **rows)
    law = PlanTracking(run.loop.controller.settling, plan, jnp.array(0.5))  # pyright: ignore
    return Stepped(law, run.start)


_step = eqx.filter_jit(lambda law, *given: law.step(*given))


def step(*given):
    """One sample of a law; without weak types, so that all samples share one program."""
    return _step(*jax.tree.map(lambda x: np.asarray(x) if eqx.is_array(x) else x, given))


def on_plan(law, row, quaternion=(0.0, 0.0, 0.0, 0.0), omega=(0.0, 0.0, 0.0)):
    """The state of the plan at the begin of an interval, with these differences."""
    q = np.asarray(law.plan.attitude[row]) + np.array(quaternion)
    return PlantState(
        Quaternion(jnp.asarray(q / np.linalg.norm(q))), law.plan.rate[row] + np.array(omega)
    )


@pytest.mark.parametrize("row", [0, 7, 31])
def test_the_torque_is_the_plans_mean_and_the_feedback_of_the_difference(stepped, row):
    """The mean over the period by adding up pieces, the feedback by NumPy; and the sign of a
    quaternion changes nothing."""
    law, length = stepped.law, DURATION / COUNT
    period = 2 * length  # two intervals, of which the last of the plan has but one
    law = eqx.tree_at(lambda x: x.settling.period, law, jnp.array(period))
    memory = law.init(stepped.start)
    difference = np.array([1e-3, -2e-3, 1.5e-3, 1e-3]), np.array([1e-3, 2e-3, -3e-3])
    here = on_plan(law, row, *difference)
    q = np.asarray(here.attitude.as_quaternion().q)
    seen = PlantState(Quaternion(jnp.asarray(-q)), here.omega)
    found, after = step(law, jnp.array(row * length), seen, memory)
    assert after.follows
    torques = np.asarray(law.plan.torque)[row : row + 2]
    wanted = torques.sum(axis=0) / 2
    attitude_gain, rate_gain = law.plan.attitude_gain[row], law.plan.rate_gain[row]
    wanted = wanted + np.asarray(attitude_gain) @ (q - np.asarray(law.plan.attitude[row]))
    wanted = wanted + np.asarray(rate_gain) @ difference[1]
    command = np.asarray(law.form.to_command) @ wanted
    np.testing.assert_allclose(found, command, rtol=1e-9, atol=1e-12)


def test_a_plan_is_followed_from_its_begin_until_its_end_if_it_was_ahead(stepped):
    law, start = stepped.law, stepped.start
    later = eqx.tree_at(lambda x: x.plan.begin, law, jnp.array(30.0))
    here = on_plan(law, 0)

    def after(law, t, memory):
        return step(law, jnp.array(t), here, memory)[1]

    waiting = after(later, 29.9, law.init(start))
    assert (bool(waiting.follows), bool(waiting.waits)) == (False, True)
    begun = after(later, 30.0 - 1e-9, waiting)
    assert (bool(begun.follows), bool(begun.waits)) == (True, False)
    assert law.mode(begun) == PlanTrackingMode.FOLLOWING
    assert not after(later, 30.0 + DURATION + 0.1, begun).follows
    settling = law.init(start)._replace(waits=jnp.array(False))
    assert not after(later, 30.0, settling).follows  # uploaded too late
    assert after(later, 29.9, settling).waits  # and in time
    replaced = after(later, 20.0, begun)  # by a plan that begins later
    assert (bool(replaced.follows), bool(replaced.waits)) == (False, True)


def test_a_plan_that_is_far_off_is_given_up(stepped):
    law, memory = stepped.law, stepped.law.init(stepped.start)
    turned = on_plan(law, 0, quaternion=(0, 2.0, 0, 0))
    torque, after = step(law, jnp.array(0.0), turned, memory)
    assert not after.follows
    wanted, settling = step(law.settling, jnp.array(0.0), turned, memory.settling)
    np.testing.assert_allclose(torque, wanted, rtol=1e-12)
    assert after.settling.phase == settling.phase
    following = memory._replace(follows=jnp.array(True), waits=jnp.array(False))
    after = step(law, jnp.array(0.0), turned, following)[1]
    assert (bool(after.follows), int(after.settling.phase)) == (False, Phase.STOPPING)


@pytest.fixture(scope="module")
def flown():
    """The run at 5 N m, the tracker of a plan from its start, and flights."""
    run = run_of()
    law = run.loop.controller.flight_law(run.start)
    loop = dataclasses.replace(run.loop, controller=law)

    def flight(loop=loop, start=run.start):
        return fly(loop, start, run.times, run.method, refuse)

    return run, loop, flight


def refuse(obstacle):
    raise AssertionError(obstacle)


def order_of(found):
    modes = np.asarray(found.signals.mode)
    return [PlanTrackingMode(int(one)).name for one in modes[np.flatnonzero(np.diff(modes)) + 1]]


@pytest.mark.slow
def test_a_flight_keeps_to_its_plan_and_settles_at_its_end(flown):
    _, loop, flight = flown
    plan, found = loop.controller.plan, flight()
    assert 30.5 < plan.duration < 1.15 * 30.5  # the least time; plans use 0.9 of the torque
    assert found.signals.mode[0] == PlanTrackingMode.FOLLOWING
    assert order_of(found) == ["HOLDING"]
    assert found.assessment.settled_from < plan.duration
    assert np.abs(found.signals.torque).max() <= 5.0
    instants = np.arange(COUNT) * float(plan.duration) / COUNT
    for row in range(0, COUNT, 5):
        before = int(instants[row] / 0.1)
        share = instants[row] / 0.1 - before
        omega = np.asarray(found.signals.omega)[before : before + 2]
        between = (1 - share) * omega[0] + share * omega[1]
        np.testing.assert_allclose(between, plan.rate[row], atol=2e-3)


@pytest.mark.slow
def test_other_inertias_and_starts_settle_too(flown):
    run, loop, flight = flown
    inertia = np.asarray(loop.plant.spacecraft.inertia) * np.array([1.1, 0.9, 1.08])[:, None]
    other = dataclasses.replace(loop.plant, spacecraft=Spacecraft(inertia))
    found = flight(dataclasses.replace(loop, plant=other))
    assert order_of(found)[-1] == "HOLDING"
    faster = dataclasses.replace(run.start, omega=1.05 * run.start.omega)
    assert order_of(flight(start=faster))[-1] == "HOLDING"
    turned = run.start.attitude.as_quaternion().q[jnp.array([1, 0, 3, 2])]
    elsewhere = PlantState(Quaternion(turned), run.start.omega, run.start.effectors)
    found = flight(start=elsewhere)
    assert order_of(found)[0] == "SLEWING"
    assert order_of(found)[-1] == "HOLDING"


@pytest.mark.slow
def test_a_later_plan_begins_then(flown):
    run, loop, _ = flown
    law = run.loop.controller.flight_law(run.start, 600.0)
    assert law.plan.begin == 600.0
    assert float(law.plan.duration) == pytest.approx(float(loop.controller.plan.duration), rel=0.1)


@pytest.mark.slow
def test_without_a_plan_there_is_no_tracker():
    run = run_of()
    start = dataclasses.replace(run.start, omega=jnp.full(3, jnp.nan))
    with pytest.raises(ArgumentError, match="a plan to the target is found"):
        run.loop.controller.flight_law(start)
