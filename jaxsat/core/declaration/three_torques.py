"""Declarations of the laws of three torques: quaternion feedback, and the fault-tolerant law."""

from collections.abc import Iterator
from typing import Any

from jaxsat.core.declaration.keys import Finding, Rule, number, of_part
from jaxsat.core.declaration.law import LawDeclaration, control_period

CALM = 0.1
"""Rate, over third-axis band times natural frequency, that begins to leave an error alone."""

FULL = 0.7
"""Fraction of a wheel's momentum limit beyond which thrusters unload it."""

QUATERNION_FEEDBACK = LawDeclaration(
    summary="quaternion feedback with torques about all three axes",
    keys=(
        number(
            "natural_frequency_rad_s",
            "Natural frequency of small attitude errors",
            above=0,
            tunable="natural_frequency",
        ),
        number("damping", "Their damping ratio", above=0, default=1.0, tunable="damping"),
        number(
            "max_rate_rad_s",
            "Largest rate of a slew relative to the orbit frame; by default none",
            above=0,
            default=None,
        ),
        control_period(default=0.1),
    ),
    torques=3,
)


def _band_is_of_two_kinds(band: float | None, thrusters: Any, wheels: Any) -> Iterator[Finding]:
    if band is not None and not (thrusters and wheels):
        message = "must be omitted without tables [[wheel]] and [[thruster]]"
        yield Finding("control.third_axis_band_rad", f"{message}, got {band:g}")


FAULT_TOLERANT = LawDeclaration(
    summary="quaternion feedback that detects and isolates failed thrusters and wheels and "
    "reallocates the torque",
    keys=(
        *of_part("healthy", QUATERNION_FEEDBACK.keys),
        number(
            "cusum_reference",
            "Shift that each CUSUM test leaves out, half of what it detects best, in sigmas",
            above=0,
            at_most=10,
            default=1.0,
            tunable="diagnosis.reference",
        ),
        number(
            "cusum_threshold",
            "Threshold of each CUSUM test, in sigmas; at 12 and a reference of 1 false alarms are "
            "1.4e11 scores apart",
            above=0,
            at_most=1e3,
            default=12.0,
            tunable="diagnosis.threshold",
        ),
        number(
            "isolation_margin",
            "Log-likelihood by which an actuator and its failure must explain the residuals better "
            "than any other",
            above=0,
            at_most=1e3,
            default=8.0,
            tunable="diagnosis.margin",
        ),
        number(
            "torque_uncertainty",
            "Error that the law expects of torques, relative to themselves",
            above=0,
            at_most=1,
            default=0.1,
            tunable="diagnosis.uncertainty",
        ),
        number(
            "rate_noise_rad_s",
            "Standard deviation of the rates that the law receives; by default that of the sensors",
            above=0,
            at_most=1,
            default=None,
        ),
        number(
            "third_axis_band_rad",
            "Error about the axis that no wheel drives up to which thrusters leave it alone; by "
            "default they control it all the time",
            above=0,
            at_most=1,
            default=None,
        ),
    ),
    torques=3,
    commands_actuators=True,
    steers=("magnetorquer",),
    rules=(Rule(("control.third_axis_band_rad", "thruster", "wheel"), _band_is_of_two_kinds),),
)
