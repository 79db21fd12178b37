"""Wheels: their equation, their edges in closed form, and how a command is shared among them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels
from oracle.gyrostat import wheel_motion, wheel_torque

LIMITS = {"torque_limit": 0.2, "momentum_limit": 1.0}
FRICTION = {"rotor_inertia": 0.01, "viscous_friction": 5e-4, "coulomb_friction": 0.002}


def wheel(**changes):
    return Wheels([[1.0], [0.0], [0.0]], **(LIMITS | FRICTION | changes))


edges_of = jax.jit(lambda w, h, c, period: w.edges(WheelMomenta(h), c, period))
piece_of = jax.jit(lambda w, h, c, elapsed: w.held_piece(WheelMomenta(h), c, elapsed))


@jax.jit
def torque_of(wheels, momentum, command):
    """The torque of each wheel at one instant on a body that turns evenly."""
    state, even = WheelMomenta(momentum), jnp.zeros(3)
    mode = wheels.mode(state)
    for _ in range(wheels.mode_passes):
        mode = wheels.mode_after(mode, state, command, even)
    return wheels.axis_torque(wheels.piece(mode, command), state, even)


def followed(h, command, period, given):
    """The oracle's momentum at the end, and its edges, by tiny exact pieces of its own."""
    from scipy.integrate import solve_ivp

    t, edges = 0.0, []
    while t < period:
        motion = wheel_motion(h, command, given)

        def rate(t, y, motion=motion):
            return [-wheel_torque(y[0], command, given, motion)]

        targets = []
        if motion not in ("stuck", "limited"):
            targets = [x for x in (0.0, 1.0, -1.0) if x != h]
            targets = [x for x in targets if x or h]
        events = []
        for target in targets:
            event = lambda t, y, target=target: y[0] - target  # noqa: E731
            event.terminal, event.target = True, target
            events.append(event)
        run = solve_ivp(
            rate, (t, period), [h], method="DOP853", rtol=1e-13, atol=1e-15, events=events
        )
        t, h = run.t[-1], run.y[0, -1]
        for event, times in zip(events, run.t_events or [], strict=True):
            if len(times):
                h = event.target
                edges.append(times[0])
    return h, edges


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.one_of(st.floats(-1, 1), st.sampled_from([0.0, 1.0, -1.0])),
    st.one_of(st.floats(-0.3, 0.3), st.sampled_from([0.0, 0.002, -0.002, 0.0019, 0.0021])),
    st.sampled_from([0.5, 8.0, 40.0]),
)
def test_edges_and_momentum_between_them_are_those_of_the_equation(h, command, period):
    """Against SciPy's events, which share no code; between edges the piece's ODE is solved here."""
    if 0 < abs(h) < 1e-9 or 0 < abs(abs(h) - 1) < 1e-9:
        return  # where the oracle's events resolve nothing
    one = wheel()
    given_wheel = {
        "torque_limit": 0.2,
        "momentum_limit": 1.0,
        "inertia": 0.01,
        "viscous": 5e-4,
        "coulomb": 0.002,
    }
    expected, met = followed(h, command, period, given_wheel)
    found = np.array(edges_of(one, jnp.array([h]), jnp.array([command]), jnp.array(period)))
    assert found.shape == (2,)
    assert np.all((found >= 0) & (found <= period))
    inside = sorted(t for t in found if 0 < t < period)
    np.testing.assert_allclose(inside, [t for t in met if t < period], atol=1e-9)
    momentum, t = h, 0.0
    for end in [*sorted(found), period]:
        middle = jnp.array((t + end) / 2)
        piece = piece_of(one, jnp.array([h]), jnp.array([command]), middle)
        drive, decay, length = float(piece.drive[0]), float(piece.decay[0]), end - t
        grown = -drive * length if decay == 0 else drive / decay * np.expm1(-decay * length)
        momentum, t = momentum * np.exp(-decay * length) + grown, end
    assert momentum == pytest.approx(expected, abs=1e-11)


@given(st.floats(-1.2, 1.2), st.floats(-0.3, 0.3))
def test_the_torque_at_an_instant_is_that_of_the_piece_there(h, command):
    one, momentum, asked = wheel(), jnp.array([h]), jnp.array([command])
    piece = piece_of(one, momentum, asked, jnp.array(0.0))
    np.testing.assert_allclose(torque_of(one, momentum, asked), piece.torque(momentum), atol=1e-15)


