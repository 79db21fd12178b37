"""What the switching law declares."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

from jaxsat.core.declaration.keys import Finding, Key, Rule, number
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.declaration.rate import OMEGA3_WIDTH, RATE_GAINS
from jaxsat.core.declaration.three_axis import (
    INTERNAL_MODEL_HAS_A_FREQUENCY,
    THREE_AXIS_GAINS,
    THREE_AXIS_OPTIONS,
)
from jaxsat.core.ranges import SECONDS

_THRESHOLDS = ("lower_threshold_rad_s", "upper_threshold_rad_s")
SLOPE_LIMITS = ("rate_slope_limit_rad_s2", "three_axis_slope_limit_rad_s2")


def _within(part: str, keys: tuple[Key, ...]) -> tuple[Key, ...]:
    """Keys of a law that is a part of this one."""
    return tuple(
        dataclasses.replace(key, tunable=key.tunable and f"{part}.{key.tunable}") for key in keys
    )


def _slopes_are_limited(
    limit: float | None, wheels: Sequence[Any], *slopes: tuple | None
) -> Iterator[Finding]:
    limited = limit is not None or any(one.torque_limit_N_m is not None for one in wheels)
    for name, value in zip(SLOPE_LIMITS, slopes, strict=True):
        if not limited and value is None:
            yield Finding(
                f"control.{name}",
                "must be given in rad/s² while spacecraft.torque_limit_N_m is left out, "
                "got nothing",
                True,
            )


_KEYS = (
    *_within("rate_law", RATE_GAINS),
    *_within("three_axis_law", THREE_AXIS_GAINS),
    number(
        "upper_threshold_rad_s",
        "The rate law takes over when |ω3| exceeds this",
        "rad/s",
        above=0,
        tunable="upper_threshold",
    ),
    number(
        "lower_threshold_rad_s",
        "The three-axis law takes over again when |ω3| falls below this",
        "rad/s",
        above=0,
        tunable="lower_threshold",
    ),
    number(
        "period_s",
        "Time between two runs of the controller",
        "s",
        within=SECONDS,
    ),
    number(
        SLOPE_LIMITS[0],
        "Bounds of the rate law's reference derivative; by default torque limit / J_i",
        "rad/s²",
        above=0,
        size=2,
        default=None,
    ),
    number(
        SLOPE_LIMITS[1],
        "Bounds of the three-axis law's reference derivative; by default 5 torque limit / J_i",
        "rad/s²",
        above=0,
        size=2,
        default=None,
    ),
    OMEGA3_WIDTH,
    *_within("three_axis_law", THREE_AXIS_OPTIONS),
)

SWITCHING = LawDeclaration(
    summary="the rate law while |ω3| is large, else the three-axis law",
    keys=_KEYS,
    measures_disturbance=True,
    ordered=(_THRESHOLDS,),
    rules=(
        INTERNAL_MODEL_HAS_A_FREQUENCY,
        Rule(
            (
                "spacecraft.torque_limit_N_m",
                "wheel",
                *(f"control.{name}" for name in SLOPE_LIMITS),
            ),
            _slopes_are_limited,
        ),
    ),
    needs_unequal_moments=True,
    works_in_wz=True,
)
