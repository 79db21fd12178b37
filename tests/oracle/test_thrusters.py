"""Checks of the reference program of the thrusters against the printed quotients."""

import numpy as np
import pytest

from oracle import thrusters


def test_thruster_coefficients_against_printed_quotients():
    rng = np.random.default_rng(20130202)
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
