"""The normal form: exact for any inertia and any two torques, and the laws on other failures."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from control.cases import INERTIA, ORBIT_RATE, body, paper_fit
from jaxsat.control.estimators import ThirdAxisEstimator
from jaxsat.control.normal_form import NormalForm
from jaxsat.core.allocation import direction_matrix, torque_directions
from jaxsat.core.attitude import Quaternion
from jaxsat.core.inertia import normal_axes
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.dynamics import PlantState

SETTLING = ("oscillatory", "three-slew")


def any_inertia(rng):
    """Symmetric and positive definite, moments from 0.1 to 10."""
    turned = Rotation.random(random_state=rng).as_matrix()
    return turned @ np.diag(10 ** rng.uniform(-1, 1, 3)) @ turned.T


def any_axes(rng):
    """Two unit torque axes, at least 10 degrees apart."""
    while True:
        axes = rng.normal(size=(3, 2))
        axes = axes / np.linalg.norm(axes, axis=0)
        if abs(axes[:, 0] @ axes[:, 1]) < np.cos(np.radians(10)):
            return axes


@jax.jit
def told(inertia, axes, omega, torque):
    """What the normal form says of ds/dt and d(p1, p2)/dt, and (p1, p2, s)."""
    made = NormalForm(body(inertia), axes, jnp.eye(2))
    seen = made.seen(PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), omega)).omega
    p1, p2, s = seen
    zero = jnp.zeros(())
    products = jnp.stack([p1 * p2, p1**2 - p2**2, p2 * s, p1 * s, zero, zero])
    slow = made.coupling * products[0] + jnp.sum(made.other_products * products)
    acceleration = jnp.linalg.solve(made.reduced_inertia, torque + made.gyroscopic_torque(seen))
    return seen, jnp.append(acceleration, slow), made.reduced_inertia, made.lean


@pytest.mark.slow
def test_identity_on_random_bodies():
    """Against J⁻¹(Au - ω × Jω) of 2,000 random inertias, torque axes, rates and torques."""
    rng, count = np.random.default_rng(1), 2000
    inertias = np.array([any_inertia(rng) for _ in range(count)])
    torque_axes = [any_axes(rng) for _ in range(count)]
    omegas, thrusts = rng.normal(size=(count, 3)), rng.normal(size=(count, 2))
    pairs = zip(inertias, torque_axes, strict=True)
    frames = np.array([normal_axes(j, torque_directions(axes))[0] for j, axes in pairs])
    torques = np.einsum("kij,kjm,km->ki", frames[:, :2], np.array(torque_axes), thrusts)
    found = jax.vmap(told)(inertias, frames, omegas, torques)
    for k, (seen, change, reduced, lean) in enumerate(zip(*map(np.asarray, found), strict=True)):
        inertia, axes, omega, (x, y, n) = inertias[k], torque_axes[k], omegas[k], frames[k]
        np.testing.assert_allclose(frames[k] @ frames[k].T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose([n @ np.cross(x, y), *(n @ axes)], [1, 0, 0], atol=1e-12)
        rate = np.linalg.solve(inertia, axes @ thrusts[k] - np.cross(omega, inertia @ omega))
        own = n @ inertia / (n @ inertia @ n)
        np.testing.assert_allclose(seen, [x @ omega, y @ omega, own @ omega], atol=1e-12)
        np.testing.assert_allclose(n @ omega, seen[2] + lean @ seen[:2], atol=1e-11)
        scale = np.linalg.norm(rate) + 1
        np.testing.assert_allclose(change, [x @ rate, y @ rate, own @ rate], atol=1e-12 * scale)
        assert abs(reduced[0, 1]) < 1e-12 * reduced[0, 0]
        assert reduced[0, 0] >= reduced[1, 1] > 0


@pytest.mark.parametrize("seed", range(4))
def test_motion_in_normal_form(seed):
    """(p1, p2, s) integrated by SciPy on their own are those of the body."""
    rng = np.random.default_rng(seed)
    inertia, axes = any_inertia(rng), any_axes(rng)
    form = NormalForm.of(body(inertia), torque_directions(axes))
    frame = np.asarray(form.axes)
    omega = rng.normal(size=3)

    def thrust(t):
        return np.array([np.sin(t), np.cos(2 * t)])

    def of_body(t, omega):
        return np.linalg.solve(inertia, axes @ thrust(t) - np.cross(omega, inertia @ omega))

    def normal(t, state):
        made = state @ np.vstack([frame[:2], np.zeros(3)])
        made = made + frame[2] * (state[2] + np.asarray(form.lean) @ state[:2])
        return np.asarray(told(inertia, frame, made, frame[:2] @ axes @ thrust(t))[1])

    options = {"rtol": 1e-10, "atol": 1e-12}
    start = np.asarray(told(inertia, frame, omega, np.zeros(2))[0])
    end = solve_ivp(of_body, (0, 2), omega, **options).y[:, -1]
    found = solve_ivp(normal, (0, 2), start, **options).y[:, -1]
    exact = np.asarray(told(inertia, frame, end, np.zeros(2))[0])
    np.testing.assert_allclose(found, exact, atol=1e-7)


def test_the_papers_layout_is_its_own_normal_form():
    form = NormalForm.of(body())
    np.testing.assert_array_equal(form.axes, np.eye(3))
    np.testing.assert_array_equal(form.moments, INERTIA)
    np.testing.assert_array_equal(form.rest, [0, -ORBIT_RATE, 0])
    assert not np.any(form.lean)
    assert not np.any(form.other_products)


@pytest.mark.parametrize("seed", range(20))
def test_commands_make_the_torque_that_is_meant(seed):
    """Law, allocation and thrusters together: v1 x + v2 y, for any two torque axes."""
    rng = np.random.default_rng(seed)
    axes = any_axes(rng)
    directions = torque_directions(axes)
    form = NormalForm.of(body(any_inertia(rng)), directions)
    meant = rng.normal(size=2)
    command = np.asarray(form.command(jnp.array(meant)))
    made = axes @ direction_matrix(axes, directions) @ command
    np.testing.assert_allclose(made, meant @ np.asarray(form.axes)[:2], atol=1e-12)


def test_a_frame_turned_about_n_is_the_same_plant():
    """It sees the same state, feels the same gyroscopic torque and makes the same commands."""
    rng = np.random.default_rng(8)
    form = NormalForm.of(body(any_inertia(rng)), torque_directions(any_axes(rng)))
    axes = jnp.array([np.cos(0.7), np.sin(0.7)])
    turn = Rotation.from_rotvec([0, 0, -0.7]).as_matrix()
    other = form.turned(axes)
    np.testing.assert_allclose(other.inertia, turn @ form.inertia @ turn.T, atol=1e-12)
    q = Quaternion(jnp.asarray(Rotation.random(rng=rng).as_quat(scalar_first=True)))
    state = PlantState(q, rng.normal(size=3))
    seen, expected = form.seen(state).turned(axes), other.seen(state)
    np.testing.assert_allclose(seen.omega, expected.omega, atol=1e-12)
    np.testing.assert_allclose(seen.attitude.q, expected.attitude.q, atol=1e-12)
    np.testing.assert_allclose(seen.frame_rate, expected.frame_rate, atol=1e-12)
    torque = form.gyroscopic_torque(form.seen(state).omega)
    turned = turn[:2, :2] @ np.asarray(torque)
    np.testing.assert_allclose(other.gyroscopic_torque(seen.omega), turned, atol=1e-12)
    np.testing.assert_allclose(other.command(jnp.asarray(turned)), form.command(torque), atol=1e-12)


@pytest.mark.parametrize("failed", [0, 1, 2])
def test_directions_of_body_axes_are_body_axes(failed):
    """The two left, in cyclic order, exactly."""
    kept = [(failed + 1) % 3, (failed + 2) % 3]
    np.testing.assert_array_equal(
        torque_directions(np.delete(np.eye(3), failed, axis=1)), np.eye(3)[:, kept]
    )


def test_one_axis_has_no_plane():
    with pytest.raises(ValueError, match="two independent axes"):
        torque_directions(np.array([[1.0, -1.0], [0, 0], [0, 0]]))


def test_axes_renamed_are_the_same_law():
    """The frame and moments of a body with renamed axes, orbit rate included."""
    renamed = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # x, y, z become y, z, x
    inertia = renamed @ np.diag(INERTIA) @ renamed.T
    here = NormalForm.of(body())
    there = NormalForm.of(body(inertia), renamed[:, :2])
    np.testing.assert_allclose(there.axes @ renamed, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(there.moments, here.moments)
    # The orbit rate stays along the second body axis, which is another one in the frame.
    assert float(jnp.abs(there.orbit_rate[1])) == 0


def test_products_of_inertia_are_known_from_the_start():
    """ε and the products of the model enter the estimate's start, not its errors."""
    inertia = np.diag(INERTIA) + 40 * (np.ones((3, 3)) - np.eye(3))
    form = NormalForm.of(body(inertia))
    estimator = ThirdAxisEstimator(form, None, paper_fit())
    seen = jnp.array([0.02, -0.01, 0.005])
    third, _ = eqx.filter_jit(estimator.update)(seen, estimator.init(seen), jnp.array(0.1))
    np.testing.assert_allclose(third.lean, form.lean)
    assert np.abs(np.asarray(form.lean)).max() > 0.1
    assert float(third.coupling) == pytest.approx(float(form.coupling))


