"""What the three-axis law declares."""

from collections.abc import Iterator
from typing import Any

from jaxsat.core.declaration.keys import Finding, Rule, number, switch
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.ranges import KNOWN_FREQUENCY

THREE_AXIS_GAINS = (
    number("k3", "Gain of the reference (40) on the tilt", "1/s", above=0, tunable=True),
    number("mu", "Gain μ of the reference (40) on the turn", "1/s", above=0, tunable=True),
    number("a", "Bound a of the saturation in (41)", "1", above=0, tunable=True),
    number(
        "k4",
        "Gain of (42) on the rate errors: one number, or one for each axis",
        "N m s",
        above=0,
        size=2,
        or_one=True,
        tunable=True,
    ),
)
THREE_AXIS_OPTIONS = (
    switch("internal_model", "Whether the internal model of the disturbance, in (42), is on", True),
    number(
        "internal_model_frequency_rad_s",
        "Frequencies of the internal model; by default those of the disturbance about x and y",
        "rad/s",
        within=KNOWN_FREQUENCY,
        size=2,
        default=None,
    ),
    number(
        "attitude_weight_N_m",
        "Factor on the attitude terms of (42); 1 as printed",
        "N m",
        at_least=0,
        default=1.0,
        tunable="attitude_weight",
    ),
    number(
        "saturation_width",
        "Part of the bound a over which the corner of sat is rounded, 0 (printed) to 1",
        "1",
        at_least=0,
        at_most=1,
        default=0.0,
        width=True,
    ),
    number(
        "tilt_width",
        "δ in |w|² + δ² under the fraction of (41); 0 as printed",
        "1",
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
