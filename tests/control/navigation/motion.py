"""A tumbling spacecraft in orbit, exactly: its rates are given, its attitude is integrated."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

ORBIT_RATE = 1e-3


class Motion(NamedTuple):
    """Rates (rad/s) and attitudes (orbit to body, scalar first) at samples `period` s apart."""

    period: float
    omega: np.ndarray
    quaternion: np.ndarray


def rates(t, size):
    phases = np.multiply.outer(t, [0.05, 0.08, 0.03]) + np.arange(3.0)
    return size * np.sin(phases)


def motion(period, samples, size=0.02):
    """Inertial attitude by SciPy, then taken relative to the orbit frame, which turns about -y."""

    def derivative(t, q):
        x, y, z = rates(t, size)
        matrix = np.array([[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]])
        return matrix @ q / 2

    times = np.arange(samples) * period
    start = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_quat()
    found = solve_ivp(derivative, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13)
    return Motion(period, rates(times, size), relative(Rotation.from_quat(found.y.T), times))


def orbit_frame(times):
    """The orbit frame at these times, from its axes to inertial ones."""
    return Rotation.from_rotvec(np.multiply.outer(times, [0.0, -ORBIT_RATE, 0.0]))


def relative(inertial, times):
    """Unit quaternions, scalar first, relative to the orbit frame."""
    return np.roll((orbit_frame(times).inv() * inertial).as_quat(), 1, axis=-1)


def inertial(quaternion, times):
    """The way back."""
    return orbit_frame(times) * Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


def attitude_errors(quaternion, estimate):
    """Rotation vectors, body axes, from estimated to true attitudes."""
    true = Rotation.from_quat(np.roll(quaternion, -1, axis=-1))
    believed = Rotation.from_quat(np.roll(estimate, -1, axis=-1))
    return (believed.inv() * true).as_rotvec()
