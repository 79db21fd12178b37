"""The paper's spacecraft for the laws that settle."""

import jax.numpy as jnp
import numpy as np

from helpers.paper import PAPER_DISTURBANCE
from jaxsat.control.least_squares import RecursiveLeastSquares
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.ripple import RippleFilter
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.disturbances import NoDisturbance, PeriodicTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft

INERTIA = np.array([449.5, 264.6, 312.5])
ORBIT_RATE = 0.0011
C = (INERTIA[0] - INERTIA[1]) / INERTIA[2]


def body(inertia=INERTIA, orbit_rate=ORBIT_RATE, disturbance=None):
    return RigidBody(Spacecraft(inertia), ExactOrbit(orbit_rate), disturbance or NoDisturbance())


def form(*args, **options):
    """The normal form of such a body with torques about body x and y."""
    return NormalForm.of(body(*args, **options))


def paper_disturbance(third=True):
    amplitude = np.array(PAPER_DISTURBANCE["amplitude"]) * [1, 1, third]
    return PeriodicTorque(amplitude, list(PAPER_DISTURBANCE["frequency"]))


def actuators(limit=jnp.inf, axes=None):
    """Thrusters about x and y, or along the columns of `axes` (3, 2)."""
    axes = np.eye(3)[:, :2] if axes is None else axes
    return Actuators(axes, np.eye(2), limit)


def ripple_filter_of(frequency, **changes):
    """The filter for the noise and the ripple of the paper's spacecraft."""
    expected = {"noise": 1e-5, "amplitude": 3e-5, "drift": 2e-6, "product_error": 0.01}
    return RippleFilter(frequency, **expected | changes)


def paper_fit(**changes):
    """Least squares for its rate noise."""
    return RecursiveLeastSquares(**{"noise": 2e-5} | changes)