def settled(law, count, *overrides):
    scenario = load("acceptance-hard", [f"control.law={law}", *overrides])
    return np.isfinite(
        build_study(scenario, count, seed=5).evaluate(np.arange(count)).settling_time
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
@pytest.mark.parametrize("law", SETTLING)
@pytest.mark.parametrize(
    "override", ["spacecraft.failed_thrusters=[2]", "orbit.rate_rad_s=0", "orbit.rate_rad_s=7.3e-5"]
)
def test_with_any_orbit_rate_about_n_it_settles(law, override):
    """Orbit rate along n, none, and that of a geostationary orbit."""
    assert settled(law, 100, override).mean() >= 0.98


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_the_first_thruster_may_fail():
    """c = 0.107; dispersions of 10 % leave some bodies that nothing can steer, c = 0."""
    assert settled("three-slew", 100, "spacecraft.failed_thrusters=[1]").mean() >= 0.95


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_gyroscopic_torque_beyond_the_thrusters_is_not_asked_for():
    """One where the stopping phase spun the body up."""
    overrides = (
        "spacecraft.inertia_kg_m2=[9000,7000,4000]",
        "spacecraft.torque_limit_N_m=20",
        "simulation.duration_s=2000",
    )
    assert settled("three-slew", 50, *overrides).all()
