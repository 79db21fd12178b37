"""Reference programs in NumPy and SciPy that share no code with the package under test."""

from .rate_law import simulate_rate_law
from .rigid_body import (
    constraint_torque,
    dcm_from_quaternion,
    dcm_from_wz,
    euler_rate,
    frame_rate,
    integrate_free,
    integrate_wz,
    quaternion_from_wz,
    wz_from_dcm,
    wz_rate,
)
from .switched_sampled import simulate_switched_sampled
from .three_axis_law import simulate_three_axis, simulate_three_axis_smooth

__all__ = [
    "constraint_torque",
    "dcm_from_quaternion",
    "dcm_from_wz",
    "euler_rate",
    "frame_rate",
    "integrate_free",
    "integrate_wz",
    "quaternion_from_wz",
    "simulate_rate_law",
    "simulate_switched_sampled",
    "simulate_three_axis",
    "simulate_three_axis_smooth",
    "wz_from_dcm",
    "wz_rate",
]
