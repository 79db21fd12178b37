"""Gains of the laws that settle, without dimension: rates times τ, see `jaxsat.control.scaling`.

They were tuned for the paper's spacecraft, section 5, at thrusters of 1, 5 and 20 N m: τ = 18.57,
8.305 and 4.153 s. With its orbit, disturbance and sensors the period over τ tells these apart.

How they were found:

- Oscillatory law, 5 N m: `jaxsat tune oscillatory-dispersed`, rounded. It tunes all but `rest`,
  `enter_slow_rate` and `enter_rate`.
- Oscillatory law, 1 N m: the same, rates and frequencies times √(1/5), rounded.
- All others, `rest`, `enter_slow_rate` and `enter_rate` included: by searches older than
  `jaxsat tune`, and some of them changed later. The commands are not known any more.

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

from jaxsat.control.scaling import STEPS


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
    enter_slow_rate: float
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
        enter_slow_rate=0.0004159852219,
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
        enter_slow_rate=0.0002973225908,
        enter_rate=0.0166102006,
    ),
    STEPS[2]: FineGains(
        demand=MorinSamsonGains(
            k3=0.5398315196,
            damping=0.802,
            rest=0.02,
        ),
        frequency=1.586274158,
        tilt_gain=6.602554739,
        rate_gain=0.5564417202,
        largest_amplitude=1.677630261,
        ratio=1.72,
        enter_slow_rate=0.0001291443097,
        enter_rate=0.008305100301,
    ),
}
"""Of the oscillatory law, by the period over τ."""

TWO_CHANNEL: Mapping[float, FineGains] = {
    STEPS[0]: FineGains(
        demand=TwoChannelGains(
            k3=2.098496878,
            kz=0.9173959804,
            rest=0.008,
        ),
        frequency=3.157030702,
        tilt_gain=25.25624561,
        rate_gain=2.989893782,
        largest_amplitude=2.265633798,
        ratio=1.5,
        enter_slow_rate=0.0007428307533,
        enter_rate=0.04642692208,
    ),
    STEPS[1]: FineGains(
        demand=TwoChannelGains(
            k3=1.079663039,
            kz=1.079663039,
            rest=0.008,
        ),
        frequency=3.32204012,
        tilt_gain=2.175936279,
        rate_gain=3.770515537,
        largest_amplitude=1.212544644,
        ratio=1.24,
        enter_slow_rate=0.000249153009,
        enter_rate=0.0166102006,
    ),
    STEPS[2]: FineGains(
        demand=TwoChannelGains(
            k3=0.8305100301,
            kz=1.038137538,
            rest=0.008,
        ),
        frequency=2.49153009,
        tilt_gain=1.324663498,
        rate_gain=25.03987741,
        largest_amplitude=3.263904418,
        ratio=1.07,
        enter_slow_rate=0.0001245765045,
        enter_rate=0.008305100301,
    ),
}
"""Of the fine stage of the three slews, by the period over τ."""

APPROACH: Mapping[float, ApproachGains] = {
    STEPS[0]: ApproachGains(
        rate_law=RateLawGains(
            share=0.551,
            rate_gain=185.7076883,
            dead_zone=0.00111424613,
        ),
        slews=SlewGains(
            share=0.897,
            approach=47.91258359,
            rate_gain=51.99815273,
            angle_tolerance=0.004,
            rate_tolerance=0.2117067647,
        ),
        stopped_rate=0.1467090738,
        lost_rate=0.03714153767,
    ),
    STEPS[1]: ApproachGains(
        rate_law=RateLawGains(
            share=0.779,
            rate_gain=9.301712337,
            dead_zone=0.000249153009,
        ),
        slews=SlewGains(
            share=0.791,
            approach=39.61532844,
            rate_gain=19.4339347,
            angle_tolerance=0.0027,
            rate_tolerance=0.007308488265,
        ),
        stopped_rate=0.03903397141,
        lost_rate=0.4152550151,
    ),
    STEPS[2]: ApproachGains(
        rate_law=RateLawGains(
            share=0.881,
            rate_gain=3.30127737,
            dead_zone=0.0002076275075,
        ),
        slews=SlewGains(
            share=0.825,
            approach=30.3966671,
            rate_gain=9.675441851,
            angle_tolerance=0.002,
            rate_tolerance=0.002657632096,
        ),
        stopped_rate=0.01121188541,
        lost_rate=0.2076275075,
    ),
}
"""Of the three slews, by the period over τ."""
