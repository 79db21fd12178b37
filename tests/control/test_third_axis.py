"""What the laws are told of the third axis, and what they make of it, against the rigid body."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from control.cases import ORBIT_RATE, body
from helpers.compiling import by_machine_code
from jaxsat.control.demands import MorinSamson
from jaxsat.control.drift_holds import balancing, coasting
from jaxsat.control.estimators import MOST_TILT, MOST_TURN, ThirdAxisEstimator, in_body, products_of
from jaxsat.control.fine import SURE_SHARE, Handover
from jaxsat.control.finite_time_rate import FiniteTimeRate
from jaxsat.control.normal_form import NormalForm, NormalState, tilt_of
from jaxsat.control.oscillatory import Oscillation, Oscillator, Slow, turned
from jaxsat.control.presets import three_slew_settling
from jaxsat.control.ripple import RippleFilter
from jaxsat.control.supervisor import Phase
from jaxsat.core.attitude import WZ, Quaternion
from jaxsat.core.inertia import normal_axes
from jaxsat.core.ranges import SETTLED_TURN, SETTLED_W
from jaxsat.spacecraft.dynamics import PlantState

LEANING = np.array([[300.0, 30.0, -20.0], [30.0, 220.0, 15.0], [-20.0, 15.0, 260.0]])
AXES = np.array([[1.0, 0.0], [0.1, 0.9], [-0.2, 0.43]])


def leaning_form(inertia=LEANING, about_n=0.0):
    """Its x and y turned about n from those of the reduced inertia by an angle (rad)."""
    directions, _ = np.linalg.qr(AXES)
    axes, _ = normal_axes(LEANING, directions)
    axes = Rotation.from_rotvec([0, 0, -about_n]).as_matrix() @ axes
    return NormalForm(body(inertia), axes, np.eye(2))


def drift_at(form, turn, gravity_gradient=False):
    """ds/dt at rest in an orbit frame turned by a rotation vector, by Euler's equation."""
    inertia, turned = np.asarray(form.inertia), Rotation.from_rotvec(-np.asarray(turn))
    rate = turned.apply(np.array(form.orbit_rate))
    torque = np.cross(inertia @ rate, rate)
    if gravity_gradient:
        nadir = turned.apply(np.array(form.axes[:, 2]))
        torque = torque + 3 * ORBIT_RATE**2 * np.cross(nadir, inertia @ nadir)
    return torque[2] / inertia[2, 2]


def told(form, omega, gravity_gradient=False):
    """The third axis by the model alone, at the rates (p1, p2, s)."""
    gradient = form.gradient_rate if gravity_gradient else None
    estimator = ThirdAxisEstimator(form, None, None, gradient=gradient)
    return estimator.update(jnp.array(omega), estimator.init(jnp.array(omega)), jnp.array(0.1))[0]


def slow_change(form, omega):
    """ds/dt of the free body by Euler's equation; no torque about x and y changes s."""
    inertia, (e1, e2) = np.asarray(form.inertia), np.asarray(form.lean)
    p1, p2, s = omega
    whole = np.array([p1, p2, s + e1 * p1 + e2 * p2])
    return np.cross(inertia @ whole, whole)[2] / inertia[2, 2]


@pytest.mark.slow
def test_change_of_the_slow_rate_is_that_of_the_rigid_body():
    form = leaning_form()
    third = told(form, [0.0, 0.0, 0.0])
    for omega in np.random.default_rng(2).normal(size=(20, 3)):
        change = third.change(jnp.array(omega))
        assert change == pytest.approx(slow_change(form, omega), abs=1e-12)


@pytest.mark.slow
def test_a_swinging_tilt_leaves_no_ripple_in_the_slow_rate():
    """s of Euler's equation by SciPy, the body swinging about x at rest in the orbit frame.

    A tenth of the ripple is that of the product of the lean and the orbit's rate about n.
    """
    form, frequency, rate = leaning_form(), 0.1, 0.003
    orbit_rate, lean = np.asarray(form.orbit_rate), np.asarray(form.lean)
    rest = drift_at(form, np.zeros(3))  # taken away, as it changes s on and on

    def change(t, y):
        matrix, s = y[:9].reshape(3, 3), y[9]
        p1, p2, _ = orbit_rate @ matrix + np.array([rate * np.sin(frequency * t), 0.0, 0.0])
        relative = [p1, p2, s + lean @ [p1, p2]] - orbit_rate @ matrix
        turning = matrix @ np.cross(relative, np.eye(3)).T
        return [*turning.ravel(), slow_change(form, [p1, p2, s]) - rest]

    swing = Rotation.from_rotvec([-rate / frequency, 0, 0]).as_matrix()
    times = np.linspace(0, 2 * 2 * np.pi / frequency, 41)
    start = [*swing.ravel(), form.rest[2]]
    flown = solve_ivp(change, times[[0, -1]], start, t_eval=times, rtol=1e-9, atol=1e-13).y.T
    attitudes = Rotation.from_matrix(flown[:, :9].reshape(-1, 3, 3)).as_quat(scalar_first=True)
    law = Oscillator(form, MorinSamson(0.01, 1.0), frequency, 0.5, 2.0, 0.1, 1.0)
    estimator = ThirdAxisEstimator(form, None, None, balanced=jnp.array(1.0))
    third, _ = estimator.update(form.rest, estimator.init(form.rest), jnp.array(0.1))
    none = Oscillation(*map(jnp.array, (0.0, 0.0, rate)), jnp.array([1.0, 0.0]))

    @jax.vmap
    def slow_rate(t, q, s):
        return law.slow(t, tilt_of(Quaternion(q)), third._replace(rate=s), none).rate

    found = slow_rate(jnp.array(times), jnp.array(attitudes), jnp.array(flown[:, 9]))
    assert np.ptp(found) < 0.05 * np.ptp(flown[:, 9])


