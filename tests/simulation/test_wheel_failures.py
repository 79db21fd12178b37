"""Wheels that fail inside a period, against an independent program; what they had is conserved."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.methods import fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels, wheel_momentum
from oracle import gyrostat
from simulation.test_wheels import (
    AXES,
    INERTIA,
    MOMENTA,
    OMEGA,
    PERIOD,
    PERIODS,
    ROTOR,
    SHARED,
    VISCOUS,
    WHEELS,
    Waves,
    asked,
)

NEVER = (np.inf, 0, "dead", 0.0)
FAILURES = {
    "dead": [(7.3, 0, "dead", 0.0), NEVER],
    "degraded": [(7.3, 0, "degraded", 0.3), NEVER],
    "stopped": [(7.3, 1, "stopped", 0.0), NEVER],
    "friction by a factor": [(7.3, 0, "friction-by", 8.0), NEVER],
    "friction to a level": [(7.3, 0, "friction-to", 0.1), NEVER],
    "runaway": [(1.3, 1, "runaway", 0.0), NEVER],
    "runaway, then stopped": [(3.21, 2, "runaway", 0.0), (9.87, 2, "stopped", 0.0)],
    "stopped, then free again": [(5.1, 1, "stopped", 0.0), (8.7, 1, "degraded", 0.5)],
    "friction up, then dead": [(2.3, 0, "friction-by", 8.0), (7.3, 0, "dead", 0.0)],
    "two in a period, one as it begins": [(4.0, 2, "degraded", 0.5), (4.02, 1, "stopped", 0.0)],
}
"""(time, wheel, kind, amount); of as many events each, so that all are one program."""


def failures_of(events):
    at, wheel, kind, amount = zip(*events, strict=True)
    kinds = [WheelFailureKind[one.upper().replace("-", "_")] for one in kind]
    return WheelFailures(wheel, at, kinds, amount)


def loop_of(events, delay=None):
    limits, friction = [0.15, 0.2, np.inf], [0.02, 0.005, 0.05]
    wheels = Wheels(AXES, 0.25, limits, ROTOR, VISCOUS, friction, failures_of(events))
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,))
    return SampledLoop(body, Waves(PERIOD), SHARED, 4, delay=delay)


START = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA, (WheelMomenta(MOMENTA),))


def flown(loop):
    method = fixed(PERIOD, diffrax.Dopri8())
    return simulate(loop, START, np.arange(PERIODS + 1) * PERIOD, method=method).signals


def expected(commands, events, period=PERIOD):
    rows, _ = gyrostat.fly(
        np.eye(3),
        OMEGA,
        MOMENTA,
        commands,
        period,
        inertia=INERTIA,
        axes=AXES,
        wheels=WHEELS,
        external=lambda t: np.zeros(3),
        failures=events,
    )
    return rows


@pytest.mark.slow
def test_wheels_fail_at_their_true_instants_and_keep_the_total_momentum():
    commands = asked(loop_of([NEVER, NEVER]))
    sound = expected(commands, ())
    for name, events in FAILURES.items():
        found, rows = flown(loop_of(events)), expected(commands, events)
        np.testing.assert_allclose(found.omega, rows[:, 9:12], atol=1e-12, err_msg=name)
        momentum = np.asarray(found.parts["wheel_momentum"])
        np.testing.assert_allclose(momentum, rows[:, 12:], atol=1e-12, err_msg=name)
        assert np.abs(rows - sound).max() > 1e-3, name
        torque = np.asarray(found.torque) - np.asarray(found.parts["wheel_torque"]) @ AXES.T
        np.testing.assert_allclose(torque, 0, atol=1e-15)
        q = np.roll(np.asarray(found.quaternion), -1, axis=1)
        total = np.asarray(found.omega) @ INERTIA + momentum @ AXES.T
        total = Rotation.from_quat(q).apply(total)
        drift = np.abs(total - total[0]).max() / np.linalg.norm(total[0])
        assert drift < 1e-12, name
        at_the_end = {which: kind for _, which, kind, _ in events}
        struck = {which for which, kind in at_the_end.items() if kind == "stopped"}
        for which in struck:
            assert np.all(momentum[20:, which] == 0)


@pytest.mark.slow
def test_a_failure_strikes_on_either_side_of_a_delay():
    """Commands change at 7.3 s; the failure is before, at and after that instant."""
    for at in (7.2, 7.3, 7.4):
        events = [(at, 0, "dead", 0.0), (at + 1.0, 1, "stopped", 0.0)]
        loop = loop_of(events, delay=PERIOD * 0.6)
        found, commands = flown(loop), asked(loop)
        before = np.vstack([np.zeros((1, 3)), commands[:-1]])
        # five parts of a period, of which the first three still have the command before
        parts = np.stack([before, before, before, commands, commands], axis=1).reshape(-1, 3)
        rows = expected(parts, events, PERIOD / 5)[::5]
        np.testing.assert_allclose(found.omega, rows[:, 9:12], atol=1e-12)
        np.testing.assert_allclose(found.parts["wheel_momentum"], rows[:, 12:], atol=1e-12)


def test_what_a_wheel_does_after_each_failure():
    """The condition by hand: a wheel of 0.2 N m that is asked for 0.1 N m at ±0.5 N m s.

    The body's inertia is so large that rotors of wheels that are held need no torque to turn with.
    """
    wheels = Wheels(np.eye(3), 0.2, 1.0, 0.01, 1e-3, 0.004)
    asked, momentum = jnp.full(3, 0.1), jnp.array([0.5, -0.5, 0.0])

    @jax.jit
    def torques(number, kind, amount, t):
        events = WheelFailures(*(x[None] for x in (number, t * 0 + 10, kind, amount)))
        failing = eqx.tree_at(lambda w: w.failures, wheels, events, is_leaf=lambda x: x is None)
        body = RigidBody(Spacecraft(1e20 * np.eye(3)), ExactOrbit(0.0), effectors=(failing,))
        state = PlantState(Quaternion([1.0, 0, 0, 0]), OMEGA, (WheelMomenta(momentum),))
        return made(body, state, jnp.array([False]), t), made(body, state, t >= events.at, t)

    def made(body, state, struck, t):
        """The torque of each wheel once failures have struck."""
        state = body.after_failures(state, (struck,))
        body, commands = body.driven(state, (asked,), (struck,))
        pieces = body.pieces(body.modes(t, state, commands), commands)
        acceleration = body.acceleration(t, state, pieces=pieces)
        return body.signals(state, pieces, acceleration)["wheel_torque"]

    def torque(kind, amount=0.0, number=0):
        event = [jnp.array(float(x)) for x in (number, kind, amount)]
        sound, before = torques(*event, jnp.array(9.999))
        np.testing.assert_array_equal(sound, before)
        np.testing.assert_allclose(sound, [0.154, 0.046, 0.096], rtol=1e-14)
        return float(torques(*event, jnp.array(10.0))[1][number])

    kinds = WheelFailureKind
    assert torque(kinds.DEAD) == pytest.approx(0.054)  # friction alone
    assert torque(kinds.DEAD, number=2) == pytest.approx(0, abs=1e-15)  # it rests
    assert torque(kinds.DEGRADED, 0.25) == pytest.approx(0.079)
    assert torque(kinds.STOPPED) == pytest.approx(0, abs=1e-15)
    assert torque(kinds.FRICTION_BY, 3.0) == pytest.approx(0.262)
    assert torque(kinds.FRICTION_TO, 0.01, 1) == pytest.approx(0.04)
    assert torque(kinds.RUNAWAY) == pytest.approx(-0.146)
    assert torque(kinds.RUNAWAY, number=1) == pytest.approx(0.146)
    assert torque(kinds.RUNAWAY, number=2) == pytest.approx(-0.196)
    assert torque(kinds.DEGRADED + 0.4, 0.25, 1) == pytest.approx(-0.029)  # as a study draws them


def test_the_momentum_of_a_wheel_that_stops_goes_into_the_body():
    stops = WheelFailures([0, 2, 1], [0, 0, 0], [WheelFailureKind.STOPPED] * 3, [0, 0, 0])
    body = RigidBody(
        Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(Wheels(AXES, failures=stops),)
    )
    state = PlantState(Quaternion([1.0, 0, 0, 0]), OMEGA, (WheelMomenta(MOMENTA),))
    struck = jnp.array([True, True, False])
    after = body.after_failures(state, (struck,))
    np.testing.assert_allclose(
        body.total_momentum(after), body.total_momentum(state), rtol=0, atol=1e-16
    )
    np.testing.assert_array_equal(wheel_momentum(after), [0, MOMENTA[1], 0])
    gained = INERTIA @ (np.asarray(after.omega) - OMEGA)
    np.testing.assert_allclose(gained, AXES[:, 0] * MOMENTA[0], atol=1e-16)
    again = body.after_failures(after, (struck,))
    np.testing.assert_array_equal(again.omega, after.omega)


def test_a_wheel_that_stops_leaves_the_momenta_of_other_rotors_as_they_are():
    """About one axis by hand: J = 4, rotors of 0.3 and 0.1 kg m², of which the first stops."""
    stops = WheelFailures([0], [0], [WheelFailureKind.STOPPED], [0])
    axes = np.array([[1.0, 1.0], [0, 0], [0, 0]])
    wheels = Wheels(axes, rotor_inertia=[0.3, 0.1], failures=stops)
    body = RigidBody(Spacecraft([4.0, 3.0, 3.0]), ExactOrbit(0.0), effectors=(wheels,))
    state = PlantState(Quaternion([1.0, 0, 0, 0]), [0.5, 0.0, 0.0], (WheelMomenta([0.6, -0.2]),))
    after = body.after_failures(state, (jnp.array([True]),))
    kick = 0.6 / (4.0 - 0.1)
    np.testing.assert_allclose(after.omega, [0.5 + kick, 0, 0], rtol=1e-14)
    np.testing.assert_allclose(wheel_momentum(after), [0.0, -0.2 - 0.1 * kick], rtol=1e-14)
    again = body.after_failures(after, (jnp.array([True]),))
    np.testing.assert_array_equal(again.omega, after.omega)