def test_momenta_are_exact_where_a_wheel_comes_to_rest_or_its_limit():
    """Rounding in their place would turn at 1e-300 N m s against friction."""
    one, begin, command = wheel(viscous_friction=None), jnp.array([0.5]), jnp.array([0.1])
    rest, limit = jnp.sort(edges_of(one, begin, command, jnp.array(100.0)))
    reached = jnp.array([3e-17])

    def snapped(elapsed, momentum):
        return one.snapped(WheelMomenta(begin), command, elapsed, WheelMomenta(momentum)).momentum

    assert snapped(rest, reached) == 0
    assert snapped(limit, reached - 1.0 + 1e-15) == -1
    assert snapped((rest + limit) / 2, reached) == reached


@pytest.mark.slow
def test_a_hand_computed_braking():
    """From 0.5 N m s at -(0.1 + 0.002) N m to rest in 0.5/0.102 s, then to -1 in 1/0.098 s."""
    one = wheel(viscous_friction=None)
    found = edges_of(one, jnp.array([0.5]), jnp.array([0.1]), jnp.array(100.0))
    np.testing.assert_allclose(found, [0.5 / 0.102, 0.5 / 0.102 + 1 / 0.098], rtol=1e-14)
    viscous = edges_of(
        wheel(coulomb_friction=None), jnp.array([0.5]), jnp.array([-0.1]), jnp.array(100.0)
    )
    # dh/dt = 0.1 - 0.05 h: h = 2 - 1.5 exp(-t/20), which is 1 at 20 ln 1.5
    np.testing.assert_allclose(viscous, [20 * np.log(1.5)], rtol=1e-14)


def test_a_wheel_at_its_limit_takes_no_torque_that_would_raise_its_momentum():
    one = wheel(coulomb_friction=None, viscous_friction=None)
    for h in (1.0, -1.0):
        momentum = jnp.array([h])
        assert torque_of(one, momentum, jnp.array([-0.1 * h])) == 0
        assert torque_of(one, momentum, jnp.array([0.1 * h])) == pytest.approx(0.1 * h)
        assert edges_of(one, momentum, jnp.array([-0.1 * h]), jnp.array(9.0)) == 0


def test_wheels_without_friction_and_limits_have_no_edges():
    free = Wheels(np.eye(3))
    assert free.edge_count == free.event_count == 0
    assert edges_of(free, jnp.zeros(3), jnp.ones(3), jnp.array(1.0)).shape == (0,)
    some = Wheels(np.eye(3), momentum_limit=[1.0, np.inf, 2.0])
    found = edges_of(some, jnp.array([0.0, 9.0, 0.0]), -jnp.ones(3), jnp.array(5.0))
    np.testing.assert_allclose(found, [1.0, 5.0, 2.0])


@pytest.mark.slow
def test_the_instant_of_an_edge_has_its_derivative():
    def instant(h, command):
        return edges_of(wheel(), h[None], command[None], jnp.array(100.0))

    h, command, step = jnp.array(0.5), jnp.array(0.1), 1e-6
    by_jax = jax.jacfwd(instant, argnums=(0, 1))(h, command)
    for found, (dh, dc) in zip(by_jax, ((step, 0), (0, step)), strict=True):
        slope = (instant(h + dh, command + dc) - instant(h - dh, command - dc)) / (2 * step)
        np.testing.assert_allclose(found, slope, rtol=1e-7)
    unlimited = Wheels(np.eye(3), momentum_limit=[1.0, np.inf, 2.0], coulomb_friction=1e-3)
    slopes = jax.jacrev(lambda h: edges_of(unlimited, h, jnp.zeros(3), jnp.array(1.0)))(
        jnp.zeros(3)
    )
    assert np.all(np.isfinite(slopes))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"axes": [[1.0], [0.0]]}, "shape"),
        ({"axes": np.zeros((3, 1))}, "zero column"),
        ({"axes": np.eye(3), "torque_limit": 0.0}, "torque_limit"),
        ({"axes": np.eye(3), "coulomb_friction": -1.0}, "coulomb_friction"),
        ({"axes": np.eye(3), "viscous_friction": 1e-3}, "rotor_inertia"),
    ],
)
def test_mistakes_are_told(arguments, said):
    with pytest.raises(ValueError, match=said):
        Wheels(**arguments)


PYRAMID = np.array([[1, -1, -1, 1], [1, 1, -1, -1], [1, 1, 1, 1]]) / np.sqrt(3)


wheels_of = eqx.filter_jit(lambda distribution, command: distribution.wheels(command))
"""What wheels are asked for, one compiled program for distributions alike."""