def test_two_products_are_one_about_the_axes_of_the_reduced_inertia():
    """In a frame turned about n the believed axes are those of the frame that is not."""
    form, there = leaning_form(about_n=0.3), leaning_form()
    third = told(form, [0.0, 0.0, 0.0])
    assert third.coupling == pytest.approx(float(there.coupling))
    np.testing.assert_allclose(third.axes, [np.cos(0.3), -np.sin(0.3)], atol=1e-12)
    for p1, p2 in np.random.default_rng(3).normal(size=(5, 2)):
        rates = np.array([*turned(third.axes, jnp.array(p1), jnp.array(p2)), 0.0])
        assert slow_change(form, rates) == pytest.approx(float(third.coupling) * p1 * p2)


@pytest.mark.parametrize("gradient", [False, True])
@pytest.mark.parametrize("share", [1.0, 0.02])
def test_the_nearest_attitude_that_can_be_held_is_wanted(share, gradient):
    """Nearest by how far the laws go: a tilt of `MOST_TILT` of the body's third axis counts as a
    turn of `MOST_TURN` about it or about n.

    The turn goes along the steepest change of the drift by SciPy's rotations, as far as allowed.

    Of an inertia nearer to one whose n is a principal axis, so that the drift is small, all of it.
    """
    round_one = leaning_form().axes
    along = np.asarray(round_one @ LEANING @ round_one.T)
    diagonal = np.asarray(round_one.T @ np.diag(np.diag(along)) @ round_one)
    form = leaning_form(diagonal + share * (LEANING - diagonal))
    third = told(form, np.asarray(form.rest).tolist(), gradient)

    def drift_of(turn):
        return drift_at(form, turn, gradient)

    slope = np.array([(drift_of(e) - drift_of(-e)) / 2e-6 for e in 1e-6 * np.eye(3)])
    units = np.asarray(form.axes) / np.array([MOST_TILT, MOST_TILT, MOST_TURN])
    size = units @ units.T
    size[2, 2] += 1 / MOST_TURN**2 - 1 / np.linalg.inv(size)[2, 2]  # so that n reaches MOST_TURN
    steepest = np.linalg.solve(size, slope)
    needed = -drift_of(np.zeros(3)) * steepest / (slope @ steepest)
    expected = needed * min(1.0, 1 / np.sqrt(needed @ size @ needed))
    np.testing.assert_allclose(third.turn, expected, rtol=1e-6)
    tilt_1, tilt_2, turn = np.asarray(form.axes).T @ expected
    assert np.hypot(tilt_1, tilt_2) < MOST_TILT
    assert abs(turn) < MOST_TURN
    drift = drift_of(expected)
    assert third.drift == pytest.approx(drift, abs=5e-3 * abs(drift_of(np.zeros(3))))
    rest = np.asarray(form.slow(jnp.asarray(third.orbit_rate)))
    np.testing.assert_allclose(third.rest, rest)


def test_gravity_gradient_acts_by_the_products_of_the_orbit():
    """Against its torque in any attitude, the direction to the Earth turned by SciPy."""
    form = leaning_form()
    factors = np.asarray(form.other_products.at[0].add(form.coupling))
    inertia = np.asarray(form.inertia)
    for attitude in Rotation.random(5, rng=np.random.default_rng(4)):
        nadir = attitude.inv().apply(np.array(form.axes[:, 2]))
        torque = 3 * ORBIT_RATE**2 * np.cross(nadir, inertia @ nadir)
        q = Quaternion(jnp.asarray(attitude.as_quat(scalar_first=True)))
        seen = form.slow(in_body(q, form.gradient_rate))
        found = -factors @ np.asarray(products_of(seen))
        assert found == pytest.approx(torque[2] / inertia[2, 2], rel=1e-9)


