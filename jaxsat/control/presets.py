"""Settling controllers for any inertia, torque limit and control period.

Their gains are dimensionless. The unit of time is τ of `jaxsat.core.declaration.tuned_gains`, J0
being the geometric mean of S1 and S2, so a larger body under proportionally larger torques behaves
alike. The gains are functions of the control period over τ, tuned at three values of it,
interpolated between them and constant outside. The ripple estimator uses the known part of the
periodic d3.
"""

import bisect
import math
from collections.abc import Mapping
from typing import TypeVar

import jax
import numpy as np
from jaxtyping import Float

from jaxsat.control.demands import AbstractDemand, MorinSamson, TwoChannel
from jaxsat.control.estimators import ThirdAxisEstimator
from jaxsat.control.fine import FineStage, Handover, OscillatorySettling
from jaxsat.control.finite_time_rate import FiniteTimeRate
from jaxsat.control.least_squares import RecursiveLeastSquares
from jaxsat.control.normal_form import BODY_XY, NormalForm
from jaxsat.control.oscillatory import Oscillator
from jaxsat.control.ripple import RippleFilter
from jaxsat.control.slews import SlewPlanner
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.core.declaration.settling import TUNED_PERIOD
from jaxsat.core.declaration.settling import holding_amplitude as own_amplitude
from jaxsat.core.declaration.tuned_gains import (
    APPROACH,
    MORIN_SAMSON,
    TWO_CHANNEL,
    FineGains,
    Scaling,
    in_seconds,
)
from jaxsat.spacecraft.dynamics import RigidBody

LEAST_COUPLING = 1e-6
"""c below which S1 and S2 are treated as equal."""

TUNED_COUPLING = 0.59168
"""c of the body for which the gains are tuned."""

DEAD_ZONE = 1e-6
"""Slow rate that the oscillation leaves to the end game, rad per `fine_time`."""

RIPPLE, RIPPLE_FREQUENCY = 3e-6, 0.01
"""Smallest ripple of ω3 in the filter, and its frequency where none is known; rad per
`fine_time`."""

RIPPLE_SHARE = 0.9375
"""Expected ripple of ω3 over the a3 / (J3 Ω) of the scenario."""

RATE_NOISE, RIPPLE_DRIFT, PRODUCT_ERROR = 1e-6, 6.32455532e-08, 0.0316227766
"""Parameters of the ripple filter: noise, rad per `fine_time`, drift, also per √`fine_time`, and
error of products, times √`fine_time`."""

BALANCED = 0.35
"""Drift at rest that does not change the attitude, relative to the end game's largest ds/dt."""

PATIENCE, SLOW_RATE = 15.0, 0.2
"""Patience of the supervisor with a phase without progress, times τ, and largest |s| for slews,
over τ."""

CHANGE_NOISE = 2e-6
"""Noise of one Δω3 of the least squares, rad per `fine_time`."""

CHANGE_SAMPLES, MOST_TURNED = 10, 2.0
"""Control periods of one Δω3, and the largest change of a ripple in parts of its amplitude."""


def oscillatory_settling(
    model: RigidBody,
    torque_limit: float | int,
    *,
    observe: bool = True,
    estimate: bool = True,
    period: float = TUNED_PERIOD,
    ripple: RippleFilter | None = None,
    directions: Float[np.ndarray, "3 2"] = BODY_XY,
    holding_amplitude: float | None = None,
    gravity_gradient: bool = False,
) -> OscillatorySettling:
    """The Morin-Samson law and the end game.

    `model` is the controller's model of the plant. `observe` enables the estimate of the ripple of
    d3 (by `ripple`, default `ripple_filter(model, ...)`), `estimate` that of the errors of axes and
    inertia. The two torques are about the orthonormal `directions`; `holding_amplitude` (rad/s) is
    the largest of the end game, `gravity_gradient` is true if its torque acts, which moves the held
    attitude. Raises `ValueError` for a torque limit that is not positive and finite, and for S1 =
    S2, where nothing moves the third axis.
    """
    form = NormalForm.of(model, directions)
    scaling = scaling_of(form, torque_limit, period)
    gains = _gains(MORIN_SAMSON, scaling)
    share = min(float(form.coupling) / TUNED_COUPLING, 1.0)
    demand = MorinSamson(**gains.demand._replace(k3=gains.demand.k3 * math.sqrt(share))._asdict())
    ripple = (ripple or ripple_filter(form, torque_limit, period=period)) if observe else None
    fine = _fine_stage(form, demand, gains, scaling, holding_amplitude, fade_lean=False)
    return OscillatorySettling(
        fine=fine,
        estimator=_estimator(fine, estimate, ripple, scaling, gravity_gradient),
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
    ripple: RippleFilter | None = None,
    directions: Float[np.ndarray, "3 2"] = BODY_XY,
    holding_amplitude: float | None = None,
    gravity_gradient: bool = False,
) -> ThreeSlewSettling:
    """Rate law, three slews, two-channel law and end game; arguments as above."""
    form = NormalForm.of(model, directions)
    scaling = scaling_of(form, torque_limit, period)
    gains, approach = _gains(TWO_CHANNEL, scaling), _gains(APPROACH, scaling)
    demand = TwoChannel(**gains.demand._asdict())
    ripple = (ripple or ripple_filter(form, torque_limit, period=period)) if observe else None
    fine = _fine_stage(form, demand, gains, scaling, holding_amplitude, fade_lean=True)
    return ThreeSlewSettling(
        rate_law=FiniteTimeRate(form, torque_limit, **approach.rate_law._asdict()),
        planner=SlewPlanner(form, torque_limit, **approach.slews._asdict()),
        fine=fine,
        estimator=_estimator(fine, estimate, ripple, scaling, gravity_gradient),
        torque_limit=torque_limit,
        stopped_rate=approach.stopped_rate,
        lost_rate=approach.lost_rate,
        patience=PATIENCE * scaling.time,
        slow_rate=SLOW_RATE / scaling.time,
        period=period,
    )


