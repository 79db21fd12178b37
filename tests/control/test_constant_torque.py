"""A constant d3: the turn at which the orbital motion itself makes the opposite torque."""

import jax.numpy as jnp
import pytest
from scipy.optimize import brentq

from control.cases import INERTIA, ORBIT_RATE, C, body
from jaxsat.core.attitude import WZ
from jaxsat.spacecraft.dynamics import PlantState


@pytest.mark.parametrize("d3", [1e-6, -3e-6, 4.5e-6])
def test_constant_torque_is_held_by_a_turn(d3):
    """-d3 / (J3 c ω0²): c ω1 ω2 with ω1 ≈ -ω0 z, ω2 ≈ -ω0, at the plant's root by SciPy."""
    plant = body()

    def acceleration(z):
        attitude = WZ([0.0, 0.0], z).as_quaternion()
        omega = plant.orbit.frame_rate(attitude)
        rate = plant.rate(jnp.zeros(()), PlantState(attitude, omega), jnp.array([0.0, 0.0, d3]))
        return float(rate.omega[2])

    found = brentq(acceleration, -0.1, 0.1, xtol=1e-12)
    assert found == pytest.approx(-d3 / (INERTIA[2] * C * ORBIT_RATE**2), rel=1e-3)