@pytest.mark.parametrize(("share", "turns"), [(0.5, True), (1.01, False)])
def test_a_drift_that_the_end_game_balances_is_no_reason_to_turn(share, turns):
    form = leaning_form()
    drift = abs(drift_at(form, np.zeros(3)))
    estimator = ThirdAxisEstimator(form, None, None, jnp.array(share * drift))
    third, _ = estimator.update(form.rest, estimator.init(form.rest), jnp.array(0.1))
    assert bool(jnp.any(third.turn != 0)) == turns


class Known(RippleFilter):
    """A filter that knows a steady acceleration (rad/s²) from the start."""

    known: float = 0.0

    def believed(self, memory):
        """That acceleration."""
        return super().believed(memory)._replace(steady=jnp.array(self.known))


@pytest.mark.parametrize("counts", [True, False])
def test_a_steady_acceleration_moves_the_held_attitude(counts):
    """There the drift by Euler's equation and the steady acceleration cancel each other."""
    form = leaning_form()
    first = told(form, np.asarray(form.rest).tolist(), gravity_gradient=True).turn
    known = -drift_at(form, first / 2, gravity_gradient=True)  # balanced at half of that turn
    filter_ = Known(0.1, 1e-5, 1e-5, 1e-7, 0.01, known=float(known))
    estimator = ThirdAxisEstimator(
        form, filter_, None, gradient=form.gradient_rate, balances_steady=counts
    )
    third, _ = estimator.update(form.rest, estimator.init(form.rest), jnp.array(0.1))
    left = drift_at(form, third.turn, gravity_gradient=True) + known
    assert third.drift == pytest.approx(left, abs=2e-2 * abs(known))
    assert bool(abs(left) < 2e-2 * abs(known)) == counts


def test_an_attitude_relative_to_a_turned_frame():
    """Against SciPy's rotations."""
    attitude, turn = Rotation.from_rotvec([0.4, -0.3, 0.9]), np.array([0.02, -0.01, 0.015])
    q = jnp.asarray(attitude.as_quat(scalar_first=True))
    state = NormalState(Quaternion(q), jnp.zeros(3), jnp.zeros(3)).relative_to(jnp.asarray(turn))
    expected = Rotation.from_rotvec(turn).inv() * attitude
    found = Rotation.from_quat(np.asarray(state.attitude.q), scalar_first=True)
    assert (found.inv() * expected).magnitude() < 1e-5  # of the third order in the turn


def test_the_end_game_begins_where_it_can_stop_in_time():
    """A slow rate is stopped within s² / 2a: by the equation of a constant deceleration."""
    handover, upright = Handover(1e-2), tilt_of(WZ([0.0, 0.0], 0.0))

    def works(late, rate, turn, held=0.0):
        slow, a = Slow(jnp.array(rate), jnp.array(turn)), jnp.array(1e-7)
        excess, held = jnp.array([0.0, 0.0, rate]), jnp.array(held)
        return bool(handover(jnp.array(late), upright, slow, excess, a, held))

    within = np.sqrt(2 * 1e-7 * 0.0099)
    assert works(False, within, 0.02)
    assert not works(False, 1.02 * within, 0.02)
    assert works(False, 1.02 * within, -0.02)
    assert not works(False, 0.0, 0.029, held=0.012)
    assert works(True, 1.02 * within, 0.02)
    assert not works(True, within, 0.036)
    assert not works(True, 0.0, 0.03, held=0.016)


@pytest.mark.slow
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
    step = by_machine_code(controller.step)

    def phase(begin, t, s, spin=0.05, z=0.0):
        state = PlantState(WZ([0.0, 0.0], z), [spin, -ORBIT_RATE, s])
        memory = controller.init(state)
        slewing = memory.slewing._replace(end=jnp.zeros(()))
        samples = jnp.array(t / float(controller.period))  # the law's clock counts them
        memory = memory._replace(phase=jnp.array(begin), slewing=slewing, samples=samples)
        return int(step(jnp.array(0.0), state, memory)[1].phase)

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


