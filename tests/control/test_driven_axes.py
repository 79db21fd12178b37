"""The fit of the driven axes, against Euler's equations by SciPy and against batch algebra."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.control.driven_axes import DrivenFit, DrivenMemory, FittedDynamics
from jaxsat.control.normal_form import NormalForm
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft

PERIOD, LIMIT, SAMPLES = 0.1, 5.0, 5
BELIEVED = np.array([[450.0, 8.0, -5.0], [8.0, 260.0, 6.0], [-5.0, 6.0, 310.0]])
TRUE = np.array([[480.0, 4.0, -1.0], [4.0, 245.0, 8.0], [-1.0, 8.0, 325.0]])
"""kg m²."""

GAINS = np.array([[1.08, 0.01], [-0.015, 0.93], [0.012, -0.017]])
"""From commanded torques about body x and y to those that act: gains and misaligned axes."""


def fit():
    form = NormalForm.of(RigidBody(Spacecraft(jnp.asarray(BELIEVED)), ExactOrbit(0.0)))
    return DrivenFit(form, LIMIT, 3e-5, samples=SAMPLES)


def true_acceleration(omega, command):
    return np.linalg.solve(TRUE, GAINS @ command - np.cross(omega, TRUE @ omega))


def flight(count):
    """Rates at every sample, and the commands about body x and y that are held from then on."""
    draws, omega = np.random.default_rng(3), np.array([0.12, -0.15, 0.2])
    commands = np.repeat(draws.uniform(-LIMIT, LIMIT, (count // 20 + 1, 2)), 20, axis=0)[:count]
    rates = []
    for command in commands:
        rates.append(omega)
        flown = solve_ivp(
            lambda t, y, command=command: true_acceleration(y, command),
            (0, PERIOD),
            omega,
            rtol=1e-11,
            atol=1e-13,
        )
        omega = flown.y[:, -1]
    return np.array(rates), commands


def fitted(rates, commands) -> tuple[DrivenFit, DrivenMemory]:
    chosen = fit()
    to_xy = np.asarray(chosen.form.to_command).T

    def one(memory, row):
        number, omega, command = row
        state = PlantState(Quaternion(jnp.eye(4)[0]), omega)
        memory = chosen.sampled(number * PERIOD, state, memory, jnp.array(PERIOD))
        return memory._replace(torque=to_xy @ command), None

    first = chosen.init(chosen.form.slow(chosen.form.axes @ jnp.asarray(rates[0])))
    rows = (jnp.arange(len(rates)), jnp.asarray(rates), jnp.asarray(commands))
    return chosen, jax.jit(lambda: jax.lax.scan(one, first, rows)[0])()


@pytest.mark.slow
def test_the_fit_tells_what_torques_and_rates_do():
    """Along x and y, within a fifth of what the model errs by."""
    chosen, memory = fitted(*flight(300))
    axes, model = np.asarray(chosen.form.axes), chosen.form.model
    correction = FittedDynamics(chosen.form, chosen, None, chosen.believed(memory))
    draws, errors, left = np.random.default_rng(4), [], []
    for _ in range(8):
        omega, command = 0.06 * draws.normal(size=3), draws.uniform(-LIMIT, LIMIT, 2)
        torque = jnp.asarray(np.append(command, 0.0))
        told = model.angular_acceleration(jnp.asarray(omega), torque)
        true = axes[:2] @ true_acceleration(omega, command)
        errors.append(axes[:2] @ np.asarray(told) - true)
        left.append(axes[:2] @ np.asarray(correction(jnp.asarray(omega), torque, told)) - true)
    assert np.linalg.norm(left) < 0.2 * np.linalg.norm(errors)


def test_the_third_axis_is_left_alone():
    """n·Jω changes as the model has it whatever the errors of the driven axes."""
    chosen = fit()
    errors = jnp.asarray(np.random.default_rng(1).normal(size=(2, 8))) * chosen.prior
    omega, torque = jnp.array([0.03, -0.05, 0.04]), jnp.array([3.0, -2.0, 0.0])

    @jax.jit
    def accelerations(errors, omega, torque):
        told = chosen.form.model.angular_acceleration(omega, torque)
        return told, FittedDynamics(chosen.form, chosen, None, errors)(omega, torque, told)

    told, corrected = accelerations(errors, omega, torque)
    assert np.abs(np.asarray(corrected - told)).max() > 1e-4
    momentum = np.asarray(chosen.form.axes)[2] @ BELIEVED
    np.testing.assert_allclose(momentum @ np.asarray(corrected - told), 0.0, atol=1e-12)


def test_recursion_is_the_least_squares_of_all_intervals():
    """Against NumPy, whose sums over intervals are those of the definition."""
    rates, commands = flight(26)
    chosen, memory = fitted(rates, commands)
    form = chosen.form
    axes, reduced = np.asarray(form.axes), np.asarray(form.reduced_inertia)
    third = axes[2] @ BELIEVED @ axes[2]
    s = rates @ (BELIEVED @ axes[2]) / third
    rows = np.stack([rates @ axes[0], rates @ axes[1], s], axis=1)
    torques = commands @ np.asarray(form.to_command)

    def products(v):
        x, y, z = v
        return np.array([x * y, x**2 - y**2, y * z, x * z, x**2 + y**2, z**2])

    def simpson(f, a, b):
        return (f(a) + 4 * f((a + b) / 2) + f(b)) * PERIOD / 6

    def gyroscopic(v):
        omega = np.linalg.solve(np.stack([axes[0], axes[1], axes[2] @ BELIEVED / third]), v)
        change = np.linalg.solve(BELIEVED, -np.cross(omega, BELIEVED @ omega))
        return axes[:2] @ change

    regressors, sides = [], []
    for begin in range(0, 25, SAMPLES):
        steps = range(begin, begin + SAMPLES)
        pushed = sum(np.linalg.solve(reduced, torques[k]) * PERIOD for k in steps)
        squares = sum(simpson(products, rows[k], rows[k + 1]) for k in steps)
        known = sum(simpson(gyroscopic, rows[k], rows[k + 1]) for k in steps)
        regressors.append(np.concatenate([pushed, squares]))
        sides.append(rows[begin + SAMPLES, :2] - rows[begin, :2] - pushed - known)
    regressors, sides = np.array(regressors), np.array(sides)
    unknown = np.linalg.solve(reduced, [LIMIT, LIMIT]) * 0.002 * SAMPLES * PERIOD
    noise = np.sqrt(2 * 3e-5**2 + unknown**2)
    for axis, (prior, sigma) in enumerate(zip(np.asarray(chosen.prior), noise, strict=True)):
        stacked = np.concatenate([regressors / sigma, np.diag(1 / prior)])
        sought = np.concatenate([sides[:, axis] / sigma, np.zeros(8)])
        expected = np.linalg.lstsq(stacked, sought, rcond=None)[0]
        np.testing.assert_allclose(memory.errors[axis], expected, rtol=1e-6, atol=1e-9)


def test_estimates_keep_near_the_prior():
    chosen = fit()
    memory = chosen.init(jnp.zeros(3))._replace(errors=jnp.full((2, 8), 9.0))
    np.testing.assert_allclose(chosen.believed(memory), 3 * chosen.prior)


def test_numbers_out_of_range_are_refused():
    with pytest.raises(ValueError, match="samples"):
        DrivenFit(fit().form, LIMIT, 3e-5, samples=0)
    with pytest.raises(ValueError, match="rate_noise"):
        DrivenFit(fit().form, LIMIT, 0.0)