def ripple_filter(
    form: NormalForm,
    torque_limit: float | int,
    amplitude: float = 0.0,
    frequency: float = 0.0,
    period: float = TUNED_PERIOD,
) -> RippleFilter:
    """The filter for d3 = amplitude sin(frequency t + any phase) about the axis n of `form`.

    `amplitude` in N m, `frequency` in rad/s, zero without a known periodic d3. The expected ripple
    of ω3 is proportional to amplitude / (n·Jn frequency), but at least the value for which the
    gains are tuned.
    """
    unit = scaling_of(form, torque_limit, period).fine_time
    frequency = abs(frequency) or RIPPLE_FREQUENCY / unit
    size = abs(amplitude) / (moments_of(form)[2] * frequency)
    return RippleFilter(
        frequency,
        noise=RATE_NOISE / unit,
        amplitude=max(RIPPLE / unit, RIPPLE_SHARE * size),
        drift=RIPPLE_DRIFT / unit**1.5,
        product_error=PRODUCT_ERROR * math.sqrt(unit),
    )


Gains = TypeVar("Gains", bound=tuple)


def scaling_of(form: NormalForm, torque_limit: float | int, period: float) -> Scaling:
    """The units of time of the gains; raises `ValueError` where S1 and S2 are equal."""
    first, second, third = moments_of(form)
    if not first - second > LEAST_COUPLING * third:
        raise ValueError("Argument `model` must have S1 apart from S2, but they are equal.")
    return Scaling.of(math.sqrt(first * second), torque_limit, period)


def _gains(table: Mapping[float, Gains], scaling: Scaling) -> Gains:
    """The gains in SI; between two of the tuned steps linear in logarithms."""
    steps = sorted(table)
    step = min(max(scaling.step, steps[0]), steps[-1])
    place = min(bisect.bisect(steps, step), len(steps) - 1)
    low, high = steps[place - 1 : place + 1]
    share = math.log(step / low) / math.log(high / low)
    gains = jax.tree.map(
        lambda one, other: float(one ** (1 - share) * other**share), table[low], table[high]
    )
    return in_seconds(gains, scaling)


def _fine_stage(
    form: NormalForm,
    demand: AbstractDemand,
    gains: FineGains,
    scaling: Scaling,
    amplitude: float | None,
    *,
    fade_lean: bool,
) -> FineStage:
    unit = scaling.fine_time
    oscillator = Oscillator(
        form,
        demand,
        frequency=gains.frequency,
        tilt_gain=gains.tilt_gain,
        rate_gain=gains.rate_gain,
        largest_amplitude=gains.largest_amplitude,
        ratio=gains.ratio,
        dead_zone=DEAD_ZONE / unit,
    )
    if amplitude is None:
        amplitude = own_amplitude(scaling, float(form.model.orbit.rate))
    return FineStage(oscillator, amplitude, Handover(gains.enter_rate), fade_lean)


def _estimator(
    fine: FineStage,
    estimate: bool,
    ripple: RippleFilter | None,
    scaling: Scaling,
    gravity_gradient: bool,
) -> ThirdAxisEstimator:
    noise = CHANGE_NOISE / scaling.fine_time
    if ripple is not None:  # the ripple, too, changes s between two samples
        turned = float(ripple.frequency) * CHANGE_SAMPLES * scaling.step * scaling.time
        noise = math.hypot(noise, float(ripple.amplitude) * min(turned, MOST_TURNED))
    fit = RecursiveLeastSquares(noise=noise, samples=CHANGE_SAMPLES) if estimate else None
    form = fine.oscillator.form
    acts = gravity_gradient and float(form.model.orbit.rate) != 0
    gradient = form.gradient_rate if acts else None
    return ThirdAxisEstimator(form, ripple, fit, balanced_drift(fine), gradient)


def balanced_drift(fine: FineStage) -> Float[jax.Array, ""]:
    """Drift at rest (rad/s²) for which the attitude is not changed."""
    _, coupling, amplitude = numpy_if_known(fine.oscillator.form.coupling, fine.holding_amplitude)
    return as_float(BALANCED * coupling * amplitude**2 / 2)


def moments_of(form: NormalForm) -> list[float]:
    """S1, S2 and n·Jn, kg m²."""
    return np.asarray(form.moments).tolist()
