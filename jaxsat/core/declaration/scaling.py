"""The units of time in which the gains of the settling laws have no dimension.

With a moment of inertia J0 and a torque limit T, τ = √(J0/T) is the time in which T turns J0 by
half a radian from rest. Dividing J, T and d by one number leaves τ, and with it the motion, as it
is; stretching every time stretches τ alike. Of the other dimensionless groups the control period
over τ is always known, and the gains are functions of it.
"""

import math
from typing import NamedTuple, TypeVar

STEPS = (0.005384806676, 0.01204079377, 0.02408158755)
"""Control periods over τ that the gains are tuned for.

Those of the paper's spacecraft at 1, 5 and 20 N m and 0.1 s.
"""


class Scaling(NamedTuple):
    """τ, the time of the inner loops and that of small errors (all s), and the period over τ.

    Gains of inner loops are those of `loop_time`: beyond the largest of `STEPS` they are limited
    by the period in place of the torque. Errors that sensors and estimators leave are angles per
    `fine_time`, the period within the range of `STEPS` times τ.
    """

    time: float
    loop_time: float
    fine_time: float
    step: float

    @staticmethod
    def of(moment: float, torque_limit: float | int, period: float) -> "Scaling":
        """Of a moment of inertia J0 (kg m²), a torque limit (N m) and a control period (s).

        Raises `ValueError` for a torque limit that is not positive and finite.
        """
        limit = float(torque_limit)
        if not 0 < limit < math.inf:
            raise ValueError(
                f"Argument `torque_limit` must be positive and finite, but got {torque_limit} N m."
            )
        time = math.sqrt(moment / limit)
        step = period / time
        fine = time * min(max(step, STEPS[0]), STEPS[-1])
        return Scaling(time, max(time, period / STEPS[-1]), fine, step)


NUMBERS = ("damping", "rest", "ratio", "share", "angle_tolerance")
"""Gains that are numbers or angles."""

LOOP_GAINS = ("tilt_gain", "rate_gain", "approach")
"""Gains of inner loops; all others are rates of the motion."""

Gains = TypeVar("Gains", bound=tuple)


def in_seconds(gains: Gains, scaling: Scaling) -> Gains:
    """Gains without dimension as numbers of 1/s and rad/s; numbers and angles stay."""

    def one(name, value):
        if isinstance(value, tuple):
            return in_seconds(value, scaling)
        if name in NUMBERS:
            return value
        return value / (scaling.loop_time if name in LOOP_GAINS else scaling.time)

    named = gains._asdict()  # pyright: ignore[reportAttributeAccessIssue]
    return type(gains)(**{name: one(name, value) for name, value in named.items()})
