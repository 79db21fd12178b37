"""Checks of the reference program of attitude and rigid body: printed forms and invariants."""

import math

import numpy as np
import pytest

from oracle import rigid_body as body

FULL_INERTIA = np.array([[449.5, 12.0, -7.0], [12.0, 264.6, 9.0], [-7.0, 9.0, 312.5]])


@pytest.fixture
def rng():
    return np.random.default_rng(20130202)


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