def test_a_command_is_shared_by_least_squares_and_keeps_its_direction():
    command = jnp.array([0.3, -0.2, 0.1])
    limits = np.array([1.0, 0.05, 1.0, 1.0])
    shared = WheelsFirst.of(PYRAMID, 3, wheel_limit=limits.tolist())
    u = np.array(wheels_of(shared, command))
    expected = limits * (np.linalg.pinv(PYRAMID * limits) @ np.asarray(command))
    np.testing.assert_allclose(u, expected, atol=1e-15)
    assert expected[3] * 2.4 > limits[3]
    u = np.array(wheels_of(shared, 2.4 * command))
    assert u[3] == limits[3]
    rest = np.linalg.solve(PYRAMID[:, :3], 2.4 * np.array(command) - PYRAMID[:, 3] * u[3])
    np.testing.assert_allclose(u[:3], rest, atol=1e-14)
    assert shared.rest is None
    weak = WheelsFirst.of(PYRAMID, 3, wheel_limit=[0.01, 0.05, 0.01, 0.01])
    u = np.array(wheels_of(weak, command))
    np.testing.assert_allclose(np.cross(PYRAMID @ u, command), 0, atol=1e-16)
    assert (PYRAMID @ u) @ np.array(command) > 0
    one_failed = WheelsFirst.of(PYRAMID, 3, failed=(2,))
    u = np.array(wheels_of(one_failed, command))
    assert u[1] == 0
    np.testing.assert_allclose(PYRAMID @ u, command, atol=1e-15)


def test_what_wheels_cannot_make_is_left_to_thrusters():
    thrusters = Actuators.of(Thrusters(np.eye(3)), torques=3)
    wheels = Wheels(PYRAMID[:, :2])

    def left(distribution, command):
        told = PlantState(Quaternion([1.0, 0, 0, 0]), np.zeros(3))
        uses = distribution(jnp.zeros(()), told, command, (thrusters, wheels)).uses
        np.testing.assert_array_equal(uses[1], distribution.wheels(command))
        return uses[0]

    two = np.array([[1.0, 0.6], [0.0, 0.8], [0.0, 0.0]])
    mixed = WheelsFirst.of(two, 3, others=True)
    command = jnp.array([0.3, -0.2, 0.1])
    np.testing.assert_allclose(two @ mixed.wheels(command), [0.3, -0.2, 0], atol=1e-15)
    np.testing.assert_allclose(left(mixed, command), [0, 0, 0.1], atol=1e-15)
    with pytest.raises(ValueError, match="x, y and z"):
        WheelsFirst.of(two, 3)
    everything = WheelsFirst.of(two, 2, others=True)
    np.testing.assert_allclose(two @ everything.wheels(command[:2]), [0.3, -0.2, 0])
    assert not left(everything, command[:2]).any()
    none_left = WheelsFirst.of(two, 3, failed=(1, 2), others=True)
    np.testing.assert_allclose(left(none_left, command), command)
    plane = np.array([[1, -0.5, -0.5], [0, 0.75**0.5, -(0.75**0.5)], [0, 0, 0]])
    redundant = WheelsFirst.of(plane, 2)
    np.testing.assert_allclose(plane @ redundant.wheels(command[:2]), [0.3, -0.2, 0])


thrust_of = eqx.filter_jit(lambda actuators, command: actuators(command))


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.1, 1.0, 3.0])
def test_actuators_are_their_smooth_piece_where_their_event_functions_say_so(size):
    thrusters = Actuators.of(Thrusters(np.eye(3)), 0.02, torques=3)
    mixed = WheelsFirst.of(np.eye(3)[:, :2], 3, wheel_limit=0.1, others=True)
    command = size * jnp.array([0.11, 0.12, 0.03])
    events = mixed.event_functions(command)
    assert events.shape == (mixed.event_count,) == (2,)
    piece = mixed.smooth_piece(events > 0)
    np.testing.assert_allclose(wheels_of(piece, command), wheels_of(mixed, command))
    at_limits = thrusters.smooth_piece(thrusters.event_functions(None, command, None) > 0)
    np.testing.assert_allclose(thrust_of(at_limits, command), thrust_of(thrusters, command))
    spare = WheelsFirst.of(PYRAMID, 3, wheel_limit=[0.1, 0.02, 0.1, 0.1])
    piece = spare.smooth_piece(spare.event_functions(command) > 0)
    np.testing.assert_array_equal(wheels_of(piece, command), wheels_of(spare, command))
