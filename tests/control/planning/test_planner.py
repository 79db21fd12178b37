"""Plans against exact optima, and their flights against other equations."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from control.planning.spacecraft import PAPER, flown, planner, random_body, state, turned_about_x
from jaxsat.compiler import Mapped
from jaxsat.control.planning.guesses import random_numbers
from jaxsat.control.planning.planner import Plan, Planner, PlanStatus
from jaxsat.core.checks import as_float
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build

NOW = jnp.array(0.0)

quickest = eqx.filter_jit(lambda made, start: made.quickest(NOW, start))
replanned = eqx.filter_jit(lambda made, t, start, plan: made.replanned(t, start, plan))
_cheapest = eqx.filter_jit(lambda made, start, duration: made.cheapest(NOW, start, duration))


def cheapest(made, start, duration):
    return _cheapest(made, start, as_float(duration))


def assert_arrives(made, start, plan):
    end = flown(made, start, plan)
    assert end.angle < 1e-4
    assert end.rate * np.sqrt(float(jnp.mean(made.model.spacecraft.moments) / made.limit)) < 1e-4
    assert end.largest_thrust <= float(made.limit * (1 - made.margin)) * (1 + 1e-9)


@pytest.mark.parametrize("count", [5, 12, 24, 31])
def test_fewer_guesses_are_the_first_of_more(count):
    """So more of them contain all that fewer find."""
    more, fewer = random_numbers(48), random_numbers(count)
    for name, values in fewer.items():
        assert len(values) == count
        np.testing.assert_array_equal(values, more[name][:count])
    assert len(np.unique(more["stretch"])) == 48


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0.0, 0.2])
def test_rest_to_rest_is_bang_bang(margin):
    """2 √(J θ / u): half the time full thrust, half the time full brake."""
    made, start = planner(margin=margin), turned_about_x(0.5, 0.0)
    plan = quickest(made, start)
    usable = 5 * (1 - margin)
    assert plan.status == PlanStatus.SOLVED
    exact = 2 * np.sqrt(PAPER[0, 0] * 0.5 / usable)
    assert plan.duration == pytest.approx(exact, rel=3e-3)
    assert plan.duration >= exact * (1 - 1e-6)
    np.testing.assert_allclose(plan.torque[:22, 0], -usable, rtol=0.01)
    np.testing.assert_allclose(plan.torque[-22:, 0], usable, rtol=0.01)
    assert_arrives(made, start, plan)


@pytest.mark.slow
def test_a_spin_about_a_driven_axis_is_stopped_and_turned_back():
    """From ω0 at the target's attitude: (1 + √2) J ω0 / u."""
    start = turned_about_x(0.0, 0.05)
    plan = quickest(planner(), start)
    exact = (1 + np.sqrt(2)) * PAPER[0, 0] * 0.05 / 5
    assert plan.duration == pytest.approx(exact, rel=3e-3)
    assert plan.duration >= exact * (1 - 1e-6)


@pytest.mark.slow
def test_least_effort_is_the_angular_momentum():
    """∫ Σ|T_i| dt >= |H(0)|; coasting to the target and braking there attains it."""
    made, start = planner(), turned_about_x(-0.1, 0.01)
    plan = cheapest(made, start, 60.0)
    exact = PAPER[0, 0] * 0.01
    assert plan.status == PlanStatus.SOLVED
    assert plan.duration == pytest.approx(60.0)
    assert exact * (1 - 1e-4) <= plan.effort < exact * 1.02
    assert_arrives(made, start, plan)


@pytest.mark.slow
def test_least_effort_from_rest_to_rest():
    """Bang, coast, bang: J θ = u t (T - t) for bangs of t each, which cost 2 u t."""
    made, start = planner(), turned_about_x(0.5, 0.0)
    inertia, limit = PAPER[0, 0], 5.0
    duration = 1.5 * 2 * np.sqrt(inertia * 0.5 / limit)
    bang = (duration - np.sqrt(duration**2 - 4 * inertia * 0.5 / limit)) / 2
    plan = cheapest(made, start, duration)
    assert plan.status == PlanStatus.SOLVED
    assert plan.effort == pytest.approx(2 * limit * bang, rel=0.02)
    assert_arrives(made, start, plan)