def test_steering_towards_a_hold_against_a_drift_ends_where_the_rate_is_as_aimed():
    """On the parabola s² = 2 d (A + z), by SciPy, nothing is left to do while |z| is below A.

    The drift is d and what the end game balances.

    Steering the turn, too, takes an oscillation that excludes a hold.
    """
    law, drift = coasting(three_slew_settling(body(), 5.0), 1e-6, 1e-7), 1e-7
    stage = eqx.tree_at(lambda one: one.handover.enter_turn, law.fine, 1e-9)  # never holds
    aim = float(stage.handover.aimed_turn)
    begin = -np.sqrt(2 * drift * 1.9 * aim)
    path = solve_ivp(
        lambda t, y: [y[1], drift], (0, -begin / drift), [0.9 * aim, begin], dense_output=True
    )
    balanced = SURE_SHARE * float(law.form.coupling) * float(stage.holding_amplitude) ** 2 / 2
    third = told(law.form, law.form.rest)._replace(drift=jnp.array(drift + balanced))
    before = stage.init(law.form.rest)
    before = before._replace(hold=before.hold._replace(known=jnp.array(True)))

    @eqx.filter_jit
    def amplitude(stage, turn, rate):
        upright = WZ([0.0, 0.0], turn).as_quaternion()
        state = NormalState(upright, law.form.rest, law.form.orbit_rate)
        after = stage.step(jnp.array(0.0), state, third._replace(rate=rate), before)[2]
        return after.oscillation.amplitude

    quiet = float(stage.holding_amplitude)
    for share in (0.1, 0.5, 0.9):
        turn, rate = (jnp.array(x) for x in path.sol(share * path.t[-1]))
        assert amplitude(stage, turn, rate) < 0.01 * quiet
        assert amplitude(stage, turn, rate - 3e-5) > quiet
    outside = jnp.array(2 * aim), jnp.array(-np.sqrt(2 * drift * 3 * aim))
    assert amplitude(stage, *outside) > 10 * quiet


@pytest.mark.parametrize("acts", [True, False])
def test_only_under_gravity_gradient_errors_of_the_products_are_balanced(acts):
    """The estimate scales with the orbit, and expects the noise of the sensors."""
    law = three_slew_settling(body(), 5.0, gravity_gradient=acts)
    found = balancing(law, 1e-3)
    if not acts:
        assert found is law
        return
    assert found.fine.handover.coasts
    assert found.estimator.balances_steady
    assert float(found.estimator.observer.steady.size) == pytest.approx(0.05 * ORBIT_RATE**2)
    assert float(found.estimator.observer.noise) == 1e-3
    assert float(found.fine.holding_amplitude) == float(law.fine.holding_amplitude)


@pytest.mark.parametrize(
    ("normal", "room"), [((0, 0, 1), 1.0), ((0, -0.6, 0.8), 1.25), ((0.8, 0.6, 0), 1.6)]
)
def test_a_hold_turns_about_n_as_far_as_the_tolerances_allow(normal, room):
    """At the end of its turn |w| and |z| of the body, by SciPy's rotations, are within them; half
    as much again is not. The attitude that is held has two thirds of the turn."""
    plane = np.linalg.svd(np.array([normal], float))[2][1:].T
    inertia = LEANING + np.diag([0, 0, 40.0])
    law = three_slew_settling(body(inertia), 5.0, directions=plane, gravity_gradient=True)
    found = balancing(law, 0.0)
    around, turn = found.fine.handover.around(law.form.axes, jnp.array([0.0, 0.0, 0.01]))
    assert float(turn) == pytest.approx(0.01)
    farthest = float(around.leave_turn)
    against_torque = coasting(law, 0.0, 0.0)
    handover = against_torque.fine.handover
    leave = float(handover.leave_turn)
    assert leave == pytest.approx(room * float(law.fine.handover.leave_turn))
    assert leave <= farthest * (1 + 1e-9)
    assert float(found.estimator.most_turn) == pytest.approx(2 / 3 * leave)
    assert float(handover.aimed_turn) < float(handover.enter_turn) < leave
    # The end of a hold, as seen from an attitude that is held beside the target, is not lost.
    assert leave + MOST_TURN < float(against_torque.late_turn)

    def within(angle):
        q = Rotation.from_rotvec(angle * np.array(normal)).as_quat(scalar_first=True)
        end = Quaternion(jnp.asarray(q)).as_wz()
        return bool((np.linalg.norm(end.w) < SETTLED_W) & (abs(end.z) < SETTLED_TURN))

    assert within(farthest)
    assert not within(1.5 * leave)


def test_slews_of_a_lost_attitude_are_about_the_axes_that_are_believed():
    """About other axes they go on as they began."""
    law = three_slew_settling(body(), 5.0)
    controller = balancing(three_slew_settling(body(), 5.0, gravity_gradient=True), 0.0)
    state = PlantState(WZ([0.1, 0.2], 0.3), [0.0, 0.0, 0.0])
    assert law.init(state).slew_axes is None
    third = told(leaning_form(about_n=0.3), [0.0, 0.0, 0.0])
    stopping = controller.init(state)
    axes = controller.slew_axes(stopping, third)
    np.testing.assert_array_equal(axes, [1.0, 0.0])
    lost = stopping._replace(lost=jnp.array(True))
    np.testing.assert_array_equal(controller.slew_axes(lost, third), third.axes)
    slewing = lost._replace(phase=jnp.array(Phase.SLEWING))
    np.testing.assert_array_equal(controller.slew_axes(slewing, third), [1.0, 0.0])


def _at(omega):
    return PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), omega)
