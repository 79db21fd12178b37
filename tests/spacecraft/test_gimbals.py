"""Control moment gyros: motion against SciPy by total momentum, limits, failures, and steering."""

from itertools import pairwise

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.gimbals import GimbalFailureKind
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive
from jaxsat.spacecraft.distribution import AbstractDistribution, Shares
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.gimbals import ControlMomentGyros, GimbalFailures, GimbalSteering, GyroStates
from jaxsat.spacecraft.spacecraft import Spacecraft

INERTIA = np.array([[5.0, 0.2, -0.1], [0.2, 4.0, 0.3], [-0.1, 0.3, 3.0]])
SKEW = np.deg2rad(54.73)
GIMBAL = np.array([[1, 0, -1, 0], [0, 1, 0, -1], [1, 1, 1, 1]]) * np.array(
    [[np.sin(SKEW)], [np.sin(SKEW)], [np.cos(SKEW)]]
)
SPIN = np.array([[0.0, -1, 0, 1], [1, 0, -1, 0], [0, 0, 0, 0]])
ROTORS = np.array([0.8, 0.7, 0.9, 0.6])
ASKED, LIMIT = np.array([0.3, -0.2, 0.7, 0.1]), 0.5
RATES = np.clip(ASKED, -LIMIT, LIMIT)
OMEGA = np.array([0.03, -0.05, 0.02])
LOCKS, RUNS_DOWN, SLOWING = 6.0, 3.5, 1 / 4.0
ANGLES = np.array([0.2, -0.4, 0.1, 0.9])


def gyros(failing=False):
    kinds = [GimbalFailureKind.LOCKED, GimbalFailureKind.RUN_DOWN]
    events = GimbalFailures([0, 2], [LOCKS, RUNS_DOWN], kinds, [0.0, 1 / SLOWING])
    return ControlMomentGyros(GIMBAL, SPIN, ROTORS, LIMIT, events if failing else None)


class Rates(AbstractDistribution):
    """Gimbals that are asked for the same rates all the time."""

    def __call__(self, t, state, command, effectors):
        return Shares((jnp.asarray(ASKED),))


def stored(t, failing):
    """Σ h of rotors whose angles and momenta are closed forms of time, N m s."""
    until = np.array([min(t, LOCKS) if failing else t, t, t, t])
    angle, momentum = ANGLES + RATES * until, ROTORS.copy()
    if failing:
        momentum[2] *= np.exp(-SLOWING * max(t - RUNS_DOWN, 0.0))
    turned = [
        Rotation.from_rotvec(g * a).apply(s)
        for g, a, s in zip(GIMBAL.T, angle, SPIN.T, strict=True)
    ]
    return momentum @ np.array(turned), angle, momentum


@pytest.mark.slow
@pytest.mark.parametrize("failing", [False, True])
def test_a_body_turns_as_its_total_momentum_has_it(failing):
    """SciPy integrates dL/dt = -ω × L in body axes, with ω = J⁻¹ (L - Σ h)."""
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(gyros(failing),))
    start = PlantState(Quaternion([1.0, 0, 0, 0]), OMEGA, (GyroStates(ANGLES, ROTORS),))
    times = np.linspace(0.0, 12.0, 7)
    loop = ContinuousLoop(body, Coast(), Rates())
    found = simulate(loop, start, times, method=adaptive(1e-11, 1e-12, diffrax.Dopri8()))
    assert int(found.code) == 0

    def rate(t, total):
        return -np.cross(np.linalg.solve(INERTIA, total - stored(t, failing)[0]), total)

    first = INERTIA @ OMEGA + stored(0.0, failing)[0]
    spans, total = [0.0, RUNS_DOWN, LOCKS, 12.0], [first]
    for begin, end in pairwise(spans):
        at = times[(times > begin) & (times <= end)]
        exact = solve_ivp(
            rate, (begin, end), first, "DOP853", rtol=1e-12, atol=1e-13, dense_output=True
        )
        total += list(exact.sol(at).T)
        first = exact.y[:, -1]
    omega = [
        np.linalg.solve(INERTIA, x - stored(t, failing)[0])
        for t, x in zip(times, total, strict=True)
    ]
    np.testing.assert_allclose(found.signals.omega, omega, atol=1e-9)
    own = found.final.plant.effectors[0]
    np.testing.assert_allclose(own.angle, stored(12.0, failing)[1], atol=1e-9)
    np.testing.assert_allclose(own.momentum, stored(12.0, failing)[2], atol=1e-9)
    np.testing.assert_allclose(found.signals.parts["gimbal_rate"][0], RATES)
    turned = Rotation.from_quat(np.asarray(found.signals.quaternion), scalar_first=True)
    inertial = turned.apply(np.array(total))
    np.testing.assert_allclose(inertial, np.tile(inertial[0], (7, 1)), atol=1e-9)


