"""Published check cases of rigid bodies against closed forms."""

import diffrax
import numpy as np
import pytest
from scipy.special import ellipj, ellipkinc

from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.steering import Steered

SLUG_FOOT_SQUARED = 1.3558179483314004
BRICK = np.array([0.001894220, 0.006211019, 0.007194665]) * SLUG_FOOT_SQUARED
OMEGA = np.deg2rad([10.0, 20.0, 30.0])
TIMES = np.linspace(0.0, 30.0, 31)


def jacobi(inertia, omega, times):
    """Landau and Lifshitz, Mechanics, section 37: moments in rising order, M² > 2 E I2."""
    one, two, three = inertia
    energy, square = inertia @ omega**2, np.sum((inertia * omega) ** 2)  # 2 E and M²
    assert square > energy * two
    above, below = energy * three - square, square - energy * one
    sizes = np.sqrt(
        [
            above / (one * (three - one)),
            above / (two * (three - two)),
            below / (three * (three - one)),
        ]
    )
    modulus = (two - one) * above / ((three - two) * below)
    speed = np.sqrt((three - two) * below / (one * two * three))
    begin = ellipkinc(np.arctan2(omega[1] / sizes[1], omega[0] / sizes[0]), modulus)
    sn, cn, dn, _ = ellipj(begin + speed * times, modulus)
    return np.stack([sizes[0] * cn, sizes[1] * sn, sizes[2] * dn], axis=1)


@pytest.mark.slow
def test_nesc_check_case_2_is_jacobis_free_motion():
    """The brick that tumbles without damping (NASA/TM-2015-218675), moments and rates."""
    body = RigidBody(Spacecraft(BRICK), ExactOrbit(0.0))
    start = PlantState(Quaternion([1.0, 0, 0, 0]), OMEGA)
    loop = ContinuousLoop(body, Coast(), Steered())
    run = simulate(loop, start, TIMES, method=adaptive(1e-12, 1e-13, diffrax.Dopri8()))
    exact = jacobi(BRICK, OMEGA, TIMES)
    np.testing.assert_allclose(exact[0], OMEGA, atol=1e-14)
    np.testing.assert_allclose(run.signals.omega, exact, atol=1e-10)
