"""Gains of the laws that settle, without dimension: rates times τ of `jaxsat.declaration.scaling`.

They were tuned for the paper's spacecraft, section 5, at thrusters of 1, 5 and 20 N m: τ = 18.57,
8.305 and 4.153 s. With its orbit, disturbance and sensors the period over τ tells these apart.

How they were found:

- Oscillatory law, 5 N m: `jaxsat tune oscillatory-dispersed`, rounded. It tunes all but `rest` and
  `enter_rate`.
- Oscillatory law, 1 N m: the same, rates and frequencies times √(1/5), rounded.
- Three slews: `benchmarks/preset_gains.py` (CMA-ES on settling times at all three levels), rounded;
  `approach`, `tilt_gain`, `ratio`, `lost_rate` and the inner `rate_gain` of slews and fine stage by
  searches older than that. The commands of these are not known any more.
- Oscillatory law, 20 N m, its `rest` and `enter_rate`: the same older searches.

Descent from those of the oscillatory law at 1 and 20 N m found nothing better
(`docs/tuning-results.md`).
This checks them all; `docs/laws.md` has what it gives:

    jaxsat compare --law three-slew --law oscillatory --level all --torque-limit all \\
        --seed 90417 -n 2000

This tunes those of the oscillatory law again, once mine.toml has the torque limit wanted and none
of the seven gains in `[control]`, so that it starts from those below; times τ they go here:

    jaxsat scenarios show oscillatory-dispersed > mine.toml
    jaxsat tune mine.toml

Of the three slews the keys of `[control]` are the gains that decide how long they take; the others
(tolerances, hand-over, gains of inner loops) are changed here alone.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxsat.declaration.scaling import STEPS, Scaling


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


MORIN_SAMSON: Mapping[float, FineGains] = {
    STEPS[0]: FineGains(
        demand=MorinSamsonGains(
            k3=0.557123065,
            damping=0.76,
            rest=0.02,
        ),
        frequency=1.59708612,
        tilt_gain=0.557123065,
        rate_gain=4.828399897,
        largest_amplitude=1.299953818,
        ratio=1.52,
        enter_rate=0.03714153767,
    ),
    STEPS[1]: FineGains(
        demand=MorinSamsonGains(
            k3=0.55228917,
            damping=0.761,
            rest=0.02,
        ),
        frequency=1.602884358,
        tilt_gain=0.5531196801,
        rate_gain=4.841873476,
        largest_amplitude=1.303900747,
        ratio=1.52,
        enter_rate=0.0166102006,
    ),
    STEPS[2]: FineGains(
        demand=MorinSamsonGains(
            k3=0.5398315196,
            damping=0.802,
            rest=0.02,
        ),
        frequency=1.586274158,
        tilt_gain=0.5564417202,
        rate_gain=6.602554739,
        largest_amplitude=1.677630261,
        ratio=1.72,
        enter_rate=0.008305100301,
    ),
}
"""Of the oscillatory law, by the period over τ."""

TWO_CHANNEL: Mapping[float, FineGains] = {
    STEPS[0]: FineGains(
        demand=TwoChannelGains(
            k3=1.883,
            kz=0.617,
            rest=0.01703,
        ),
        frequency=3.009,
        tilt_gain=2.989893782,
        rate_gain=25.25624561,
        largest_amplitude=2.821,
        ratio=1.5,
        enter_rate=0.1178,
    ),
    STEPS[1]: FineGains(
        demand=TwoChannelGains(
            k3=1.455,
            kz=0.897,
            rest=0.01164,
        ),
        frequency=3.124,
        tilt_gain=2.175936279,
        rate_gain=3.770515537,
        largest_amplitude=1.162,
        ratio=1.24,
        enter_rate=0.03242,
    ),
    STEPS[2]: FineGains(
        demand=TwoChannelGains(
            k3=1.68,
            kz=1.357,
            rest=0.01403,
        ),
        frequency=2.994,
        tilt_gain=1.324663498,
        rate_gain=25.03987741,
        largest_amplitude=4.365,
        ratio=1.07,
        enter_rate=0.007821,
    ),
}
"""Of the fine stage of the three slews, by the period over τ."""

APPROACH: Mapping[float, ApproachGains] = {
    STEPS[0]: ApproachGains(
        rate_law=RateLawGains(
            share=0.7439,
            rate_gain=313.7,
            dead_zone=0.0005208,
        ),
        slews=SlewGains(
            share=0.9192,
            approach=47.91258359,
            rate_gain=51.99815273,
            angle_tolerance=0.007404,
            rate_tolerance=0.2515,
        ),
        stopped_rate=0.1044,
        lost_rate=0.03714153767,
    ),
    STEPS[1]: ApproachGains(
        rate_law=RateLawGains(
            share=0.8403,
            rate_gain=12.03,
            dead_zone=0.0002679,
        ),
        slews=SlewGains(
            share=0.8446,
            approach=39.61532844,
            rate_gain=19.4339347,
            angle_tolerance=0.003297,
            rate_tolerance=0.007757,
        ),
        stopped_rate=0.04129,
        lost_rate=0.4152550151,
    ),
    STEPS[2]: ApproachGains(
        rate_law=RateLawGains(
            share=0.8811,
            rate_gain=6.514,
            dead_zone=0.0002099,
        ),
        slews=SlewGains(
            share=0.8599,
            approach=30.3966671,
            rate_gain=9.675441851,
            angle_tolerance=0.002232,
            rate_tolerance=0.002846,
        ),
        stopped_rate=0.01338,
        lost_rate=0.2076275075,
    ),
}
"""Of the three slews, by the period over τ."""


def tuned_frequency(table: Mapping[float, FineGains], scaling: Scaling) -> float:
    """ν (rad/s) of a table; between two of its steps on a straight line in logarithms."""
    known = [table[step].frequency for step in STEPS]
    number = np.exp(np.interp(np.log(scaling.step), np.log(STEPS), np.log(known)))
    return float(number) / scaling.time
