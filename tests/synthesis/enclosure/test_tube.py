"""Tubes against flights of SciPy and closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import expit

import jaxsat
from enclosures import UNSAFE, contest, flights, layers, slew, three_axis
from jaxsat.control.three_axis import ThreeAxisLaw
from jaxsat.core.attitude import WZ
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import SmallAngleOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft


def contest_rate(x, u):
    """As in CORA's `dynamics_attitudeControl`, for columns."""
    w1, w2, w3, p1, p2, p3 = x
    xi = p1**2 + p2**2 + p3**2
    return np.array([
        0.25 * (u[0] + w2 * w3),
        0.5 * (u[1] - 3 * w1 * w3),
        u[2] + 2 * w1 * w2,
        0.5 * (w2 * (xi - p3) + w3 * (xi + p2) + w1 * (xi + 1)),
        0.5 * (w1 * (xi + p3) + w3 * (xi - p1) + w2 * (xi + 1)),
        0.5 * (w1 * (xi - p2) + w2 * (xi + p1) + w3 * (xi + 1)),
    ])  # fmt: skip


def contest_command(x):
    *hidden, (weights, biases) = layers()
    for one, shift in hidden:
        x = expit(one.astype(float) @ x + shift.astype(float)[:, None])
    return weights.astype(float) @ x + biases.astype(float)[:, None]


@pytest.fixture(scope="module")
def tube():
    return jaxsat.enclose(*contest())


def test_the_contests_loop_is_proved_to_avoid_the_unsafe_set(tube):
    assert tube.is_finite
    assert tube.avoids(UNSAFE)


@pytest.mark.slow
def test_flights_of_the_contests_loop_are_in_the_tube(tube):
    """2,000 random starts, at all samples, and between them in the boxes of their time."""
    low, high = contest().start
    count, pieces = 2000, 4
    x = np.random.default_rng(1).uniform(low, high, (count, 6)).T
    for number in range(30):
        u = contest_command(x)

        def rate(_, flat, u=u):
            return contest_rate(flat.reshape(6, -1), u).ravel()

        times = np.linspace(0, 0.1, 4 * pieces + 1)
        run = solve_ivp(rate, (0, 0.1), x.ravel(), "DOP853", times, rtol=1e-12, atol=1e-13)
        states = run.y.reshape(6, count, -1)
        for piece in range(pieces):
            part, row = states[:, :, 4 * piece : 4 * piece + 5], number * pieces + piece
            np.testing.assert_allclose(tube.piece_times[row], 0.1 * number + 0.025 * piece)
            assert (part >= tube.piece_lower[row][:, None, None]).all()
            assert (part <= tube.piece_upper[row][:, None, None]).all()
        x = states[:, :, -1]
        assert (x >= tube.lower[number + 1][:, None]).all()
        assert (x <= tube.upper[number + 1][:, None]).all()


@pytest.mark.slow
def test_the_tube_of_the_contests_loop_is_narrow(tube):
    states = flights(contest())
    assert ((states >= tube.lower[:, None]) & (states <= tube.upper[:, None])).all()
    assert ((tube.upper - tube.lower) / np.ptp(states, axis=1)).max() < 1.05


def test_a_box_that_flights_hit_is_not_avoided(tube):
    x = np.mean(contest().start, axis=0)[:, None]
    for _ in range(15):
        u = contest_command(x)
        run = solve_ivp(lambda _, x, u=u: contest_rate(x[:, None], u)[:, 0], (0, 0.1), x[:, 0])
        x = run.y[:, -1:]
    near = (x[:, 0] - 1e-3, x[:, 0] + 1e-3)
    assert not tube.avoids(near)
    assert tube.avoids((near[0] + 0.1, near[1] + 0.1))


LINEAR = {
    "oscillator": (
        np.array([[0.0, 1.0], [-4.0, -0.1]]),
        np.eye(2, 1, -1),
        np.array([[-1.0, -0.5]]),
    ),
    "unstable": (
        np.array([[0.1, 1.0, 0, 0], [-1.0, 0.1, 0.3, 0], [0, 0, 0, 1.0], [0.2, 0, -2.0, -0.2]]),
        np.array([[0, 0], [1.0, 0], [0, 0], [0, 0.5]]),
        np.array([[0.1, -0.2, 0, 0.1], [0, 0.3, -0.1, -0.4]]),
    ),
}


