"""Checks of the reference programs themselves: invariants, finite differences, known numbers."""

import math

import numpy as np
import pytest

from oracle import rate_law, thrusters
from oracle import rigid_body as body
from oracle import switched_sampled as sampled
from oracle import three_axis_law as three

INERTIA = (449.5, 264.6, 312.5)
FREQUENCY = (0.7, 0.8, 0.1)
DISTURBANCE = {"amplitude": (0.01, 0.02, 0.001), "frequency": FREQUENCY}
FULL_INERTIA = np.array([[449.5, 12.0, -7.0], [12.0, 264.6, 9.0], [-7.0, 9.0, 312.5]])
THREE_AXIS = {
    "inertia": INERTIA,
    "k3": 0.05,
    "k4": 0.01,
    "mu": 1.0,
    "a": 0.1,
    "w0": (-1.0, 1.0),
    "z0": 1.27,
    "omega0": (0.1, -0.11, 0.0),
    "orbit_rate": 0.0011,
}


@pytest.fixture
def rng():
    return np.random.default_rng(20130202)


# Attitude and rigid body -----------------------------------------------------------------------


def test_attitude_maps_agree_with_printed_forms(rng):
    for _ in range(20):
        (w1, w2), z = rng.normal(size=2), rng.uniform(-3.0, 3.0)
        tilt = np.array(
            [
                [1 + w1**2 - w2**2, 2 * w1 * w2, -2 * w2],
                [2 * w1 * w2, 1 - w1**2 + w2**2, 2 * w1],
                [2 * w2, -2 * w1, 1 - w1**2 - w2**2],
            ]
        )
        dcm = body.dcm_from_wz((w1, w2), z)
        np.testing.assert_allclose(dcm @ body.dcm_from_wz((0, 0), -z) * (1 + w1**2 + w2**2), tilt)
        c, s = math.cos(z / 2), math.sin(z / 2)
        printed = np.array([c, w1 * c - w2 * s, w2 * c + w1 * s, s]) / math.hypot(1, w1, w2)
        quaternion = body.quaternion_from_wz((w1, w2), z)
        np.testing.assert_allclose(quaternion, printed, atol=1e-15)
        np.testing.assert_allclose(body.dcm_from_quaternion(quaternion), dcm, atol=1e-14)
        w, back = body.wz_from_dcm(dcm)
        np.testing.assert_allclose((*w, back), (w1, w2, z), atol=1e-13)


def test_free_motion_keeps_energy_and_inertial_momentum():
    orbit_rate = 0.05
    times = np.linspace(0.0, 100.0, 21)
    dcm, omega = body.integrate_free(
        times,
        inertia=FULL_INERTIA,
        dcm0=body.dcm_from_wz((0.4, -0.3), 1.0),
        omega0=(0.1, -0.11, 0.09),
        orbit_rate=orbit_rate,
    )
    energy = 0.5 * np.einsum("ni,ij,nj->n", omega, FULL_INERTIA, omega)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    momentum = []
    for t, c, rate in zip(times, dcm, omega, strict=True):
        angle = -orbit_rate * t  # the orbit frame turns about its own y at −ω0
        cosine, sine = math.cos(angle), math.sin(angle)
        orbit = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
        momentum.append((c @ orbit).T @ FULL_INERTIA @ rate)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], (21, 3)), atol=1e-10)
    np.testing.assert_allclose(dcm @ dcm.swapaxes(1, 2), np.tile(np.eye(3), (21, 1, 1)), atol=1e-12)


@pytest.mark.parametrize("relation", body.RELATIONS)
@pytest.mark.parametrize("held", [False, True])
def test_wz_and_dcm_runs_agree(relation, held):
    times = np.linspace(0.0, 20.0, 11)
    common = {
        "inertia": FULL_INERTIA,
        "omega0": (0.05, -0.04, 0.0 if held else 0.06),
        "orbit_rate": 0.02,
        "relation": relation,
        "torque": lambda t, omega: np.array([0.3 * math.sin(t), -0.2, 0.1]) - 2.0 * omega,
        "held_third_rate": held,
    }
    dcm, omega = body.integrate_free(times, dcm0=body.dcm_from_wz((0.5, 0.2), -0.7), **common)
    w, z, omega_wz = body.integrate_wz(times, w0=(0.5, 0.2), z0=-0.7, **common)
    np.testing.assert_allclose(omega_wz, omega, atol=1e-13)
    for i in range(11):
        np.testing.assert_allclose(body.dcm_from_wz(w[i], z[i]), dcm[i], atol=1e-12)
    assert not held or np.all(np.abs(omega[:, 2]) < 1e-16)


def test_held_rate_is_held_by_a_torque_about_axis_three_alone(rng):
    omega, torque = np.array([0.1, -0.2, 0.0]), rng.normal(size=3)
    rate = body.euler_rate(FULL_INERTIA, omega, torque, held_third_rate=True)
    needed = FULL_INERTIA @ rate + np.cross(omega, FULL_INERTIA @ omega) - torque
    np.testing.assert_allclose(needed[:2], 0.0, atol=1e-12)
    assert needed[2] == pytest.approx(body.constraint_torque(FULL_INERTIA, omega, torque))
    assert abs(rate[2]) < 1e-17
    # No work is done where ω3 = 0, so the free body keeps its energy.
    _, rates = body.integrate_free(
        np.linspace(0.0, 50.0, 6),
        inertia=FULL_INERTIA,
        dcm0=np.eye(3),
        omega0=omega,
        orbit_rate=0.0,
        held_third_rate=True,
    )
    energy = np.einsum("ni,ij,nj->n", rates, FULL_INERTIA, rates)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    assert np.ptp(rates[:, 0]) > 1e-3


# Thrusters -------------------------------------------------------------------------------------


def test_thruster_coefficients_against_printed_quotients(rng):
    for _ in range(10):
        cosines = rng.normal(size=(3, 3))
        cosines /= np.linalg.norm(cosines, axis=0)
        thrust = rng.normal(size=3)
        np.testing.assert_allclose(thrusters.torque(cosines, thrust), cosines @ thrust, atol=1e-15)
        (a1, b1), (a2, b2), (a3, b3) = cosines[:, :2]
        divisor = a1 * b2 - a2 * b1
        printed = (a3 * b2 - a2 * b3) / divisor, (a1 * b3 - a3 * b1) / divisor
        found = thrusters.two_thruster_coefficients(cosines[:, :2])
        np.testing.assert_allclose(found, printed, rtol=1e-10)
        u = thrusters.two_thruster_command(cosines[:, :2], thrust[:2])
        g1, g2 = thrusters.two_thruster_fields(cosines[:, :2])
        total = thrusters.torque(cosines[:, :2], thrust[:2])
        np.testing.assert_allclose(g1 * u[0] + g2 * u[1], total, atol=1e-12)
        back = thrusters.two_thruster_thrust(cosines[:, :2], u)
        np.testing.assert_allclose(back, thrust[:2], rtol=1e-10)
        np.testing.assert_allclose(
            thrusters.one_thruster_field(cosines[:, 0]), (1.0, a2 / a1, a3 / a1), rtol=1e-14
        )
    with pytest.raises(ZeroDivisionError):
        thrusters.two_thruster_coefficients([[1.0, 1.0], [0.0, 0.0], [0.0, 1.0]])
    with pytest.raises(ZeroDivisionError):
        thrusters.one_thruster_coefficients([0.0, 1.0, 0.0])


# Sampled switching -----------------------------------------------------------------------------

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
