"""Checks of the reference programs of the three-axis law (40)-(43)."""

import itertools
import math
from decimal import Decimal

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from helpers.references import DISTURBANCE, FREQUENCY, INERTIA, THREE_AXIS, THREE_AXIS_DIGITS
from oracle import rigid_body as body
from oracle import three_axis_law as three
from oracle import three_axis_reference as algebra
from oracle.common import march, periodic

RELATION_AND_RATE = list(itertools.product(body.RELATIONS, three.THIRD_RATES))


@pytest.fixture
def rng():
    return np.random.default_rng(20130202)


def test_three_axis_reference_numbers():
    run = three.simulate_three_axis([0, *THREE_AXIS_DIGITS], **THREE_AXIS, **DISTURBANCE)
    found = np.column_stack([run.w, run.z, run.omega[:, :2]])[1:].ravel()
    digits = " ".join(THREE_AXIS_DIGITS.values()).split()
    for text, value in zip(digits, found, strict=True):
        last_digit = 10.0 ** Decimal(text).as_tuple().exponent
        assert value == pytest.approx(float(text), rel=0.0, abs=0.51 * last_digit)
    np.testing.assert_allclose(run.torque[0], (4.64475, -1.96820), atol=6e-6)


@pytest.mark.parametrize(("relation", "third_rate"), RELATION_AND_RATE)
@pytest.mark.parametrize("smooth", [False, True])
def test_reference_derivative_by_finite_differences(rng, relation, third_rate, smooth):
    law = algebra.Law(
        INERTIA,
        0.3,
        (0.2, 0.1),
        0.8,
        0.15,
        0.02,
        exact=relation == "exact",
        held=third_rate == "held",
        smooth=smooth,
        width=0.3 if smooth else 0.0,
    )
    inside = outside = 0
    for _ in range(40):
        w1, w2, z, *omega = rng.normal(size=6) * (1.0, 1.0, 0.3, 0.1, 0.1, 0.1)
        e = algebra.frame_rate(law, w1, w2, z)
        rates = np.array(
            [
                *algebra.kinematics(w1, w2, *(np.array(omega) - e)),
                algebra.model_third_acceleration(law, *omega[:2]),
            ]
        )
        place, step = np.array([w1, w2, z, omega[2]]), 1e-6
        after, before = (algebra.reference(law, *(place + s * rates)) for s in (step, -step))
        difference = (np.array(after[:2]) - before[:2]) / (2 * step)
        exact = algebra.reference_derivative(law, w1, w2, z, omega)
        np.testing.assert_allclose(exact, difference, rtol=1e-6, atol=1e-8)
        up, down = (algebra.reference(law, w1, w2, z, omega[2] + s) for s in (step, -step))
        slopes = (np.array(up[:2]) - down[:2]) / (2 * step)
        here = algebra.reference(law, w1, w2, z, omega[2])
        np.testing.assert_allclose(here[2:4], slopes, rtol=1e-6, atol=1e-8)
        inside += slopes[0] != 0.0
        outside += abs(slopes[0]) < 1e-12
    assert inside > 5
    assert smooth or outside > 5


@pytest.mark.parametrize(("relation", "third_rate"), RELATION_AND_RATE)
def test_error_coordinates_agree_with_torque_level(relation, third_rate):
    """Without saturation both programs hold the same motion, d3 of 1 N m included."""
    settings = {
        **THREE_AXIS,
        "a": 1e8,
        "orbit_rate": 0.02,
        "relation": relation,
        "third_rate": third_rate,
        "amplitude": (0.5, 0.7, 1.0),
        "frequency": (0.7, 0.8, 0.3),
        "phase": (0.3, -1.0, 0.4),
        "internal_model_frequency": (0.65, 0.9),
        "k4": (5.0, 3.0),
    }
    times = np.linspace(0.0, 8.0, 9)
    errors = three.simulate_three_axis(times, **settings)
    torques = three.simulate_three_axis_smooth(times, **settings, width=0.0)
    for name in ("w", "z", "omega", "torque", "eta", "alpha", "alpha_dot", "lyapunov"):
        np.testing.assert_allclose(
            getattr(torques, name), getattr(errors, name), rtol=1e-9, atol=1e-10, err_msg=name
        )
    assert np.abs(errors.omega[:, 2]).max() > 1e-3 or third_rate == "held"