@pytest.mark.parametrize("name", LINEAR)
def test_linear_loops(name):
    """The tube contains the image of the box, which is known, and is hardly wider."""
    a, b, gain = LINEAR[name]
    size, period = len(a), 0.2
    low = np.linspace(0.5, 1.0, size)
    tube = jaxsat.enclose(
        lambda x, u: a @ x + b @ u, lambda x: gain @ x, (low, low + 0.1), period, 50, order=10
    )
    blocks = np.block([[a, b], [np.zeros((b.shape[1], size + b.shape[1]))]])
    held = expm(period * blocks)[:size]
    step = held[:, :size] + held[:, size:] @ gain
    power = np.eye(size)
    for lower, upper in zip(tube.lower, tube.upper, strict=True):
        center, reach = power @ (low + 0.05), np.abs(power).sum(1) * 0.05
        off = 1e-13 * np.abs(power).sum()
        assert (lower <= center - reach + off).all()
        assert (upper >= center + reach - off).all()
        assert (upper - lower <= 2 * reach * (1 + 1e-6) + 1e-9).all()
        power = step @ power


def test_a_disturbance_may_change_at_any_time():
    """A double integrator under a torque of either sign, for which the worst is known."""
    limit, gain, period, periods = 0.1, np.array([-1.0, -1.5]), 0.1, 60
    tube = jaxsat.enclose(
        lambda x, u, d: jnp.stack([x[1], u[0] + d[0]]),
        lambda x: (gain @ x)[None],
        ([1.0, 0.0], [1.0, 0.0]),
        period,
        periods,
        disturbance=([-limit], [limit]),
    )
    step = np.array([[1, period], [0, 1]]) + np.outer([period**2 / 2, period], gain)
    middle, later, reach = np.array([1.0, 0.0]), np.eye(2), np.zeros(2)
    fractions = (np.arange(200) + 0.5) / 200 * period
    for lower, upper in zip(tube.lower, tube.upper, strict=True):
        assert (lower <= middle - 0.999 * reach).all()
        assert (upper >= middle + 0.999 * reach).all()
        assert (upper - lower <= 2 * reach * 1.08 + 1e-9).all()
        effect = np.stack([fractions, np.ones(200)])  # of the torque, at the end of its period
        reach = reach + limit * np.abs(later @ effect).mean(1) * period
        middle, later = step @ middle, step @ later


@pytest.mark.slow
def test_a_slew_under_quaternion_feedback():
    """10,000 flights of 100 s from a box of 0.01, and at most 1.5 times their spread."""
    loop = slew()
    tube, states = jaxsat.enclose(*loop), flights(loop)
    assert ((states >= tube.lower[:, None]) & (states <= tube.upper[:, None])).all()
    assert ((tube.upper - tube.lower) / np.ptp(states, axis=1)).max() < 1.5
    assert (tube.upper[-1] - tube.lower[-1]).max() < 1e-6


def test_a_limited_command_and_a_relay():
    """A corner and a jump of the controller; flights by exact steps."""
    period = 0.2
    for command in (
        lambda x: jnp.clip(-2 * x[:1] - x[1:], -0.3, 0.3),
        lambda x: -0.2 * jnp.sign(x[:1]),
    ):
        start = (np.array([0.2, 0.0]), np.array([0.25, 0.01]))
        tube = jaxsat.enclose(lambda x, u: jnp.stack([x[1], u[0]]), command, start, period, 12)
        assert tube.is_finite
        x = np.random.default_rng(2).uniform(*start, (2000, 2))
        for lower, upper in zip(tube.lower, tube.upper, strict=True):
            assert (x >= lower - 1e-15).all()
            assert (x <= upper + 1e-15).all()
            u = np.asarray(jax.vmap(command)(x))[:, 0]
            x = np.stack([x[:, 0] + period * x[:, 1] + period**2 / 2 * u, x[:, 1] + period * u], 1)


def test_the_tube_ends_at_a_corner_of_the_dynamics_and_where_the_state_escapes():
    def command(x):
        return jnp.zeros(1)

    friction = jaxsat.enclose(lambda x, u: -jnp.sign(x), command, ([0.9], [1.1]), 0.25, 8)
    assert np.isfinite(friction.upper[:3]).all()
    assert not np.isfinite(friction.upper[5:]).any()
    assert not friction.is_finite
    assert not friction.avoids(([50.0], [60.0]))
    escape = jaxsat.enclose(lambda x, u: x**2, command, ([1.0], [1.0]), 0.25, 8, order=9)
    np.testing.assert_allclose(escape.upper[3, 0], 4, rtol=1e-2)
    assert escape.upper[3, 0] >= 4 >= escape.lower[3, 0]
    assert not np.isfinite(escape.upper[4:]).any()


