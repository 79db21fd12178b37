"""Verdicts on the controllability with a set of actuators, and the laws that can fly it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from jaxsat.control.flyable_laws import Laws
from jaxsat.controllability.actuators import ActuatorSet
from jaxsat.controllability.cone import TorqueCone
from jaxsat.controllability.decision import RankDecision
from jaxsat.controllability.wheels import MomentumLevelSet

Verdict = Literal[
    "controllable", "by drift", "some attitudes", "not decided", "borderline", "uncontrollable"
]
CONTROLLABLE = ("controllable", "by drift")
"""Verdicts by which every attitude and rate that the momentum allows can be reached."""


@dataclass(frozen=True)
class OrbitRank:
    """Directions that magnetorquers and wheels reach over an orbit, about rest near its frame.

    `rods` is the number of independent axes of magnetorquers, `wheels` that of wheels. `rank` of
    `dimension`: reached directions of attitude, rate and wheel momentum. `margin` is the ratio of
    the least to the largest singular value of a factor of the Gramian, its minimum and maximum as
    the Earth turns. `turn` (rad) is the angle from the orbit frame to the rest; NaN without a rest
    near it, where the rank is unknown. It is zero, too, where no attitude near the orbit frame is
    an equilibrium and magnetorquers hold the body there by the part `opposing` of their limits.
    """

    rods: int
    wheels: int
    rank: int
    dimension: int
    margin: tuple[float, float]
    turn: float
    opposing: float = 0.0

    @property
    def rests(self) -> bool:
        """Whether the body rests near the orbit frame, by itself or by magnetorquers."""
        return self.turn == self.turn


@dataclass(frozen=True, eq=False)
class Judgement:
    """Verdict on a set of actuators for attitude and rate, without disturbance.

    `verdict`:

    - "controllable": every attitude and rate of the level set, by the laws named in `laws`;
    - "by drift": rank 6 and a recurrent drift suffice in principle, no law of jaxsat uses it;
      or magnetorquers along one axis suffice;
    - "some attitudes": two wheels with remaining momentum, which hold only attitudes n·CH = n·β;
    - "not decided": thrusters with less than three torques, beside a coasting wheel; or
      magnetorquers where no attitude near the orbit frame is an equilibrium, and they hold none;
    - "borderline": the data or their round-off decide, or the field hardly turns at times of a day;
    - "uncontrollable".

    Failed wheels coast, with the momentum `actuators.coasting` (β). `inertia` is without the rotors
    of all wheels, as a torque turns it.

    `rank` of `dimension`: directions that brackets reach at rest, of all that the conserved
    momentum leaves. `laws`: the kind of law that can be flown, a key of `FLYABLE`. `cone` is that
    of thrusters and wheels together. `barrier` is the unit vector m with m·H ≥ 0 for ever after
    (`momentum_barrier`), `decision` the rank of the columns as torques of both signs, `level_set`
    the authority of the wheels alone; None where these do not decide. `margin` and `turn_time` as
    in `Analysis`, of the torques that laws use; NaN turn time where wheels decide. Where
    magnetorquers decide, `orbit` is their rank and `without_rods` the judgement of the others; else
    None.
    """

    inertia: Float[np.ndarray, "3 3"]
    actuators: ActuatorSet
    verdict: Verdict
    rank: int
    dimension: int
    laws: Laws
    margin: float
    turn_time: float
    cone: TorqueCone
    decision: RankDecision | None = None
    barrier: Float[np.ndarray, "3"] | None = None
    level_set: MomentumLevelSet | None = None
    orbit: OrbitRank | None = None
    without_rods: "Judgement | None" = None

    @property
    def controllable(self) -> bool:
        """Whether every attitude and rate that the momentum allows can be reached."""
        return self.verdict in CONTROLLABLE

    @property
    def borderline(self) -> bool:
        """Whether the data or their round-off decide."""
        return self.verdict == "borderline"

    @property
    def coasting(self) -> float:
        """Momentum of the coasting wheels, N m s."""
        return float(np.linalg.norm(self.actuators.coasting))

    @property
    def one_signed(self) -> bool:
        """Whether some torque can be made in one sign only."""
        return self.cone.span > self.cone.two_sided