def reach_of(made, state, struck=(False, False)):
    plant = PlantState(Quaternion([1.0, 0, 0, 0]), OMEGA, (state,))
    zero = jnp.zeros(())
    return plant, made.reach(
        zero, plant, state, jnp.array(struck[: made.failure_times.size], bool), zero
    )


def test_reach_is_what_commands_within_their_limits_do():
    made, state = gyros(), GyroStates(ANGLES, ROTORS)
    plant, reach = reach_of(made, state)

    def torque(command):
        return made.effect(made.piece((), command), jnp.zeros(()), plant, state).torque

    rates = 0.4 * jnp.ones(4)
    np.testing.assert_allclose(reach.columns, jax.jacobian(torque)(rates), atol=1e-15)
    np.testing.assert_array_equal(jax.jacobian(torque)(reach.high + 0.1), np.zeros((3, 4)))
    _, left = reach_of(gyros(failing=True), state, (True, True))
    np.testing.assert_array_equal(left.high, [0.0, LIMIT, LIMIT, LIMIT])
    np.testing.assert_array_equal(left.low, -left.high)


def test_steering_makes_a_torque_and_cancels_what_gyros_do_to_a_body_that_turns():
    made, state = gyros(), GyroStates(ANGLES, ROTORS)
    plant, reach = reach_of(made, state)
    steering = GimbalSteering(made, np.ones(4))
    command = np.array([0.1, -0.05, 0.08])
    rates, left = steering(jnp.zeros(()), plant, jnp.asarray(command))
    gyroscopic = np.cross(OMEGA, made.momentum(state))
    np.testing.assert_allclose(reach.columns @ rates - gyroscopic, command, atol=1e-14)
    np.testing.assert_allclose(left, np.zeros(3), atol=1e-14)
    assert (
        np.linalg.norm(rates)
        <= np.linalg.norm(np.linalg.pinv(reach.columns) @ (command + gyroscopic)) * 1.2
    )


def test_of_a_torque_beyond_all_gimbals_the_greatest_part_is_made():
    still = PlantState(Quaternion([1.0, 0, 0, 0]), np.zeros(3), (GyroStates(ANGLES, ROTORS),))
    steering = GimbalSteering(gyros(), np.array([1.0, 1.0, 1.0, 0.0]))
    command = jnp.array([3.0, 1.0, -2.0])
    rates, left = steering(jnp.zeros(()), still, command)
    made = np.asarray(command - left)
    np.testing.assert_allclose(np.cross(made, command), np.zeros(3), atol=1e-12)
    assert made @ np.asarray(command) > 0
    assert np.abs(rates).max() == pytest.approx(LIMIT)
    assert rates[3] == 0


def test_rates_stay_finite_at_a_singular_set_of_angles():
    """All columns lie across the axis z: a torque about it is not made, others are."""
    spin = np.eye(3)[:, [0, 1, 0]]
    flat = ControlMomentGyros(np.outer([0.0, 0.0, 1.0], np.ones(3)), spin, 1.0, 1.0)
    plant = PlantState(Quaternion([1.0, 0, 0, 0]), np.zeros(3), (flat.init(),))
    rates, left = GimbalSteering(flat, np.ones(3))(jnp.zeros(()), plant, jnp.array([0.1, 0.2, 0.3]))
    assert np.all(np.isfinite(rates))
    np.testing.assert_allclose(left[2], 0.3)
    np.testing.assert_allclose(left[:2], np.zeros(2), atol=0.02)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"spin_axes": GIMBAL}, "`spin_axes` must be perpendicular"),
        ({"rotor_momentum": 0.0}, "`rotor_momentum` must be"),
        ({"rate_limit": -1.0}, "`rate_limit` must be"),
        ({"spin_axes": SPIN[:, :3]}, "`spin_axes` must have the shape"),
    ],
)
def test_gyros_that_cannot_be_are_refused(changes, message):
    axes = {"gimbal_axes": GIMBAL, "spin_axes": SPIN}
    arguments = axes | {"rotor_momentum": ROTORS, "rate_limit": LIMIT}
    with pytest.raises(ValueError, match=message):
        ControlMomentGyros(**arguments | changes)
