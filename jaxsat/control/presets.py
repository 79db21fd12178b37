"""Settling controllers for any inertia, torque limit and control period.

Their gains have no dimension (`jaxsat.control.tuned_gains`). The unit of time is τ of
`jaxsat.control.scaling`, J0 being the geometric mean of J1 and J2, so a larger body under torques
larger in proportion flies alike. The gains are functions of the control period over τ, tuned at
three values of it; between these they are interpolated, below and above they are those of the
nearest. Other ratios of the moments need gains of their own; the regulator's gain is computed from
the model in any case, and what is known of the periodic d3 goes into the ripple estimator.
"""

import bisect
import math
from collections.abc import Mapping
from typing import TypeVar

import jax
import numpy as np

from jaxsat.control.estimators import ThirdAxisEstimator
from jaxsat.control.fine import FineStage, Handover, OscillatorySettling
from jaxsat.control.finite_time_rate import FiniteTimeRate
from jaxsat.control.least_squares import RecursiveLeastSquares
from jaxsat.control.oscillatory import MorinSamson, Oscillator, TwoChannel
from jaxsat.control.ripple import AbstractRippleEstimator, RippleFilter
from jaxsat.control.scaling import Scaling, in_seconds
from jaxsat.control.slews import SlewPlanner
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.control.terminal import OrbitalRegulator
from jaxsat.control.tuned_gains import APPROACH, MORIN_SAMSON, TWO_CHANNEL, FineGains
from jaxsat.declaration.settling import TUNED_PERIOD
from jaxsat.dynamics import RigidBody

DEAD_ZONE = 1e-6
"""Slow rate that the oscillation leaves to the regulator, rad per `fine_time`."""

STATE_SCALE, TORQUE_SCALE = (0.1, 0.1, 0.05, 2e-4, 2e-4, 1e-4), 8.698842883e-06
"""Of the regulator, so that rates stay small while it removes what is left: angles in rad, rates in
rad per `fine_time`, the torque over J0 in rad per `fine_time` squared."""

LEAVE_RATE = 1e-4
"""|ω3| at which the regulator hands back, rad per `fine_time`."""

RIPPLE, RIPPLE_FREQUENCY = 3e-6, 0.01
"""Least ripple of ω3 that the filter expects, and its frequency where none is known; rad per
`fine_time`."""

RIPPLE_SHARE = 0.9375
"""Expected ripple of ω3 over the a3 / (J3 Ω) that the scenario tells of."""

RATE_NOISE, RIPPLE_DRIFT, PRODUCT_ERROR = 1e-6, 6.32455532e-08, 0.0316227766
"""Of the ripple filter: rad per `fine_time` for the noise, for the drift also per √`fine_time`, and
times √`fine_time` for the error of products."""

CHANGE_NOISE = 2e-6
"""Of one Δω3 of the least squares, rad per `fine_time`."""


def oscillatory_settling(
    model: RigidBody,
    torque_limit: float | int,
    *,
    observe: bool = True,
    estimate: bool = True,
    period: float = TUNED_PERIOD,
    ripple: AbstractRippleEstimator | None = None,
) -> OscillatorySettling:
    """The Morin-Samson law with regulator.

    `model` is what the controller believes of the plant. `observe` tells whether it estimates the
    ripple of d3 (by `ripple`, `ripple_filter(model, ...)` unless given), `estimate` whether it
    estimates the errors of axes and inertia. Raises `ValueError` for a torque limit that is not
    positive and finite.
    """
    scaling = _scaling(model, torque_limit, period)
    gains = _gains(MORIN_SAMSON, scaling)
    demand = MorinSamson(**gains.demand._asdict())
    ripple = (ripple or ripple_filter(model, torque_limit, period=period)) if observe else None
    return OscillatorySettling(
        fine=_fine_stage(model, demand, gains, scaling, fade_lean=False),
        estimator=_estimator(model, estimate, ripple, scaling),
        torque_limit=torque_limit,
        period=period,
    )


