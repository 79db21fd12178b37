"""The ripple filter and the least squares, against exact solutions and batch algebra."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from control.cases import INERTIA, C, form, paper_fit, ripple_filter_of
from jaxsat.control.estimators import ThirdAxisEstimator
from jaxsat.control.ripple import Steady

PERIOD = 0.1
AT_REST = jnp.zeros(3)


@pytest.mark.slow
def test_filter_finds_the_ripple_through_noise():
    """After 40 s, less than a period, with white noise as large as the ripple."""
    size, noise, frequency = 3.2e-5, 2e-5, 0.1
    times = PERIOD * np.arange(401)
    clean = 2e-5 + size * np.cos(frequency * times + 0.4)
    filtering = ripple_filter_of(0.1, noise=noise)

    def run(estimator, measured):
        def one(memory, omega3):
            omega = AT_REST.at[2].set(omega3)
            memory = estimator.advance(memory, omega, jnp.zeros(()), jnp.array(PERIOD))
            return estimator.correct(memory, omega), None

        memory = jax.lax.scan(one, estimator.init(measured[0]), measured)[0]
        return jnp.stack(estimator.believed(memory)[:3])

    draws = jnp.array(np.random.default_rng(5).normal(size=(50, len(times))))
    measured = jnp.array(clean)[None, :] + noise * draws
    found = jax.vmap(lambda x: run(filtering, x))(measured)
    angle = frequency * times[-1] + 0.4
    expected = [clean[-1], size * np.cos(angle), size * np.sin(angle) / frequency]
    np.testing.assert_allclose(found.mean(axis=0), expected, atol=3e-6, rtol=0.12)
    error = jnp.sqrt(jnp.mean((found - jnp.array(expected)[None, :]) ** 2, axis=0))
    assert error[0] < 0.5 * noise


STEADY = Steady(jnp.array(1e-6), jnp.array(1e-18), jnp.array(1e-3))
"""A steady acceleration of 1e-6 rad/s² is expected and does not change."""


@pytest.mark.parametrize("steady", [None, STEADY])
def test_filter_is_the_batch_estimate(steady):
    """Without drift: weighted least squares for mean, ripple, quadrature and acceleration."""
    filtering = ripple_filter_of(0.1, drift=1e-15, steady=steady)
    omega3 = np.random.default_rng(1).normal(size=30) * 3e-5
    memory = filtering.init(jnp.array(omega3[0]))
    for value in omega3[1:]:
        omega = AT_REST.at[2].set(value)
        memory = filtering.advance(memory, omega, jnp.zeros(()), jnp.array(PERIOD))
        memory = filtering.correct(memory, omega)
    ago = 0.1 * PERIOD * np.arange(29, -1, -1)
    rows = np.stack([np.ones(30), np.cos(ago), np.sin(ago), -ago / 0.1], axis=1) / 1e-5
    # The prior on ripple and quadrature is the same at every angle.
    prior = np.diag([0, 1 / 3e-5, 1 / 3e-5, 1 / 1e-6])
    states = 3 if steady is None else 4
    left = np.vstack([rows, prior])[:, :states]
    batch = np.linalg.lstsq(left, np.append(omega3 / 1e-5, np.zeros(4)), rcond=None)[0]
    np.testing.assert_allclose(memory.state, batch, rtol=1e-6, atol=1e-12)


def test_what_is_believed_of_a_steady_acceleration_does_not_jump():
    """A small change of the estimate changes little: nothing up to 2 sigma, all from 4 on."""
    filtering = ripple_filter_of(0.1, drift=1e-7, steady=STEADY)
    memory = filtering.init(jnp.array(0.0))
    sigma = float(jnp.sqrt(memory.covariance[3, 3]))
    sigmas = np.linspace(-6, 6, 1201)
    states = jnp.zeros((len(sigmas), 4)).at[:, 3].set(sigma * sigmas)
    known = jax.vmap(lambda x: filtering.believed(memory._replace(state=x)).steady)(states)
    known = np.asarray(known) / sigma
    assert np.all(np.diff(known) >= 0)
    assert np.diff(known).max() < 5 * np.diff(sigmas).max()
    np.testing.assert_allclose(known[np.abs(sigmas) <= 2], 0, atol=1e-12)
    beyond = np.abs(sigmas) >= 4
    np.testing.assert_allclose(known[beyond], sigmas[beyond], rtol=1e-12)


def test_a_steady_acceleration_is_learnt_at_rest_and_believed_when_sure():
    """3e-7 rad/s² through noise of 1e-5 rad/s; nothing of it beyond the rate limit."""
    filtering = ripple_filter_of(0.1, drift=1e-7, steady=STEADY)
    times = PERIOD * np.arange(3001)
    noise = np.random.default_rng(2).normal(size=len(times))
    measured = jnp.array(3e-7 * times + 1e-5 * noise)

    def learnt(rate):
        def one(memory, omega3):
            omega = jnp.stack([rate, 0 * rate, omega3])
            memory = filtering.advance(memory, omega, jnp.zeros(()), jnp.array(PERIOD))
            memory = filtering.correct(memory, omega)
            return memory, filtering.believed(memory).steady

        memory, believed = jax.lax.scan(one, filtering.init(measured[0]), measured)
        return memory.state[3], memory.covariance[3, 3], believed

    known, variance, believed = jax.jit(learnt)(jnp.array(0.0))
    assert known == pytest.approx(3e-7, abs=3 * float(jnp.sqrt(variance)))
    assert variance < (3e-8) ** 2
    assert believed[50] == 0
    assert believed[-1] == known
    fast, variance, believed = jax.jit(learnt)(jnp.array(2e-3))
    assert fast == 0
    assert variance == pytest.approx(1e-12)
    assert not jnp.any(believed)


def test_recursive_least_squares_is_the_batch_solution():
    """Against the normal equations with the prior, on data of no special form."""
    fit_by = paper_fit(samples=1)
    rng = np.random.default_rng(0)
    omega = rng.normal(size=(40, 3)) * 0.05
    products = rng.normal(size=(40, 6)) * 1e-2
    products[0] = 0
    update = jax.jit(lambda fit, w, p: fit_by.update(fit, w, p, C * jnp.eye(6)[0]))
    fit = fit_by.init(jnp.array(omega[0]))
    for rates, product in zip(omega, products, strict=True):
        fit = update(fit, jnp.array(rates), jnp.array(product))
    regressors = np.hstack([np.diff(omega[:, :2], axis=0), products[1:]])
    values = np.diff(omega[:, 2]) - C * products[1:, 0]
    information = np.diag(1 / np.array(fit_by.prior) ** 2)
    information = information + regressors.T @ regressors / 2e-5**2
    batch = np.linalg.solve(information, regressors.T @ values / 2e-5**2)
    np.testing.assert_allclose(fit.estimate, batch, rtol=1e-7)
    covariance = fit.covariance.matrix
    np.testing.assert_allclose(covariance, np.linalg.inv(information), rtol=1e-5, atol=1e-16)
    np.testing.assert_array_equal(covariance, covariance.T)  # as what is halved must be


def test_estimate_of_leaning_axes_and_products_of_inertia():
    """Rates integrated by SciPy; ε = M3 M12⁻¹ with M = J⁻¹ A says how the third axis follows.

    All three rates are large, so every product matters, and the law is exact up to noise.
    """
    axes = np.array([[1.02, 0.004], [-0.006, 0.97], [0.01, -0.008]])
    inertia = np.diag(INERTIA * [1.03, 0.98, 1.01])
    inertia[0, 1] = inertia[1, 0] = 2.0
    inertia[0, 2] = inertia[2, 0] = -3.0
    inertia[1, 2] = inertia[2, 1] = 2.5
    inverse = np.linalg.inv(inertia)

    def rate(t, omega):
        torque = axes @ [5 * np.sin(0.3 * t), 4 * np.sin(0.5 * t)]
        return inverse @ (torque - np.cross(omega, inertia @ omega))

    times = PERIOD * np.arange(601)
    run = solve_ivp(rate, (0, 60), [0.02, -0.03, 0.05], t_eval=times, rtol=1e-10, atol=1e-13)
    estimator = ThirdAxisEstimator(form(), None, paper_fit())
    memory = estimator.init(jnp.array(run.y[:, 0]))
    update = jax.jit(lambda m, w: estimator.update(w, m, jnp.array(PERIOD)))
    for omega in run.y.T:
        third, memory = update(memory, jnp.array(omega))
        # What follows from the errors is never older than these.
        along, across = np.asarray(third.products)[:2]
        assert float(third.coupling) == pytest.approx(max(np.hypot(along, 2 * across), 0.2 * C))
        angle = np.arctan2(*np.asarray(third.axes)[::-1])
        assert 2 * angle == pytest.approx(np.arctan2(-2 * across, along))
    effect = inverse @ axes
    lean = effect[2] @ np.linalg.inv(effect[:2])
    np.testing.assert_allclose(third.lean, lean, atol=1e-4)
    moments = np.diag(inertia)
    assert float(third.coupling) == pytest.approx((moments[0] - moments[1]) / moments[2], abs=2e-3)
    # -(ω × Jω) has J12 (ω2² - ω1²) about the third axis.
    assert float(memory.fit.estimate[3]) == pytest.approx(-inertia[0, 1] / moments[2], abs=2e-3)


def test_estimator_without_parts_believes_the_model():
    third, _ = _run_once(ThirdAxisEstimator(form(), None, None))
    assert third.rate == 0.3
    assert float(third.coupling) == pytest.approx(C)
    assert not np.any(third.lean)
    assert third.rate_ripple == third.turn_ripple == 0


def _run_once(estimator):
    now = jnp.array([0.1, 0.2, 0.3])
    return estimator.update(now, estimator.init(now), jnp.array(PERIOD))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ripple_filter_of(0.1, noise=0.0), "`noise` must be positive"),
        (lambda: paper_fit(noise=-1.0), "`noise` must be positive"),
        (lambda: paper_fit(samples=0), "`samples` must be at least 1"),
    ],
)
def test_impossible_estimators_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