@pytest.mark.slow
def test_a_duration_too_short_is_told():
    start = turned_about_x(0.5, 0.0)
    least = 2 * np.sqrt(PAPER[0, 0] * 0.5 / 5)
    assert cheapest(planner(), start, 0.9 * least).status == PlanStatus.FAILED
    assert cheapest(planner(), start, 1.2 * least).status == PlanStatus.SOLVED
    for impossible in (0.0, -60.0, np.nan, np.inf):
        plan = cheapest(planner(), start, impossible)
        assert plan.status == PlanStatus.FAILED


@pytest.mark.slow
def test_a_duration_that_is_given_is_kept():
    """Also where it is shorter than any rest of a plan of least time: 0.05 τ is 0.41 s here."""
    plan = cheapest(planner(), turned_about_x(0.0, 1e-3), 0.2)
    assert plan.duration == 0.2
    assert plan.status == PlanStatus.FLYABLE or plan.status == PlanStatus.SOLVED


@pytest.mark.slow
def test_any_two_torques_and_any_inertia():
    """Every plan that is not told as failed ends, flown by SciPy, at rest at the target."""
    cases = [random_body(np.random.default_rng([3, number])) for number in range(8)]
    plans = []
    for inertia, axes, limit, start in cases:
        made = planner(inertia, axes, limit)
        plan = quickest(made, start)
        if plan.status != PlanStatus.FAILED:
            assert_arrives(made, start, plan)
        plans.append(plan)
    assert sum(int(plan.status) == PlanStatus.SOLVED for plan in plans) >= 7
    inertia, axes, limit, start = cases[0]  # J and the limit divided alike change nothing
    small = quickest(planner(inertia / 1000, axes, limit / 1000), start)
    assert small.duration == pytest.approx(float(plans[0].duration), rel=1e-6)


@pytest.mark.slow
def test_a_plan_on_the_way_is_the_rest_of_the_plan():
    """From its own states the rest takes the rest of the time, and from others it arrives."""
    made = planner(orbit_rate=0.001)
    start = random_body(np.random.default_rng([7, 0]))[3]
    plan = quickest(made, start)
    passed = 12
    t = plan.duration * passed / 48
    here = state(-plan.quaternion[passed], plan.omega[passed])
    rest = replanned(made, t, here, plan)
    assert rest.status == PlanStatus.SOLVED
    assert rest.duration == pytest.approx(float(plan.duration - t), rel=5e-3)
    assert_arrives(made, here, rest)
    off = state(here.attitude.turned(jnp.array([0.02, -0.01, 0.015])).q, here.omega * 1.03)
    other = replanned(made, t, off, plan)
    assert other.status == PlanStatus.SOLVED
    assert_arrives(made, off, other)


@pytest.mark.slow
def test_derivatives_of_the_least_time_are_those_of_finite_differences():
    made = planner()
    base = random_body(np.random.default_rng([7, 0]))[3]
    plan = quickest(made, base)
    direction = jnp.array([0.6, -0.3, 0.5])

    # Gauss-Newton steps converge linearly, and so do their derivatives
    def duration(step):
        start = dataclasses.replace(base, omega=base.omega + step * direction)
        return made.replanned(NOW, start, plan).duration

    _, slope = jax.jit(lambda: jax.jvp(duration, (0.0,), (1.0,)))()
    both = jax.jit(jax.vmap(duration))(jnp.array([-1e-4, 1e-4]))
    assert slope == pytest.approx(float(both[1] - both[0]) / 2e-4, rel=0.06)


