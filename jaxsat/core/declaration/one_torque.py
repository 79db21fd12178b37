"""Declaration of the law of one torque."""

from jaxsat.core.declaration.keys import number, switch
from jaxsat.core.declaration.law import LawDeclaration, control_period

ONE_TORQUE = LawDeclaration(
    summary="stop the rotation with one torque: turn the momentum to where it can be braked, "
    "brake, rest.\n\n"
    "Gains that are left out follow from inertia, torque limit and control period",
    keys=(
        number(
            "share",
            "Share of the torque limit that a brake is planned with",
            above=0,
            at_most=1,
            default=0.35,
            tunable=True,
        ),
        number(
            "turn_ratio",
            "Largest momentum about the torque axis while turning, over that across it",
            above=0,
            default=1.1,
            tunable=True,
        ),
        number(
            "exponent",
            "Exponent p of a brake, |y| falls as x^p",
            above=1,
            at_most=10,
            default=1.6,
            tunable=True,
        ),
        number(
            "rate_gain",
            "Gain on the momentum about the torque axis; by default from the torque limit",
            "1/s",
            above=0,
            default=None,
            tunable=True,
        ),
        number(
            "rest_rate_rad_s",
            "Rate below which the law rests; 0.001 counts as settled",
            above=0,
            default=8e-4,
            tunable="rest_rate",
        ),
        switch("estimate_inertia", "Whether inertia and torque axis are estimated in flight", True),
        control_period(default=0.1),
    ),
    torques=1,
    needs_torque_limit=True,
    regulates_attitude=False,
)
