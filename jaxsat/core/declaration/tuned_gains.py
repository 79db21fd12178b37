"""Dimensionless gains of the settling laws: rates times a unit of time τ.

With a moment of inertia J0 and a torque limit T, τ = √(J0/T) is the time in which T turns J0 by
half a radian from rest. Dividing J, T and d by one number changes neither τ nor the motion;
scaling all times scales τ alike. Of the other dimensionless groups the control period over τ is
always known, and the gains are functions of it.

They were tuned for the paper's spacecraft, section 5, at thrusters of 1, 5 and 20 N m: τ = 18.57,
8.305 and 4.153 s. With its orbit, disturbance and sensors the period over τ distinguishes these.
`tuned_gains.toml` has the gains and the method.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from jaxsat.core.package_files import data_of

STEPS = (0.005384806676, 0.01204079377, 0.02408158755)
"""Control periods over τ for which the gains are tuned.

Those of the paper's spacecraft at 1, 5 and 20 N m and 0.1 s.
"""


class Scaling(NamedTuple):
    """Unit of time τ, that of inner loops and that of small errors (all s), and the period over τ.

    Gains of inner loops scale with `loop_time`: beyond the largest of `STEPS` the period limits
    them instead of the torque. Residual errors of sensors and estimators are angles per
    `fine_time`, the period within the range of `STEPS` times τ.
    """

    time: float
    loop_time: float
    fine_time: float
    step: float

    @staticmethod
    def of(moment: float, torque_limit: float | int, period: float) -> "Scaling":
        """Return the scaling of a moment of inertia J0 (kg m²), torque limit (N m) and period (s).

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
"""Names of gains that are pure numbers or angles."""

LOOP_GAINS = ("tilt_gain", "rate_gain", "approach")
"""Names of gains of inner loops; all others are rates of the motion."""

Gains = TypeVar("Gains", bound=tuple)


def in_seconds(gains: Gains, scaling: Scaling) -> Gains:
    """Convert dimensionless gains to 1/s and rad/s; pure numbers and angles do not change."""

    def one(name, value):
        if isinstance(value, tuple):
            return in_seconds(value, scaling)
        if name in NUMBERS:
            return value
        return value / (scaling.loop_time if name in LOOP_GAINS else scaling.time)

    values = gains._asdict()  # pyright: ignore[reportAttributeAccessIssue]
    return type(gains)(**{name: one(name, value) for name, value in values.items()})


class MorinSamsonGains(NamedTuple):
    """Gains of `MorinSamson`: `k3`, damping ratio ζ, and `rest` (rad)."""

    k3: float
    damping: float
    rest: float


class TwoChannelGains(NamedTuple):
    """Gains of `TwoChannel`: `k3` and `kz`, and `rest` (rad)."""

    k3: float
    kz: float
    rest: float


class FineGains(NamedTuple):
    """Gains of the fine stage: of its demand, its `Oscillator` and its `Handover`.

    `frequency` is ν, `tilt_gain` k, `rate_gain` kω, `largest_amplitude` ρm, `ratio` r.
    """

    demand: MorinSamsonGains | TwoChannelGains
    frequency: float
    tilt_gain: float
    rate_gain: float
    largest_amplitude: float
    ratio: float
    enter_rate: float


class RateLawGains(NamedTuple):
    """Gains of `FiniteTimeRate`: `share` η, `rate_gain` and `dead_zone` ε."""

    share: float
    rate_gain: float
    dead_zone: float


class SlewGains(NamedTuple):
    """Gains of `SlewPlanner`.

    `share` is η_s, `approach` λ and `rate_gain` k_s; `angle_tolerance` is in rad.
    """

    share: float
    approach: float
    rate_gain: float
    angle_tolerance: float
    rate_tolerance: float


class ApproachGains(NamedTuple):
    """Gains of `ThreeSlewSettling` before its fine stage."""

    rate_law: RateLawGains
    slews: SlewGains
    stopped_rate: float
    lost_rate: float


Row = TypeVar("Row")


def _rows(table: str, kind: Callable[..., Row], **parts: Callable[..., Any]) -> Mapping[float, Row]:
    rows = [dict(row) for row in _TABLES[table]]
    for row in rows:
        row |= {name: part(**row[name]) for name, part in parts.items()}
    return {row.pop("step"): kind(**row) for row in rows}


_TABLES = data_of("jaxsat.core.declaration", "tuned_gains.toml")

MORIN_SAMSON = _rows("morin_samson", FineGains, demand=MorinSamsonGains)
"""Gains of the oscillatory law, by the period over τ."""

TWO_CHANNEL = _rows("two_channel", FineGains, demand=TwoChannelGains)
"""Gains of the fine stage of the three slews, by the period over τ."""

APPROACH = _rows("approach", ApproachGains, rate_law=RateLawGains, slews=SlewGains)
"""Gains of the three slews before their fine stage, by the period over τ."""


def tuned_frequency(table: Mapping[float, FineGains], scaling: Scaling) -> float:
    """Return ν (rad/s) of a table, log-log interpolated between two of its steps."""
    frequencies = [table[step].frequency for step in STEPS]
    number = np.exp(np.interp(np.log(scaling.step), np.log(STEPS), np.log(frequencies)))
    return float(number) / scaling.time
