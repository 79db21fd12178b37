"""Three slews: decomposition against SciPy's rotations, least angles, the profile and a flight."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from control.cases import INERTIA, ORBIT_RATE, actuators, body, form
from control.laws import ThreeSlewLaw
from helpers.strategies import rotations
from jaxsat.control import slews
from jaxsat.control.slews import SlewPlanner
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState

ORDERS = [("XYX", True), ("YXY", False)]
mirrored, three_slews = jax.jit(slews.mirrored), jax.jit(slews.three_slews)
two_slews, one_slew = jax.jit(slews.two_slews), jax.jit(slews.one_slew)
needed_rotation = eqx.filter_jit(SlewPlanner.needed)


def planner(**options):
    gains = {"share": 0.791, "approach": 4.77, "rate_gain": 2.34}
    tolerances = {"angle_tolerance": 2.7e-3, "rate_tolerance": 8.8e-4}
    return SlewPlanner(form(), 5.0, **{**gains, **tolerances, **options})


def scalar_first(rotation):
    return jnp.array(rotation.as_quat()[[3, 0, 1, 2]])


@settings(max_examples=50, deadline=None)
@given(rotation=rotations())
@pytest.mark.parametrize(("order", "along_x"), ORDERS)
def test_three_slews_make_the_rotation(order, along_x, rotation):
    """Both solutions; successive turns about the body's own axes are SciPy's capital letters."""
    angles = three_slews(mirrored(scalar_first(rotation), jnp.array(along_x)))
    for way in np.asarray(angles):
        made = Rotation.from_euler(order, way)
        assert (made.inv() * rotation).magnitude() < 1e-12
        assert np.all(np.abs(way) <= np.pi)
    np.testing.assert_allclose(np.abs(angles[0, 1]), np.abs(angles[1, 1]))


@settings(max_examples=10, deadline=None)
@given(rotation=rotations())
@pytest.mark.parametrize(("order", "along_x"), ORDERS)
def test_two_slews_leave_the_least_rotation(order, along_x, rotation):
    """Against a numerical search from many starts."""
    b, c = np.asarray(two_slews(mirrored(scalar_first(rotation), jnp.array(along_x))))
    letters = order[1:]

    def left(angles):
        made = Rotation.from_euler(letters, angles).as_quat()
        return 1 - (made @ rotation.as_quat()) ** 2

    starts = [(x, y) for x in (-2, 0, 2) for y in (-2, 0, 2)]
    best = min(minimize(left, start, tol=1e-12).fun for start in starts)
    assert left([b, c]) <= best + 1e-9


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(rotation=rotations())
def test_one_slew_leaves_the_least_rotation(rotation):
    angle = float(one_slew(scalar_first(rotation)))
    grid = np.linspace(-np.pi, np.pi, 2001)
    left = [(Rotation.from_euler("X", x).inv() * rotation).magnitude() for x in grid]
    own = (Rotation.from_euler("X", angle).inv() * rotation).magnitude()
    assert own <= min(left) + 1e-9


def test_two_and_one_finish_what_three_began():
    """After an exact first leg the two-slew fit is the rest of the plan, then the one-slew fit."""
    for order, along_x in ORDERS:
        _, b, c = angles = np.array([0.7, -1.1, 2.2])
        first = Rotation.from_euler(order[0], angles[0])
        rest = first.inv() * Rotation.from_euler(order, angles)
        mirror = jnp.array(along_x)
        np.testing.assert_allclose(two_slews(mirrored(scalar_first(rest), mirror)), [b, c])
        last = Rotation.from_euler(order[1], b).inv() * rest
        np.testing.assert_allclose(one_slew(mirrored(scalar_first(last), mirror)), c)


@settings(max_examples=20, deadline=None)
@given(rotation=rotations())
def test_needed_rotation_ends_in_the_orbit_frame(rotation):
    """The body, turned by what is needed, has the attitude of the frame after it has turned."""
    state = form().seen(PlantState(Quaternion(scalar_first(rotation)), jnp.zeros(3)))
    ahead = 500.0
    needed = np.asarray(needed_rotation(planner(), state, jnp.array(ahead)))
    turned = rotation * Rotation.from_quat(needed[[1, 2, 3, 0]])
    frame = Rotation.from_rotvec([0, -ORBIT_RATE * ahead, 0])
    assert (frame.inv() * turned).magnitude() < 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_plan_is_the_quickest(seed):
    """Among all four ways, by times of 2 √(J |angle| / η Tm) a leg."""
    attitude = Rotation.random(random_state=seed)
    state = form().seen(PlantState(Quaternion(scalar_first(attitude)), jnp.zeros(3)))
    law = planner()
    plan = eqx.filter_jit(SlewPlanner.plan)(law, jnp.array(100.0), state)
    end = float(plan.end) - 100
    needed = np.asarray(needed_rotation(law, state, jnp.array(end)))
    durations = []
    for order, (i, j) in (("XYX", (0, 1)), ("YXY", (1, 0))):
        angles = Rotation.from_quat(needed[[1, 2, 3, 0]]).as_euler(order)
        for way in (angles, angles * [1, -1, 1] + np.array([np.pi, 0, np.pi])):
            way = np.abs((way + np.pi) % (2 * np.pi) - np.pi)
            legs = np.sqrt(INERTIA[[i, j, i]] * way / (0.791 * 5))
            durations.append(2 * legs.sum() + 9 / 4.77)
    assert end == pytest.approx(min(durations), abs=0.02)


def test_profile_is_smooth_and_its_deceleration_is_the_share():
    """v and dv/de have no jump where the root joins the line; v dv/de = η Tm / J on the root."""
    law = planner()
    for along_x, inertia in ((True, INERTIA[0]), (False, INERTIA[1])):
        acceleration = 0.791 * 5 / inertia
        join = acceleration / 4.77**2
        for sign in (-1, 1):
            inside = law.reference(jnp.array(sign * join * (1 - 1e-9)), jnp.array(along_x))
            outside = law.reference(jnp.array(sign * join * (1 + 1e-9)), jnp.array(along_x))
            np.testing.assert_allclose(inside, outside, rtol=1e-8)
            rate, slope = law.reference(jnp.array(sign * 1.0), jnp.array(along_x))
            np.testing.assert_allclose(rate * slope, sign * acceleration, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_flight_from_rest_ends_in_the_orbit_frame(seed):
    """From rest in a random attitude, thrusters of 5 N m, in about the time planned."""
    attitude = Rotation.random(random_state=seed)
    start = PlantState(Quaternion(scalar_first(attitude)), jnp.zeros(3))
    loop = SampledLoop(body().with_effectors((actuators(5.0),)), ThreeSlewLaw(planner(), 0.1))
    times = jnp.linspace(0, 150, 1501)
    run = simulate(loop, start, times).signals
    over = int(jnp.argmax(run.mode == slews.Leg.SLEWED))
    planned = float(planner().plan(jnp.array(0.0), form().seen(start)).end)
    assert 0.7 * planned < times[over] < 1.2 * planned + 2
    assert jnp.linalg.norm(run.w[over]) < 0.01
    assert jnp.abs(run.z[over]) < 0.01
    assert jnp.abs(run.omega[:, 2]).max() < 1e-5
    assert jnp.abs(run.torque).max() <= 5.0
