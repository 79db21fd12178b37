"""What the rate law declares."""

from jaxsat.core.declaration.keys import number
from jaxsat.core.declaration.law import LawDeclaration

RATE_GAINS = (
    number("k1", "Gain of the reference (38)", "√(rad/s)", above=0, tunable=True),
    number("k2", "Gain of the torque (39)", "1/s", above=0, tunable=True),
)
OMEGA3_WIDTH = number(
    "omega3_width_rad_s",
    "Rounds √|ω3| of (38) near zero; 0 is the printed law",
    "rad/s",
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