@pytest.mark.slow
def test_derivatives_at_the_targets_attitude():
    """Of (1 + √2) J ω0 / u by ω0, from where the angle to turn has none."""
    made = planner(guesses=2)

    def duration(rate):
        start = turned_about_x(0.0, 0.0)
        return made.quickest(NOW, dataclasses.replace(start, omega=jnp.eye(3)[0] * rate)).duration

    found, slope = jax.jit(lambda: jax.jvp(duration, (0.05,), (1.0,)))()
    exact = (1 + np.sqrt(2)) * PAPER[0, 0] / 5
    assert found == pytest.approx(exact * 0.05, rel=3e-3)
    assert slope == pytest.approx(exact, rel=0.05)


@pytest.mark.slow
def test_a_bad_case_spoils_no_other_and_machine_code_makes_the_same_plans():
    """A batch beside a case that is NaN and one that spins wildly, and each case alone."""
    good = [random_body(np.random.default_rng([5, k]))[3] for k in range(3)]
    nan = state([1.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0])
    wild = state([0.5, 0.5, 0.5, 0.5], [300.0, 200.0, -400.0])
    starts = [good[0], nan, good[1], wild, good[2]]
    batch = jax.tree.map(lambda *rows: np.stack(rows), *starts)
    made, sound = planner(guesses=2, intervals=8), [0, 2, 4]

    def one(start, shared):
        return tuple(shared.quickest(NOW, start))

    alone = Plan(*Mapped(one, starts[0], made)(batch, made))
    together = eqx.filter_jit(jax.vmap(lambda start: made.quickest(NOW, start)))(batch)
    together = jax.tree.map(np.asarray, together)
    for plans in (alone, together):
        assert np.all((plans.status == PlanStatus.FAILED) == [False, True, False, True, False])
    np.testing.assert_array_equal(alone.status, together.status)
    np.testing.assert_allclose(alone.duration[sound], together.duration[sound], rtol=1e-6)
    np.testing.assert_allclose(alone.torque[sound], together.torque[sound], atol=1e-3)


@pytest.mark.slow
def test_the_papers_start_at_the_least_time_known():
    """30.48 s at 5 N m by IPOPT; the disturbance and the orbit are part of the plan."""
    run = build(load("acceptance-nominal"))
    made = Planner(run.loop.plant, run.loop.plant.effectors[0].torque_axes, 5.0)
    plan = quickest(made, run.start)
    assert plan.status == PlanStatus.SOLVED
    assert 30.47 < plan.duration < 30.48 * 1.005


def test_torque_is_held_over_each_interval():
    states = jnp.zeros((3, 4)), jnp.zeros((3, 3))
    number = jnp.array(0)
    torque = jnp.array([[1.0, 2.0], [3.0, 4.0]])
    plan = Plan(jnp.array(10.0), jnp.array(6.0), torque, *states, NOW, number, number, NOW)
    for t, expected in (
        (9.9, [0, 0]),
        (10.0, [1, 2]),
        (12.9, [1, 2]),
        (13.1, [3, 4]),
        (16.1, [0, 0]),
    ):
        np.testing.assert_array_equal(plan.torque_at(jnp.array(t)), expected)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"limit": 0.0}, "`limit` must be positive"),
        ({"margin": 1.0}, "`1 - margin` must be positive"),
        ({"margin": -0.1}, "`margin` must be zero or positive"),
        ({"guesses": 0}, "`guesses` must be at least 1"),
        ({"intervals": 47}, "`intervals` must be even"),
        ({"limit": np.inf}, "`limit` must be finite"),
        ({"axes": np.eye(3)[:2]}, r"`torque_axes` must have shape \(3, m\)"),
        ({"axes": np.zeros((3, 0))}, "`torque_axes` must have shape"),
        ({"axes": np.eye(3)[0]}, "`torque_axes` must have shape"),
        ({"axes": [[1.0, np.nan], [0.0, 1.0], [0.0, 0.0]]}, "`torque_axes` must be finite"),
        ({"axes": [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]}, "`torque_axes` must have no column of"),
    ],
)
def test_arguments_are_checked(keys, message):
    with pytest.raises(ArgumentError, match=message):
        planner(**keys)
