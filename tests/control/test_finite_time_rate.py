"""The finite-time rate law: its bound, its torque, and a flight with limited thrusters."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from control.cases import INERTIA, C, actuators, body, form, paper_disturbance
from control.laws import FiniteTimeRateLaw, time_to_zero
from jaxsat.control.estimators import ThirdAxis, ThirdAxisEstimator
from jaxsat.control.finite_time_rate import FiniteTimeRate
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState

LIMIT, SHARE = 5.0, 0.779


def law(model=None, limit=LIMIT):
    return FiniteTimeRate(model or form(), limit, SHARE, 1.12, 3e-5)


def known(omega3, c=C):
    zero = jnp.zeros(())
    products = jnp.zeros(6).at[0].set(c)
    still = jnp.zeros(3)
    axes = jnp.array([1.0, 0.0])
    return ThirdAxis(
        jnp.array(omega3),
        jnp.zeros(2),
        jnp.array(c),
        axes,
        zero,
        zero,
        products,
        still,
        still,
        still,
        zero,
    )


@pytest.mark.slow
@pytest.mark.parametrize("omega3", [0.1, -0.03])
def test_tracked_references_bring_the_third_rate_to_the_dead_zone_in_the_time_said(omega3):
    """dω3/dt = c ω1d ω2d by SciPy, to 1e-5 of the dead zone after the time and not before."""
    rate_law, omega = law(), jnp.array([0.02, -0.01, omega3])
    signs = rate_law.signs(known(omega3), omega, rate_law.init(_state(omega)))

    def rate(t, y):
        r1, r2 = np.asarray(rate_law.tracking(known(y[0]), omega, signs).rate)
        return [C * r1 * r2]

    end = float(time_to_zero(rate_law, jnp.array(omega3), jnp.array(C)))
    run = solve_ivp(rate, (0, end), [omega3], rtol=1e-8, atol=1e-12, t_eval=[0.9 * end, end])
    assert abs(run.y[0, -1]) == pytest.approx(3e-5, rel=1e-3)
    # After the fraction x of the time the cube root has fallen to 1 - x of its start.
    assert abs(run.y[0, 0]) - 3e-5 == pytest.approx(0.1**3 * (abs(omega3) - 3e-5), rel=1e-3)


def test_references_ask_for_the_share_of_the_torque():
    """While tracked, J_i dω_id/dt is η Tm about both axes, whatever ω3."""
    rate_law = law()
    for omega3 in (0.1, 0.01, -0.02):
        rates = jnp.array([0.001, 0.001, omega3])
        signs = rate_law.signs(known(omega3), rates, rate_law.init(_state(rates)))
        reached = rate_law.tracking(known(omega3), rates, signs).rate
        omega = jnp.array([*reached, omega3])
        assert C * omega[0] * omega[1] * omega3 < 0
        derivative = rate_law.tracking(known(omega3), omega, signs).derivative
        np.testing.assert_allclose(np.abs(derivative) * INERTIA[:2], SHARE * LIMIT, rtol=1e-9)
        step = 1e-6
        later = omega3 + step * C * float(omega[0] * omega[1])
        change = (rate_law.tracking(known(later), omega, signs).rate - reached) / step
        np.testing.assert_allclose(change, derivative, rtol=1e-4)


@pytest.mark.slow
def test_signs_are_those_nearer_to_the_present_rates_and_stay():
    rate_law = law()
    a, b = np.asarray(rate_law.factors(jnp.array(C)))
    j1, j2, _ = INERTIA
    rng = np.random.default_rng(3)
    for omega in rng.uniform(-0.1, 0.1, (20, 3)):
        begin = rate_law.init(_state(omega))
        signs = rate_law.signs(known(omega[2]), jnp.array(omega), begin)
        pairs = [(s, -s * np.sign(omega[2])) for s in (1, -1)]
        gap = [j1 * (omega[0] - s1 * a) ** 2 + j2 * (omega[1] - s2 * b) ** 2 for s1, s2 in pairs]
        np.testing.assert_array_equal(signs.sigma, pairs[int(np.argmin(gap))])
        kept = rate_law.signs(known(omega[2] / 2), -jnp.array(omega), signs)
        np.testing.assert_array_equal(kept.sigma, signs.sigma)
        crossed = rate_law.signs(known(-omega[2]), jnp.array(omega), signs)
        assert crossed.sigma[0] * crossed.sigma[1] == np.sign(omega[2])


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [INERTIA, INERTIA[[1, 0, 2]]])
def test_flight_stops_all_rates(inertia):
    """Either sign of c, 5 N m, d1 and d2 unknown: within the bound plus the time to catch up."""
    model = form(inertia)
    third_axis = ThirdAxisEstimator(model, None, None)
    controller = FiniteTimeRateLaw(law(model), third_axis, 0.1)
    plant = body(inertia, disturbance=paper_disturbance(third=False))
    omega = np.array([0.1, -0.09, 0.08])
    times = jnp.linspace(0, 60, 601)
    run = simulate(
        SampledLoop(plant.with_effectors((actuators(LIMIT),)), controller), _state(omega), times
    ).signals
    c = jnp.array((inertia[0] - inertia[1]) / inertia[2])
    bound = float(time_to_zero(controller.law, jnp.array(0.08), c))
    # The time a full torque needs to turn the first rates round bounds the catching up.
    peak = np.asarray(controller.law.factors(c)) * 0.1 ** (1 / 3) + 0.1
    catching_up = float(np.max(peak * inertia[:2]) / LIMIT)
    small = jnp.abs(run.omega[:, 2]) < 4.5e-5
    assert times[jnp.argmax(small)] < bound + catching_up
    assert jnp.abs(run.omega[-1]).max() < 2e-4
    assert jnp.abs(run.torque).max() <= LIMIT


def _state(omega):
    return PlantState(Quaternion([1.0, 0, 0, 0]), omega)
