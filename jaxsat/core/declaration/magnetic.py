"""Declaration of the law of magnetorquers."""

from collections.abc import Iterator
from typing import Any

from jaxsat.core.declaration.keys import Finding, Rule, number
from jaxsat.core.declaration.law import LawDeclaration, control_period


def _flies_by_magnetorquers(magnetorquers: Any, law: str) -> Iterator[Finding]:
    if all(one.failed for one in magnetorquers):
        message = f'must have one that works under the law "{law}", which makes torques by them'
        yield Finding("magnetorquer", f"{message}, got {len(magnetorquers)} that do not")


MAGNETIC_CONTROL = LawDeclaration(
    summary="damp a tumble by magnetorquers, then hold all axes by them, alone or with wheels, as "
    "the Earth's field turns",
    keys=(
        number(
            "control_weight",
            "Weight of torques against angles (rad) and rates in the minimised cost, in "
            "units of the mean moment of inertia and the orbit's rate, or of precession with "
            "momentum in wheels; smaller is faster",
            above=0,
            default=0.1,
        ),
        number(
            "wheel_weight",
            "The same of torques that wheels make, in units without their momentum; smaller is "
            "faster about their axes",
            above=0,
            default=1e-4,
        ),
        number(
            "damping_N_m_s",
            "Torque over rate while the body tumbles; by default from the least moment of inertia "
            "and the orbit",
            above=0,
            default=None,
        ),
        number(
            "pointing_rate_rad_s",
            "Rate relative to the orbit frame below which the attitude is controlled, and beyond "
            "twice of which it is left alone; by default four times that of the orbit",
            above=0,
            default=None,
        ),
        control_period(default=1.0),
    ),
    torques=3,
    takes_orbits=True,
    rules=(Rule(("magnetorquer", "control.law"), _flies_by_magnetorquers),),
)
