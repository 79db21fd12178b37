"""Settling controllers with gains tuned for the paper's spacecraft, section 5.

The gains were tuned for J = diag(449.5, 264.6, 312.5) kg m², ω0 = 0.0011 rad/s and the printed
disturbance, at thrusters of 1, 5 and 20 N m, and a period of 0.1 s. Between these limits they are
interpolated; below and above they are those of the nearest. All are rates, angles and numbers
without a unit, so a larger body under torques larger in proportion flies alike: a limit counts by
the angular acceleration that it gives the believed body (`equivalent_limit`). Other ratios of the
moments need gains of their own; the regulator's gain is computed from the model in any case, and
what is known of the periodic d3 goes into the ripple estimator (`ripple_filter`).
"""

import bisect
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
from jaxsat.control.slews import SlewPlanner
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.control.terminal import OrbitalRegulator
from jaxsat.control.tuned_gains import APPROACH, MORIN_SAMSON, TWO_CHANNEL, FineGains
from jaxsat.declaration.settling import TUNED_MOMENTS, TUNED_PERIOD, equivalent_limit
from jaxsat.dynamics import RigidBody

DEAD_ZONE = 1e-5
"""Slow rate (rad/s) that the oscillation leaves to the regulator."""

STATE_SCALE, TORQUE_SCALE = (0.1, 0.1, 0.05, 0.002, 0.002, 0.001), 0.3
"""Of the regulator, so that rates stay below 1e-3 rad/s while it removes what is left; the torque
(N m) for the body of the tuned gains, for another in proportion."""

TUNED_RIPPLE = (0.001, 0.1)
"""Amplitude (N m) and frequency (rad/s) of the d3 for which the gains are tuned."""

RIPPLE_EXPECTED = 3e-5
"""Ripple of ω3 (rad/s) that the filter expects of that d3 on that body."""


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
    ripple of d3 (by `ripple`, `ripple_filter(model)` unless given), `estimate` whether it estimates
    the errors of axes and inertia. Raises `ValueError` for a torque limit that is not positive.
    """
    gains = _gains(MORIN_SAMSON, model, torque_limit)
    demand = MorinSamson(**gains.demand._asdict())
    fine = _fine_stage(model, demand, gains, fade_lean=False)
    estimator = _estimator(model, observe, estimate, ripple)
    return OscillatorySettling(
        fine=fine, estimator=estimator, torque_limit=torque_limit, period=period
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
    gains = _gains(TWO_CHANNEL, model, torque_limit)
    approach = _gains(APPROACH, model, torque_limit)
    demand = TwoChannel(**gains.demand._asdict())
    return ThreeSlewSettling(
        rate_law=FiniteTimeRate(model, torque_limit, **approach.rate_law._asdict()),
        planner=SlewPlanner(model, torque_limit, **approach.slews._asdict()),
        fine=_fine_stage(model, demand, gains, fade_lean=True),
        estimator=_estimator(model, observe, estimate, ripple),
        torque_limit=torque_limit,
        stopped_rate=approach.stopped_rate,
        lost_rate=approach.lost_rate,
        period=period,
    )


def ripple_filter(
    model: RigidBody, amplitude: float = TUNED_RIPPLE[0], frequency: float = TUNED_RIPPLE[1]
) -> RippleFilter:
    """The filter for d3 = amplitude sin(frequency t + any phase) about the third axis of `model`.

    `amplitude` in N m, `frequency` in rad/s, by default those of the paper. It expects a ripple of
    ω3 in proportion to amplitude / (J3 frequency), but none smaller than the paper's d3 makes. A
    frequency of zero means that no periodic d3 is known: the filter then keeps the paper's.
    """
    moment = float(model.spacecraft.moments[2])
    tuned = TUNED_RIPPLE[0] / (TUNED_MOMENTS[2] * TUNED_RIPPLE[1])
    frequency = abs(frequency) or TUNED_RIPPLE[1]
    size = abs(amplitude) / (moment * frequency) / tuned
    return RippleFilter(frequency=frequency, amplitude=RIPPLE_EXPECTED * max(1.0, size))


Gains = TypeVar("Gains", bound=tuple)


def _gains(table: Mapping[float, Gains], model: RigidBody, torque_limit: float | int) -> Gains:
    """Those tuned for the limit; between two limits on straight lines in logarithms."""
    limit = float(torque_limit)
    if not 0 < limit < np.inf:
        raise ValueError(
            f"Argument `torque_limit` must be positive and finite, but got {torque_limit} N m."
        )
    limit = equivalent_limit(_moments(model), limit)
    known = sorted(table)
    limit = min(max(limit, known[0]), known[-1])
    if limit in table:
        return table[limit]
    place = bisect.bisect(known, limit)
    low, high = known[place - 1 : place + 1]
    share = np.log(limit / low) / np.log(high / low)
    return jax.tree.map(
        lambda one, other: float(one ** (1 - share) * other**share), table[low], table[high]
    )


def _fine_stage(model, demand, gains: FineGains, *, fade_lean: bool) -> FineStage:
    oscillator = Oscillator(
        model,
        demand,
        frequency=gains.frequency,
        tilt_gain=gains.tilt_gain,
        rate_gain=gains.rate_gain,
        largest_amplitude=gains.largest_amplitude,
        ratio=gains.ratio,
        dead_zone=DEAD_ZONE,
    )
    torque_scale = TORQUE_SCALE / equivalent_limit(_moments(model), 1.0)
    regulator = OrbitalRegulator.design(model, STATE_SCALE, torque_scale)
    handover = Handover(gains.enter_slow_rate, gains.enter_rate)
    return FineStage(oscillator, regulator, handover, fade_lean)


def _estimator(
    model: RigidBody, observe: bool, estimate: bool, ripple: AbstractRippleEstimator | None
) -> ThirdAxisEstimator:
    observer = (ripple or ripple_filter(model)) if observe else None
    return ThirdAxisEstimator(model, observer, RecursiveLeastSquares() if estimate else None)


def _moments(model: RigidBody) -> list[float]:
    return np.asarray(model.spacecraft.moments).tolist()