def three_slew_settling(
    model: RigidBody,
    torque_limit: float | int,
    *,
    observe: bool = True,
    estimate: bool = True,
    period: float = TUNED_PERIOD,
    ripple: AbstractRippleEstimator | None = None,
) -> ThreeSlewSettling:
    """Rate law, three slews, two-channel law and regulator; arguments as above."""
    scaling = _scaling(model, torque_limit, period)
    gains, approach = _gains(TWO_CHANNEL, scaling), _gains(APPROACH, scaling)
    demand = TwoChannel(**gains.demand._asdict())
    ripple = (ripple or ripple_filter(model, torque_limit, period=period)) if observe else None
    return ThreeSlewSettling(
        rate_law=FiniteTimeRate(model, torque_limit, **approach.rate_law._asdict()),
        planner=SlewPlanner(model, torque_limit, **approach.slews._asdict()),
        fine=_fine_stage(model, demand, gains, scaling, fade_lean=True),
        estimator=_estimator(model, estimate, ripple, scaling),
        torque_limit=torque_limit,
        stopped_rate=approach.stopped_rate,
        lost_rate=approach.lost_rate,
        period=period,
    )


def ripple_filter(
    model: RigidBody,
    torque_limit: float | int,
    amplitude: float = 0.0,
    frequency: float = 0.0,
    period: float = TUNED_PERIOD,
) -> RippleFilter:
    """The filter for d3 = amplitude sin(frequency t + any phase) about the third axis of `model`.

    `amplitude` in N m, `frequency` in rad/s, zero where no periodic d3 is known. It expects a
    ripple of ω3 in proportion to amplitude / (J3 frequency), but none below what the gains are
    tuned for.
    """
    unit = _scaling(model, torque_limit, period).fine_time
    frequency = abs(frequency) or RIPPLE_FREQUENCY / unit
    size = abs(amplitude) / (_moments(model)[2] * frequency)
    return RippleFilter(
        frequency,
        noise=RATE_NOISE / unit,
        amplitude=max(RIPPLE / unit, RIPPLE_SHARE * size),
        drift=RIPPLE_DRIFT / unit**1.5,
        product_error=PRODUCT_ERROR * math.sqrt(unit),
    )


Gains = TypeVar("Gains", bound=tuple)


def _scaling(model: RigidBody, torque_limit: float | int, period: float) -> Scaling:
    first, second, _ = _moments(model)
    return Scaling.of(math.sqrt(first * second), torque_limit, period)


def _gains(table: Mapping[float, Gains], scaling: Scaling) -> Gains:
    """In SI; between two of the tuned steps on straight lines in logarithms."""
    known = sorted(table)
    step = min(max(scaling.step, known[0]), known[-1])
    place = min(bisect.bisect(known, step), len(known) - 1)
    low, high = known[place - 1 : place + 1]
    share = math.log(step / low) / math.log(high / low)
    gains = jax.tree.map(
        lambda one, other: float(one ** (1 - share) * other**share), table[low], table[high]
    )
    return in_seconds(gains, scaling)


def _fine_stage(
    model: RigidBody, demand, gains: FineGains, scaling: Scaling, *, fade_lean: bool
) -> FineStage:
    unit = scaling.fine_time
    oscillator = Oscillator(
        model,
        demand,
        frequency=gains.frequency,
        tilt_gain=gains.tilt_gain,
        rate_gain=gains.rate_gain,
        largest_amplitude=gains.largest_amplitude,
        ratio=gains.ratio,
        dead_zone=DEAD_ZONE / unit,
    )
    first, second, _ = _moments(model)
    state_scale = np.array(STATE_SCALE) / np.array([1, 1, 1, unit, unit, unit])
    torque_scale = TORQUE_SCALE * math.sqrt(first * second) / unit**2
    regulator = OrbitalRegulator.design(model, state_scale, torque_scale)
    handover = Handover(gains.enter_slow_rate, gains.enter_rate, leave_rate=LEAVE_RATE / unit)
    return FineStage(oscillator, regulator, handover, fade_lean)


def _estimator(
    model: RigidBody, estimate: bool, ripple: AbstractRippleEstimator | None, scaling: Scaling
) -> ThirdAxisEstimator:
    noise = CHANGE_NOISE / scaling.fine_time
    fit = RecursiveLeastSquares(noise=noise) if estimate else None
    return ThirdAxisEstimator(model, ripple, fit)


def _moments(model: RigidBody) -> list[float]:
    return np.asarray(model.spacecraft.moments).tolist()