@pytest.mark.parametrize("relation", body.RELATIONS)
def test_hard_sat_agrees_with_torque_level_through_its_switches(relation):
    """Third rate free, d3 of 1 N m: the unseen d3 enters only while sat is inside."""
    settings = {**THREE_AXIS, "orbit_rate": 0.02, "a": 0.8, "relation": relation}
    disturbance = ((0.0, 0.0, 1.0), (1.0, 1.0, 0.6), (0.0, 0.0, 0.4))
    times = np.linspace(0.0, 7.0, 29)
    run = three.simulate_three_axis(
        times,
        **settings,
        third_rate="free",
        internal_model=False,
        **dict(zip(("amplitude", "frequency", "phase"), disturbance, strict=True)),
    )
    law = algebra.Law(INERTIA, 0.05, (0.01,) * 2, 1.0, 0.8, 0.02, relation == "exact", held=False)

    def rhs(t, y):
        w1, w2, z, *omega = y
        u = algebra.torque(law, w1, w2, z, omega, (0.0, 0.0))
        d3 = periodic(t, *disturbance)[2]
        e = algebra.frame_rate(law, w1, w2, z)
        rate = body.euler_rate(np.diag(INERTIA), np.array(omega), np.array([*u, d3]))
        return (*algebra.kinematics(w1, w2, *(np.array(omega) - e)), *rate)

    states = march(rhs, times, (-1.0, 1.0, 1.27, 0.1, -0.11, 0.0), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(run.w, states[:, :2], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(run.omega, states[:, 3:], rtol=0.0, atol=1e-8)
    inside = [
        algebra.reference(law, *w, z, o)[2] != 0.0
        for w, z, o in zip(run.w, run.z, run.omega[:, 2], strict=True)
    ]
    assert any(inside)
    assert not all(inside)


@pytest.mark.parametrize(("relation", "third_rate"), RELATION_AND_RATE)
def test_lyapunov_rate_of_the_proof(relation, third_rate):
    """Without sat and d3, V' = −k3 |w|² − μ z² − k4 |η|² for either relation."""
    settings = {
        **THREE_AXIS,
        "a": 1e8,
        "k4": 5.0,
        "orbit_rate": 0.02,
        "relation": relation,
        "third_rate": third_rate,
        "amplitude": (0.5, 0.7, 0.0),
        "frequency": FREQUENCY,
        "phase": (0.3, -1.0, 0.4),
    }
    times = np.linspace(0.0, 4.0, 801)
    run = three.simulate_three_axis(times, **settings)
    slope = CubicSpline(times, run.lyapunov)(times, 1)
    squares = (run.w**2).sum(1), run.z**2, (run.eta**2).sum(1)
    expected = -0.05 * squares[0] - squares[1] - 5.0 * squares[2]
    np.testing.assert_allclose(slope[5:-5], expected[5:-5], rtol=1e-6, atol=1e-8)


@pytest.mark.slow
def test_smooth_run_replayed_as_a_rigid_body():
    """The torques of a run, fed to the (C, ω) program, give the same attitude."""
    times = np.linspace(0.0, 20.0, 2001)
    settings = {**THREE_AXIS, **DISTURBANCE, "relation": "exact", "third_rate": "free"}
    run = three.simulate_three_axis_smooth(times, **settings, width=0.2, torque_limit=3.0)
    assert np.any(np.abs(run.torque) == 3.0)
    law = CubicSpline(times, run.torque[:, :2])

    def torque(t, omega):
        periodic = [a * math.sin(o * t) for a, o in zip(*DISTURBANCE.values(), strict=True)]
        return np.append(law(t), 0.0) + periodic

    dcm, omega = body.integrate_free(
        times[::200],
        inertia=np.diag(INERTIA),
        dcm0=body.dcm_from_wz(run.w[0], run.z[0]),
        omega0=run.omega[0],
        orbit_rate=0.0011,
        torque=torque,
    )
    np.testing.assert_allclose(omega, run.omega[::200], rtol=0.0, atol=2e-6)
    for i, c in enumerate(dcm):
        expected = body.dcm_from_wz(run.w[200 * i], run.z[200 * i])
        np.testing.assert_allclose(c, expected, rtol=0.0, atol=2e-5)
