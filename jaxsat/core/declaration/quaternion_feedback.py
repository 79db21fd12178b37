"""What the healthy spacecraft's law declares."""

from jaxsat.core.declaration.keys import number
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.ranges import SECONDS

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
        number(
            "period_s",
            "Time between two runs of the controller",
            "s",
            within=SECONDS,
            default=0.1,
        ),
    ),
    torques=3,
)