def test_derivatives_that_a_function_declares_are_not_believed():
    @jax.custom_jvp
    def square(x):
        return x**2

    square.defjvp(lambda primals, tangents: (square(*primals), jnp.zeros_like(primals[0])))
    tube = jaxsat.enclose(lambda x, u: -square(x), lambda x: x, ([1.0], [1.0]), 0.1, 20, order=6)
    assert tube.lower[-1, 0] <= 1 / 3 <= tube.upper[-1, 0]
    assert tube.upper[-1, 0] - tube.lower[-1, 0] < 1e-3


def test_the_three_axis_loop_is_that_of_the_law():
    loop = three_axis()
    body = Spacecraft([449.5, 264.6, 312.5])
    model = RigidBody(body, SmallAngleOrbit(0.0011), third_rate_held=True)
    gains = (0.0622, 0.232, 0.341, jnp.array([48.9, 521.0]))
    law = ThreeAxisLaw(model, *gains, None, 2.41, saturation_width=1.0, tilt_width=0.0201)
    for x in np.random.default_rng(4).normal(size=(5, 5)):
        state = PlantState(WZ(x[:2], x[2]), jnp.array([*x[3:], 0.0]))
        torque = law(jnp.zeros(()), state, None)[0]
        np.testing.assert_allclose(loop.controller(x), torque, rtol=1e-12, atol=1e-11)
        turning = state.attitude.rate(model.relative_rate(state))
        rate = model.angular_acceleration(state.omega, jnp.append(torque, 0.0))
        expected = np.concatenate([turning.w, turning.z[None], rate[:2]])
        np.testing.assert_allclose(loop.dynamics(x, torque), expected, rtol=1e-12, atol=1e-14)


def test_a_start_must_be_a_box():
    with pytest.raises(ArgumentError, match="start"):
        jaxsat.enclose(lambda x, u: -x, lambda x: x, ([1.0], [0.0]), 0.1, 1)


JUMPS = {
    "sign": lambda x, u: -jnp.sign(x),
    "where": lambda x, u: jnp.where(x > 0, -1.0, -0.1),
    "truth": lambda x, u: -(x > 0).astype(float),
    "floor": lambda x, u: jnp.floor(x) - 0.5,
    "maximum": lambda x, u: jnp.maximum(x, 0.0) - 0.5,
}


@pytest.mark.parametrize("name", JUMPS)
def test_a_tube_ends_where_dynamics_jump_within_a_period(name):
    """No sample is at the jump, and all derivatives at the samples are those of one side."""
    tube = jaxsat.enclose(JUMPS[name], lambda x: 0 * x, ([0.1], [0.2]), 1.0, 1)
    assert not tube.is_finite
    assert not tube.avoids(([-0.01], [0.01]))


def test_the_real_derivatives_of_a_rate_that_stops_gradients_are_used():
    tube = jaxsat.enclose(
        lambda x, u: -(jax.lax.stop_gradient(x) ** 2), lambda x: 0 * x, ([1.0], [1.0]), 0.1, 20
    )
    assert tube.lower[-1, 0] <= 1 / 3 <= tube.upper[-1, 0]
    assert tube.upper[-1, 0] - tube.lower[-1, 0] < 1e-4


REFUSED = {
    "int": lambda x: x.astype(int) * 1.0,
    "bool": lambda x: jnp.where(x.astype(bool), 1.0, 0.0),
    "bfloat16": lambda x: x.astype(jnp.bfloat16).astype(float),
    "and": lambda x: x * (jnp.array([6]) & jnp.sign(x).astype(bool)),
    "div": lambda x: x * jax.lax.div(jnp.argsort(x), jnp.array([2])),
}


@pytest.mark.parametrize("name", REFUSED)
def test_whole_numbers_and_few_bits_are_not_taken_for_real_ones(name):
    with pytest.raises(ArgumentError, match="function"):
        jaxsat.enclose(lambda x, u: u, REFUSED[name], ([0.6], [0.7]), 1.0, 1)


@pytest.mark.parametrize(
    ("changes", "name"),
    [({"pieces": 0}, "pieces"), ({"periods": 0}, "periods"), ({"order": 0}, "order"),
     ({"period": -1.0}, "period"), ({"disturbance": ([1.0], [-1.0])}, "disturbance")],
)  # fmt: skip
def test_arguments_of_which_a_tube_would_say_nothing_are_refused(changes, name):
    given = {"start": ([0.1], [0.2]), "period": 1.0, "periods": 1} | changes
    with pytest.raises(ArgumentError, match=name):
        jaxsat.enclose(lambda x, *u: sum(u), lambda x: 0 * x, **given)
