"""Declarations of the paper's laws: rate, three-axis and switching."""

from collections.abc import Iterator, Sequence
from typing import Any

from jaxsat.core.declaration.keys import Finding, Rule, number, of_part, switch
from jaxsat.core.declaration.law import LawDeclaration, control_period
from jaxsat.core.ranges import KNOWN_FREQUENCY

RATE_GAINS = (
    number("k1", "Gain of the reference (38)", "√(rad/s)", above=0, tunable=True),
    number("k2", "Gain of the torque (39)", "1/s", above=0, tunable=True),
)
OMEGA3_WIDTH = number(
    "omega3_width_rad_s",
    "Rounds √|ω3| of (38) near zero; 0 is the printed law",
    at_least=0,
    default=0.0,
    width=True,
)

RATE = LawDeclaration(
    summary="angular-velocity stabilisation, (38) and (39)",
    keys=(*RATE_GAINS, OMEGA3_WIDTH),
    measures_disturbance=True,
    needs_unequal_moments=True,
    regulates_attitude=False,
    tracks_rates=True,
)


THREE_AXIS_GAINS = (
    number("k3", "Gain of the reference (40) on the tilt", "1/s", above=0, tunable=True),
    number("mu", "Gain μ of the reference (40) on the turn", "1/s", above=0, tunable=True),
    number("a", "Bound a of the saturation in (41)", above=0, tunable=True),
    number(
        "k4",
        "Gain of (42) on the rate errors: one number, or one for each axis",
        "N m s",
        above=0,
        size=(1, 2),
        tunable=True,
    ),
)
THREE_AXIS_OPTIONS = (
    switch("internal_model", "Whether the internal model of the disturbance, in (42), is on", True),
    number(
        "internal_model_frequency_rad_s",
        "Frequencies of the internal model; by default those of the disturbance about x and y",
        within=KNOWN_FREQUENCY,
        size=2,
        default=None,
    ),
    number(
        "attitude_weight_N_m",
        "Factor on the attitude terms of (42); 1 as printed",
        at_least=0,
        default=1.0,
        tunable="attitude_weight",
    ),
    number(
        "saturation_width",
        "Part of the bound a over which the corner of sat is rounded, 0 (printed) to 1",
        at_least=0,
        at_most=1,
        default=0.0,
        width=True,
    ),
    number(
        "tilt_width",
        "δ in |w|² + δ² under the fraction of (41); 0 as printed",
        at_least=0,
        default=0.0,
        tunable=True,
        width=True,
    ),
)


def _has_a_frequency(on: bool, frequency: Any, disturbance: tuple[float, ...]) -> Iterator[Finding]:
    if on and frequency is None and min(disturbance[:2]) <= 0:
        yield Finding(
            "control.internal_model_frequency_rad_s",
            "must be given in rad/s while internal_model is true and disturbance.frequency_rad_s "
            f"is not positive about x and y, got nothing beside {list(disturbance)}",
            True,
        )


INTERNAL_MODEL_HAS_A_FREQUENCY = Rule(
    (
        "control.internal_model",
        "control.internal_model_frequency_rad_s",
        "disturbance.frequency_rad_s",
    ),
    _has_a_frequency,
)

THREE_AXIS = LawDeclaration(
    summary="three-axis stabilisation, (40) to (42)",
    keys=(*THREE_AXIS_GAINS, *THREE_AXIS_OPTIONS),
    measures_disturbance=True,
    rules=(INTERNAL_MODEL_HAS_A_FREQUENCY,),
    works_in_wz=True,
    jumps_without=("saturation_width", "tilt_width"),
    tracks_rates=True,
)


_THRESHOLDS = ("lower_threshold_rad_s", "upper_threshold_rad_s")
SLOPE_LIMITS = ("rate_slope_limit_rad_s2", "three_axis_slope_limit_rad_s2")


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
    *of_part("rate_law", RATE_GAINS),
    *of_part("three_axis_law", THREE_AXIS_GAINS),
    number(
        "upper_threshold_rad_s",
        "The rate law takes over when |ω3| exceeds this",
        above=0,
        tunable="upper_threshold",
    ),
    number(
        "lower_threshold_rad_s",
        "The three-axis law takes over again when |ω3| falls below this",
        above=0,
        tunable="lower_threshold",
    ),
    control_period(),
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
    *of_part("three_axis_law", THREE_AXIS_OPTIONS),
)

SWITCHING = LawDeclaration(
    summary="the rate law while |ω3| is large, else the three-axis law",
    keys=_KEYS,
    measures_disturbance=True,
    ordered=(_THRESHOLDS,),
    rules=(
        INTERNAL_MODEL_HAS_A_FREQUENCY,
        Rule(
            ("spacecraft.torque_limit_N_m", "wheel", *(f"control.{name}" for name in SLOPE_LIMITS)),
            _slopes_are_limited,
        ),
    ),
    needs_unequal_moments=True,
    works_in_wz=True,
)
