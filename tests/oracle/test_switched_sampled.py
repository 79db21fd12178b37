"""Checks of the reference program of the sampled switching loop."""

import math

import numpy as np
import pytest

from helpers.references import DISTURBANCE, INERTIA, THREE_AXIS
from oracle import rate_law
from oracle import switched_sampled as sampled
from oracle import three_axis_law as three

SAMPLED = {
    "inertia": INERTIA,
    "k1": 0.457,
    "k2": 0.201,
    "k3": 0.187,
    "mu": 0.791,
    "a": 0.0514,
    "k4": (0.363 * 449.5, 0.363 * 264.6),
    "enter": 7.9e-3,
    "leave": 1.4e-3,
    "attitude_weight": 0.914,
    "slope_limit_three_axis": (25.0 / 449.5, 25.0 / 264.6),
    "slope_limit_rate": (5.0 / 449.5, 5.0 / 264.6),
    "torque_limit": 5.0,
    "w0": (-1.0, 1.0),
    "z0": 1.27,
    "orbit_rate": 0.0011,
    **DISTURBANCE,
}


def test_switching_and_limits():
    run = sampled.simulate_switched_sampled(
        **SAMPLED, omega0=(0.05, -0.04, 0.03), period=0.1, steps=600, substeps=1
    )
    size = np.abs(run.omega[:-1, 2])
    mode = sampled.THREE_AXIS
    for k in range(600):
        if size[k] > 7.9e-3:
            mode = sampled.RATE
        elif size[k] < 1.4e-3:
            mode = sampled.THREE_AXIS
        assert run.mode[k] == mode
    changes = np.flatnonzero(np.diff(run.mode)) + 1
    assert run.mode[0] == sampled.RATE
    assert changes.size > 0
    assert np.all(run.slope[[0, *changes]] == 0.0)
    assert np.abs(run.torque).max() == 5.0
    limits = np.where(run.mode[:, None] == sampled.RATE, 5.0, 25.0) / INERTIA[:2]
    assert np.all(np.abs(run.slope) <= limits)
    kept = np.setdiff1d(np.arange(600), [0, *changes])
    difference = (run.reference[kept] - run.reference[kept - 1]) / 0.1
    clipped = np.clip(difference, -limits[kept], limits[kept])
    np.testing.assert_allclose(run.slope[kept], clipped, atol=1e-15)


def test_sampled_loop_does_not_depend_on_the_attitude_parameters():
    settings = {**SAMPLED, "omega0": (0.1, -0.11, 0.0), "period": 0.1, "steps": 400}
    first = sampled.simulate_switched_sampled(**settings, substeps=1)
    for change in ({"attitude": "dcm", "substeps": 1}, {"substeps": 2}):
        other = sampled.simulate_switched_sampled(**settings, **change)
        np.testing.assert_allclose(other.omega, first.omega, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(other.dcm, first.dcm, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("law", ["three-axis", "rate"])
def test_sampled_loop_tends_to_the_continuous_law(law):
    """Errors fall in proportion to the period towards the continuous programs."""
    free = {
        "slope_limit_three_axis": math.inf,
        "slope_limit_rate": math.inf,
        "torque_limit": math.inf,
        "attitude_weight": 1.0,
        "leave": 0.0,
    }
    rate = law == "rate"
    start = (0.1, -0.11, 0.1) if rate else (0.1, -0.11, 0.0)
    smoothing = {"smooth": True, "width": 0.2}
    settings = {**SAMPLED, **free, "omega0": start, "enter": 1e-12 if rate else 1e9, **smoothing}
    if rate:
        gains = {"inertia": INERTIA, "k1": 0.457, "k2": 0.201, "omega0": start}
        exact = rate_law.simulate_rate_law([0, 2], **gains, **DISTURBANCE, measured=(False,) * 3)
    else:
        same = {key: SAMPLED[key] for key in ("k3", "k4", "mu", "a", "amplitude", "frequency")}
        exact = three.simulate_three_axis_smooth(
            [0, 2],
            **{**THREE_AXIS, **same},
            relation="exact",
            third_rate="free",
            width=0.2,
            internal_model=False,
        )
    errors = []
    for steps in (100, 200):
        run = sampled.simulate_switched_sampled(
            **settings, period=2.0 / steps, steps=steps, substeps=1
        )
        errors.append(np.abs(run.omega[-1] - exact.omega[-1]).max())
    assert errors[1] < 2e-3
    assert 1.7 < errors[0] / errors[1] < 2.3
