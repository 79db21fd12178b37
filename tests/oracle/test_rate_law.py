"""Checks of the reference program of the rate law (38)-(39)."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helpers.references import DISTURBANCE, INERTIA, RATE, RATES
from oracle import rate_law
from oracle import switched_sampled as sampled


def test_rate_law_reference_numbers():
    run = rate_law.simulate_rate_law([0.0, *RATES], **RATE)
    np.testing.assert_allclose(run.omega[1:], list(RATES.values()), atol=6e-11)
    np.testing.assert_allclose(run.torque[0], (-1866.845, 4462.509), atol=6e-4)
    fine = rate_law.simulate_rate_law(np.linspace(0.0, 1.0, 2001), **RATE)
    assert np.abs(fine.omega[:, 1]).max() == pytest.approx(1.230869, abs=2e-6)


def test_rate_law_with_unmeasured_d3():
    run = rate_law.simulate_rate_law([0.0, 50.0, 63.0], **RATE, **DISTURBANCE)
    assert run.omega[-1, 1] == pytest.approx(8.398e-4, abs=6e-8)
    np.testing.assert_allclose(run.crossings, (31.77488901,), atol=1e-7)


@pytest.mark.parametrize(
    "measured", [(True, True, False), (True, True, True), (False, True, False)]
)
def test_rate_law_through_a_crossing_against_rk4(measured):
    run = rate_law.simulate_rate_law(
        [0.0, 31.5, 31.7, 31.9, 32.2], **RATE, **DISTURBANCE, measured=measured
    )
    assert 31.7 < run.crossings[0] < 31.9
    settings = {**RATE, **DISTURBANCE, "phase": (0.0, 0.0, 0.0), "measured": measured}
    settings.pop("omega0")

    def rhs(t, y):
        return np.array(rate_law.direct_rate(t, y.tolist(), **settings))

    step, y, errors = 1e-4, run.omega[1], {}
    for k in range(7000):
        if k in (2000, 4000):
            errors[k] = np.abs(y - run.omega[k // 2000 + 1]).max()
        y = sampled._rk4(rhs, 31.5 + k * step, y, step)
    errors[7000] = np.abs(y - run.omega[4]).max()
    assert errors[2000] < 1e-12
    assert errors[4000] < 2e-5
    assert errors[7000] < 2e-5


def test_rate_law_does_not_depend_on_its_own_settings(monkeypatch):
    times = np.linspace(0.0, 70.0, 36)
    run = rate_law.simulate_rate_law(times, **RATE, **DISTURBANCE)
    monkeypatch.setattr(rate_law, "SPEED", 0.03)
    monkeypatch.setattr(rate_law, "MAX_STEP", 0.1)
    other = rate_law.simulate_rate_law(times, **RATE, **DISTURBANCE)
    np.testing.assert_allclose(other.omega, run.omega, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(other.crossings, run.crossings, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("inertia", [INERTIA, (264.6, 449.5, 312.5)])
def test_rate_law_reference_derivative_by_finite_differences(inertia):
    for omega3, rate in itertools.product((0.2, -0.03), (0.5, -0.4)):
        step = 1e-7
        after = rate_law.reference(inertia, 5.0, omega3 + step * rate)
        before = rate_law.reference(inertia, 5.0, omega3 - step * rate)
        difference = (np.array(after) - before) / (2 * step)
        exact = rate_law.reference_derivative(inertia, 5.0, omega3, rate)
        np.testing.assert_allclose(exact, difference, rtol=1e-6)
    assert rate_law.reference_derivative(inertia, 5.0, 0.0, 0.3) == (0.0, 0.0)


def regularised_rate(t, y, epsilon, measured_d3):
    """(37)-(39) with |x| as √(x² + ε²) in (38), plain variables, d1 and d2 cancelled."""
    j1, j2, j3 = INERTIA
    d3 = DISTURBANCE["amplitude"][2] * math.sin(0.1 * t)
    o1, o2, x = y
    r = x * x + epsilon**2
    third = ((j1 - j2) * o1 * o2 + d3) / j3
    model = third if measured_d3 else third - d3 / j3
    slope1 = -(r**-0.25) + 0.5 * x * x * r**-1.25
    slope2 = 2.5 * x * r**-0.75
    return (
        -10.0 * (o1 + x * r**-0.25) + slope1 * model,
        -10.0 * (o2 - 5.0 * r**0.25) + slope2 * model,
        third,
    )


@pytest.mark.parametrize("measured_d3", [False, True])
def test_rate_law_through_a_crossing_is_the_limit_of_regularised_laws(measured_d3):
    measured = (True, True, measured_d3)
    run = rate_law.simulate_rate_law([0, 31.5, 31.9], **RATE, **DISTURBANCE, measured=measured)
    for epsilon, bound in ((1e-10, 5e-7), (1e-12, 2e-9), (1e-14, 1e-11)):
        settings = {"rtol": 1e-12, "atol": 1e-16, "max_step": 0.01}
        limit = solve_ivp(
            regularised_rate,
            (31.5, 31.9),
            run.omega[1],
            method="DOP853",
            args=(epsilon, measured_d3),
            **settings,
        )
        np.testing.assert_allclose(limit.y[:, -1], run.omega[2], rtol=0.0, atol=bound)


def test_rate_law_starting_on_zero():
    start = (0.1, -0.11, 0.0)
    run = rate_law.simulate_rate_law([0.0, 0.5], **{**RATE, "omega0": start}, **DISTURBANCE)
    errors = []
    for epsilon in (1e-8, 1e-12):
        limit = solve_ivp(
            regularised_rate,
            (0.0, 0.5),
            start,
            method="DOP853",
            args=(epsilon, False),
            rtol=1e-12,
            atol=1e-15,
        )
        errors.append(np.abs(limit.y[:, -1] - run.omega[1]).max())
    assert errors[1] < 2e-6  # √ε in the start of ω2a
    assert errors[1] < 0.05 * errors[0]
    with pytest.raises(ValueError, match="omega0"):
        rate_law.simulate_rate_law([0.0, 1.0], **{**RATE, "omega0": (0.1, 0.0, 0.0)})
