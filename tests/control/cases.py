"""The paper's spacecraft for the laws that settle."""

import jax.numpy as jnp
import numpy as np

from helpers.paper import PAPER_DISTURBANCE
from jaxsat.control import NormalForm
from jaxsat.dynamics import RigidBody
from jaxsat.environment import ExactOrbit, NoDisturbance, PeriodicTorque
from jaxsat.vehicle import Actuators, Spacecraft

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
