"""Ranges of physical quantities, shared by scenario keys and draws.

Wide enough for every spacecraft, and narrow enough that no product or quotient of two of them
overflows a float.
"""

from typing import NamedTuple


class Range(NamedTuple):
    """Closed range from `low` to `high`."""

    low: float
    high: float


MOMENT = Range(1e-9, 1e12)
"""Principal moments of inertia, kg m²."""

PRODUCT = Range(-1e12, 1e12)
"""Products of inertia, kg m²."""

TORQUE = Range(-1e9, 1e9)
"""Disturbance torques, N m."""

TORQUE_NOISE = Range(0.0, 1e6)
"""Noise, deviation and random walk of unknown torques, N m over powers of √s."""

TORQUE_LIMIT = Range(1e-9, 1e9)
"""Largest torque of a thruster, N m."""

WHEEL_MOMENTUM = Range(1e-9, 1e9)
"""Largest momentum of a wheel, N m s."""

FRICTION = Range(0.0, 1e6)
"""Friction of a wheel, N m or N m s."""

WHEEL_NOISE = Range(0.0, 1e6)
"""Noise of a wheel's tachometer, N m s."""

FREQUENCY = Range(-1e6, 1e6)
"""Frequency of a periodic torque, rad/s; of either sign as it is printed."""

KNOWN_FREQUENCY = Range(1e-9, 1e6)
"""Frequency of an internal model, rad/s."""

DAMPING = Range(0.0, 10.0)
"""Damping ratio of a flexible mode."""

COUPLING = Range(-1e5, 1e5)
COUPLING_SIZE = Range(1e-9, 2e5)
"""Couplings of a flexible mode, each component and the size, √kg m."""

ANGLE = Range(-1e6, 1e6)
"""Phases and directions, rad."""

ORBIT_RATE = Range(0.0, 1.0)
"""Orbit rate ω0, rad/s; a thousand times that of any orbit around the Earth."""

DIPOLE = Range(-1e6, 1e6)
DIPOLE_LIMIT = Range(1e-9, 1e6)
"""Residual magnetic dipoles, A m²."""

LENGTH = Range(-1e3, 1e3)
"""Coordinates from the centre of mass, m."""

TURN = Range(-6.283185307179587, 6.283185307179587)
"""Angles of an orbit, rad."""

RATE_NOISE = Range(0.0, 1e3)
"""Standard deviation of a rate sensor, rad/s."""

ATTITUDE_NOISE = Range(0.0, 10.0)
"""Standard deviation of an attitude sensor, rad."""

TRACKER_NOISE = Range(1e-9, 1.0)
"""Standard deviation of a star tracker, rad; a filter divides by its square."""

PROBABILITY = Range(1e-12, 1.0)
"""Probability of an event that may happen."""

FIELD_NOISE = Range(1e-12, 1e-3)
FIELD_BIAS = Range(-1e-3, 1e-3)
"""Standard deviation and bias of a magnetometer, T; a filter divides by the square of the first."""

VECTOR_NOISE = Range(1e-12, 1e12)
VECTOR_BIAS = Range(-1e12, 1e12)
"""Standard deviation and bias of a sensor of another vector, in its unit."""

HALF_ANGLE = Range(1e-6, 3.141592653589793)
"""Half of the angle of a field of view, rad."""

GYRO_BIAS = Range(-1e3, 1e3)
"""Bias of a rate gyro, rad/s."""

SCALE_FACTOR = Range(-0.5, 0.5)
"""Relative error of a rate gyro."""

RATE_RANGE = Range(1e-9, 1e6)
"""Largest rate at which a sensor works, rad/s."""

SECONDS = Range(1e-6, 1e8)
"""Durations, periods and steps, s."""

FROM_ZERO = Range(0.0, SECONDS.high)
"""Times and delays, s."""

MISALIGNMENT = Range(-1.0, 1.0)
"""Turn of a torque axis off its nominal direction, rad, in the small-angle approximation."""

CHANGE_OF_TORQUE = Range(-1.0, 1e3)
"""Relative change of a thruster's torque, which may vanish and never changes sign."""

ROTATION = Range(-6.283185307179586, 6.283185307179586)
"""Components of a rotation vector, rad."""

STATE_LIMIT = 1e6
"""Bound on states that ends a run: |w| beyond it means upside down, a rate means divergence."""

MAX_FIXED_STEPS = 2**24
"""Largest number of steps of one run: two days of flight at 0.01 s, hours of computing."""

SETTLED_W, SETTLED_TURN, SETTLED_RATE = 0.05, 0.05, 1e-3
"""Default settling tolerances on |w|, turn (rad) and relative rate (rad/s)."""
