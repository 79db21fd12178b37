"""What the laws of three torques declare: quaternion feedback, and the fault-tolerant one."""

from jaxsat.core.declaration.keys import number, of_part
from jaxsat.core.declaration.law import LawDeclaration, control_period

QUATERNION_FEEDBACK = LawDeclaration(
    summary="quaternion feedback with torques about all three axes",
    keys=(
        number(
            "natural_frequency_rad_s",
            "Natural frequency of small attitude errors",
            "rad/s",
            above=0,
            tunable="natural_frequency",
        ),
        number("damping", "Their damping ratio", "1", above=0, default=1.0, tunable="damping"),
        number(
            "max_rate_rad_s",
            "Largest rate of a slew relative to the orbit frame; by default none",
            "rad/s",
            above=0,
            default=None,
        ),
        control_period(default=0.1),
    ),
    torques=3,
)


FAULT_TOLERANT = LawDeclaration(
    summary="quaternion feedback that detects and isolates failed thrusters and wheels and "
    "reallocates the torque",
    keys=(
        *of_part("healthy", QUATERNION_FEEDBACK.keys),
        number(
            "cusum_reference",
            "Shift that each CUSUM test leaves out, half of what it detects best, in sigmas",
            "1",
            above=0,
            at_most=10,
            default=1.0,
            tunable="diagnosis.reference",
        ),
        number(
            "cusum_threshold",
            "Threshold of each CUSUM test, in sigmas; at 12 and a reference of 1 false alarms are "
            "1.4e11 scores apart",
            "1",
            above=0,
            at_most=1e3,
            default=12.0,
            tunable="diagnosis.threshold",
        ),
        number(
            "isolation_margin",
            "Log-likelihood by which an actuator and its failure must explain the residuals better "
            "than any other",
            "1",
            above=0,
            at_most=1e3,
            default=8.0,
            tunable="diagnosis.margin",
        ),
        number(
            "torque_uncertainty",
            "Error that the law expects of torques, relative to themselves",
            "1",
            above=0,
            at_most=1,
            default=0.1,
            tunable="diagnosis.uncertainty",
        ),
        number(
            "rate_noise_rad_s",
            "Standard deviation of the rates that the law receives; by default that of the sensors",
            "rad/s",
            above=0,
            at_most=1,
            default=None,
        ),
    ),
    torques=3,
    commands_actuators=True,
    steers=("magnetorquer",),
)
