"""Declarations of the settling laws, and the spacecraft for which their gains are tuned."""

import math
from collections.abc import Sequence

from jaxsat.core.declaration.domain import sweeps_of
from jaxsat.core.declaration.keys import LARGEST, number, of_part, switch
from jaxsat.core.declaration.law import LawDeclaration, control_period
from jaxsat.core.declaration.tuned_gains import Scaling

TUNED_MOMENTS = (449.5, 264.6, 312.5)
"""Principal moments (kg m²) for which the gains are tuned."""

TUNED_PERIOD = 0.1
"""Control period (s) for which the gains are tuned."""

TUNED_LIMITS = (1.0, 5.0, 20.0)
"""Torque limits (N m) for which the gains are tuned."""

HOLDING_AMPLITUDE = "holding_amplitude_rad_s"
"""Key of the amplitude of the end game."""

PLANNING_MARGIN, REPLAN_TIME = 0.1, 0.2
"""Default share of the torque limit left for feedback, and time between plans over √(J0/T)."""


QUIET_AMPLITUDE, QUIET_RATE, HOLDING_SHARE = 4.5e-5, 4.2e-3, 0.45
"""Largest amplitude of the end game: rad per `fine_time`, bounded by rad over τ, or this share of
the orbit rate if that is more, as a drift at rest is proportional to its square."""

LEAST_ROUNDNESS, LARGEST_FALL = 1 / 8, math.pi / 2
"""Smallest q of the flat-topped waves of the end game (`jaxsat.control.oscillatory`), which gives
8/9 of the mean square of a square wave, and a bound on the integral of a wave relative to that of a
sine."""


def holding_amplitude(scaling: Scaling, orbit_rate: float) -> float:
    """Return the default of the largest amplitude of the end game, rad/s."""
    amplitude = min(QUIET_AMPLITUDE / scaling.fine_time, QUIET_RATE / scaling.time)
    return max(amplitude, HOLDING_SHARE * abs(orbit_rate))


def equivalent_limit(moments: Sequence[float], torque_limit: float) -> float:
    """Return the limit (N m) that turns the tuned body as fast as `torque_limit` turns this one.

    The comparison uses the geometric mean of J1 and J2 (kg m²).
    """
    tuned = math.sqrt(TUNED_MOMENTS[0] * TUNED_MOMENTS[1])
    return float(torque_limit) * (tuned / math.sqrt(float(moments[0]) * float(moments[1])))


_COMMON_KEYS = (
    switch(
        "observe_ripple", "Whether the ripple of d3 is observed and left out of the feedback", True
    ),
    number(
        "ripple_frequency_rad_s",
        "Frequency of d3 that the controller believes; by default that of the disturbance",
        above=0,
        default=None,
    ),
    number(
        "ripple_amplitude_N_m",
        "Amplitude of d3 that the controller expects; by default that of the disturbance",
        at_least=0,
        default=None,
    ),
    number(
        HOLDING_AMPLITUDE,
        "Largest amplitude of the oscillation in the end game; by default a function of inertia, "
        "torque limit, period and orbit rate",
        "rad/s",
        above=0,
        default=None,
    ),
    switch(
        "estimate_axes", "Whether leaning thruster axes and the inertia ratio are estimated", True
    ),
    control_period(TUNED_PERIOD, "; the gains are tuned for 0.1"),
)


def _gain(name: str, meaning: str, unit: str, place: str, at_most: float | int = LARGEST):
    return number(name, meaning, unit, above=0, at_most=at_most, default=None, tunable=place)


_OSCILLATOR = "fine.oscillator"
_DEMAND = f"{_OSCILLATOR}.demand"

_OSCILLATION_KEYS = (
    _gain("frequency_rad_s", "Frequency ν of the oscillation", "rad/s", f"{_OSCILLATOR}.frequency"),
    _gain("tilt_gain", "Gain k on the tilt", "1/s", f"{_OSCILLATOR}.tilt_gain"),
    _gain("rate_gain", "Gain kω on the rate errors", "1/s", f"{_OSCILLATOR}.rate_gain"),
    _gain(
        "largest_amplitude_rad_s",
        "Largest amplitude ρm of the oscillation",
        "rad/s",
        f"{_OSCILLATOR}.largest_amplitude",
    ),
    _gain(
        "ratio",
        "Ratio r of the two amplitudes of the oscillation at the most, h / ρ²",
        "1",
        f"{_OSCILLATOR}.ratio",
    ),
)

OSCILLATORY = LawDeclaration(
    summary="oscillate about the driven axes until all is small, then hold.\n\n"
    "By default, gains follow from inertia, torque limit and control period: dimensionless gains, "
    "interpolated between three tuned sets",
    keys=(
        *_OSCILLATION_KEYS,
        _gain("k3", "Gain of the slow motion about the third axis", "1/s", f"{_DEMAND}.k3"),
        _gain("damping", "Damping ratio ζ of that motion", "1", f"{_DEMAND}.damping"),
        *_COMMON_KEYS,
    ),
    any_plane=True,
    needs_torque_limit=True,
    needs_gyroscopic_torque=True,
    domain=sweeps_of("oscillatory"),
)

_THREE_SLEW_KEYS = (
    _gain(
        "stopping_share",
        "Share η of the torque limit by which the rates to stop with are chosen",
        "1",
        "rate_law.share",
        at_most=1,
    ),
    _gain(
        "slewing_share",
        "Share of the torque limit with which slews brake",
        "1",
        "planner.share",
        at_most=1,
    ),
    _gain("slew_gain", "Gain λ with which a slew ends", "1/s", "planner.approach"),
    *_OSCILLATION_KEYS,
    _gain("k3", "Gain k3 on the slow rate", "1/s", f"{_DEMAND}.k3"),
    _gain("kz", "Gain kz on the slow turn", "1/s", f"{_DEMAND}.kz"),
)

THREE_SLEW = LawDeclaration(
    summary="stop, three slews about the driven axes, oscillate, hold.\n\n"
    "By default, gains follow from inertia, torque limit and control period: dimensionless gains, "
    "interpolated between three tuned sets",
    keys=(*_THREE_SLEW_KEYS, *_COMMON_KEYS),
    any_plane=True,
    needs_torque_limit=True,
    domain=sweeps_of("three-slew"),
)

PLANNED = LawDeclaration(
    summary="plan the quickest manoeuvre in flight, follow it, hold; three slews where a plan "
    "fails.\n\nThe other gains are those of three-slew",
    keys=(
        number(
            "planning_margin",
            "Share of the torque limit that plans leave for feedback",
            at_least=0,
            at_most=0.9,
            default=PLANNING_MARGIN,
            tunable="margin",
        ),
        _gain(
            "replan_s",
            f"Time from one plan to the next; by default {REPLAN_TIME} √(J0/T) with the mean "
            "moment J0 and the torque limit T",
            "s",
            "replan",
        ),
        *of_part("settling", _THREE_SLEW_KEYS),
        *_COMMON_KEYS,
    ),
    any_plane=True,
    needs_torque_limit=True,
    needs_gyroscopic_torque=True,
    searched=("planning_margin", "replan_s"),
)
