"""What the laws are told of the third axis, and what they make of it, against the rigid body."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from control.cases import ORBIT_RATE, body
from jaxsat.attitude import WZ, Quaternion
from jaxsat.control import FiniteTimeRate, NormalForm, ThirdAxisEstimator, three_slew_settling
from jaxsat.control.estimators import LEAST_TURN
from jaxsat.control.oscillatory import FAR_TURN, HELD_TURN, wanted_turn
from jaxsat.control.supervisor import Phase
from jaxsat.dynamics import PlantState
from jaxsat.inertia import normal_axes

LEANING = np.array([[300.0, 30.0, -20.0], [30.0, 220.0, 15.0], [-20.0, 15.0, 260.0]])
AXES = np.array([[1.0, 0.0], [0.1, 0.9], [-0.2, 0.43]])


def leaning_form():
    directions, _ = np.linalg.qr(AXES)
    axes, _ = normal_axes(LEANING, directions)
    return NormalForm(body(LEANING), axes, np.eye(2))


def told(form, omega):
    """The third axis by the model alone, at the rates (p1, p2, s)."""
    estimator = ThirdAxisEstimator(form, None, None)
    return estimator.update(jnp.array(omega), estimator.init(jnp.array(omega)), jnp.array(0.1))[0]


def slow_change(form, omega):
    """ds/dt of the free body by Euler's equation; no torque about x and y changes s."""
    inertia, (e1, e2) = np.asarray(form.inertia), np.asarray(form.lean)
    p1, p2, s = omega
    whole = np.array([p1, p2, s + e1 * p1 + e2 * p2])
    return np.cross(inertia @ whole, whole)[2] / inertia[2, 2]


def test_change_of_the_slow_rate_is_that_of_the_rigid_body():
    form = leaning_form()
    third = told(form, [0.0, 0.0, 0.0])
    for omega in np.random.default_rng(2).normal(size=(20, 3)):
        change = third.change(jnp.array(omega))
        assert change == pytest.approx(slow_change(form, omega), abs=1e-12)


def test_drift_at_rest_and_its_stiffness_are_those_of_the_turned_body():
    """Euler's equation at the orbit frame's rate, and its change by a small turn about n."""
    form = leaning_form()
    third = told(form, np.asarray(form.rest).tolist())
    inertia, orbit = np.asarray(form.inertia), np.array(form.orbit_rate)

    def drift(turn):
        rate = Rotation.from_rotvec([0, 0, -turn]).apply(orbit)
        return np.cross(inertia @ rate, rate)[2] / inertia[2, 2]

    slope = (drift(1e-6) - drift(-1e-6)) / 2e-6
    assert abs(drift(0.0)) > LEAST_TURN * abs(slope)
    assert third.drift == pytest.approx(drift(0.0), rel=1e-9)
    assert third.stiffness == pytest.approx(slope, rel=1e-6)


def test_a_turn_that_balances_is_wanted_where_it_is_near():
    third = told(leaning_form(), [0.0, 0.0, 0.0])

    def wanted(balanced):
        stiffness = jnp.array(-1e-6)
        return float(wanted_turn(third._replace(drift=-balanced * stiffness, stiffness=stiffness)))

    assert wanted(0.5 * HELD_TURN) == pytest.approx(0.5 * HELD_TURN)
    assert wanted(-3 * HELD_TURN) == pytest.approx(-HELD_TURN)
    assert 0 < wanted(10 * FAR_TURN) < 0.02 * HELD_TURN
    still = third._replace(drift=jnp.array(1e-9), stiffness=jnp.zeros(()))
    assert wanted_turn(still) == 0


def test_the_rate_law_takes_a_direction_in_which_the_slow_rate_falls_quickly():
    """Whatever products it has: by Euler's equation at the references of all directions."""
    form = leaning_form()
    law = FiniteTimeRate(form, 5.0, 0.78, 1.1, 3e-5)
    signs_of = eqx.filter_jit(lambda third, omega: law.signs(third, omega, law.init(_at(omega))))
    directions = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
    for omega in np.random.default_rng(5).uniform(-0.02, 0.02, (20, 3)):
        third = told(form, omega.tolist())
        third = third._replace(rate=jnp.array(omega[2]))
        slopes = np.asarray(law.factors(third.coupling)) * np.cbrt(abs(omega[2]))
        sigma = np.asarray(signs_of(third, jnp.array(omega)).sigma)

        def fall(one, omega=omega, slopes=slopes):
            rates = np.array([*(np.array(one) * slopes), omega[2]])
            return -np.sign(omega[2]) * slow_change(form, rates)

        quickest = max(map(fall, directions))
        assert fall(sigma) > 0.6 * quickest > 0


@pytest.mark.slow
def test_no_phase_is_stayed_in_in_vain():
    """Each guard at either side of its limit."""
    controller = three_slew_settling(body(), 5.0)
    patience, slow = float(controller.patience), float(controller.slow_rate)
    step = eqx.filter_jit(controller.step)

    def phase(begin, t, s, spin=0.05, z=0.0):
        state = PlantState(WZ([0.0, 0.0], z), [spin, -ORBIT_RATE, s])
        memory = controller.init(state)
        slewing = memory.slewing._replace(end=jnp.zeros(()))
        memory = memory._replace(phase=jnp.array(begin), slewing=slewing)
        return int(step(jnp.array(t), state, memory)[1].phase)

    early, late = 0.9 * patience, 1.1 * patience
    assert phase(Phase.STOPPING, early, 0.9 * slow) == Phase.STOPPING
    assert phase(Phase.STOPPING, late, 0.9 * slow) == Phase.SLEWING
    assert phase(Phase.STOPPING, late, 1.1 * slow) == Phase.STOPPING
    assert phase(Phase.SLEWING, early, 1.9 * slow) == Phase.SLEWING
    assert phase(Phase.SLEWING, early, 2.1 * slow) == Phase.STOPPING
    assert phase(Phase.SLEWING, late, 0.0) == Phase.OSCILLATING
    turn = float(controller.late_turn)
    assert phase(Phase.OSCILLATING, early, 0.0, z=1.1 * turn) == Phase.OSCILLATING
    assert phase(Phase.OSCILLATING, late, 0.0, z=0.9 * turn) == Phase.OSCILLATING
    assert phase(Phase.OSCILLATING, late, 0.0, z=1.1 * turn) == Phase.STOPPING


def _at(omega):
    return PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), omega)
