"""How effectors share in a commanded torque before all other actuators are asked."""

import abc
from typing import ClassVar, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.distribution import AbstractDistribution, Shares, torque_of
from jaxsat.spacecraft.spacecraft import PlantState


class AbstractSteering(eqx.Module):
    """What one `kind` of effector makes of a law's command of three torques.

    That of an effector of a scenario has a class method `from_tables(effector, tables, context)`,
    which the declaration of the actuator names; `context` is a `SteeringContext`.
    """

    kind: ClassVar[str]
    """That of the effector of the body that is commanded."""

    @abc.abstractmethod
    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """The command of each at time `t` (s), and what of a torque (N m) is left to others.

        `state` is what the law knows of the plant.
        """

    def within_reach(self, t: RealScalar, state: PlantState, torque: Vector) -> Vector:
        """The part of a torque (N m) that the kind would make if it had no limits."""
        del t, state
        return torque


class SteeringContext(NamedTuple):
    """What a scenario gives a steering besides its effector and the tables of that.

    `left` (3, 3) is the part of a command of three torques that wheels do not make. Wheels along
    unit `wheel_axes`, zero for those that have failed, are to lose what momentum they have beyond
    the `bias` (N m s, body axes) in parts of `unloading` a second.
    """

    wheel_axes: Float[np.ndarray, "3 wheels"] | None
    left: Float[np.ndarray, "3 3"]
    unloading: float
    bias: Float[np.ndarray, "3"]


class Steered(AbstractDistribution):
    """Effectors that share in a torque by a `steering` of their own, in its order, then others.

    What steering leaves of the command goes to the other effectors as `rest` shares it; with None
    it stays unmade. What is out of reach at any limits, such as a torque of magnetorquers along the
    field that no wheel makes, does not count as unmade.
    """

    steering: tuple[AbstractSteering, ...] = ()
    rest: AbstractDistribution | None = None

    def __call__(self, t, state, command, effectors) -> Shares:
        """What each effector is asked for; raises `ValueError` for a steering without its own."""
        steered, beyond = {}, command
        for one in self.steering:
            beyond = beyond - one.within_reach(t, state, beyond)
            steered[one.kind], command = one(t, state, command)
        kinds = [one.kind for one in effectors]
        for kind in steered:
            if kind not in kinds:
                raise ArgumentError("steering", f"must be of effectors among {kinds}", kind)
        others = tuple(one for one in effectors if one.kind not in steered)
        if self.rest is None:
            shares = Shares(tuple(one.idle() for one in others), torque_of(command))
        else:
            shares = self.rest(t, state, command, others)
            beyond = self.rest.out_of_reach(beyond, others)
        left = None if shares.left is None else shares.left - torque_of(beyond)
        queue = iter(shares.uses)
        uses = tuple(steered[kind] if kind in steered else next(queue) for kind in kinds)
        return Shares(uses, left)

    def tells_left(self, effectors) -> bool:
        """Whether `Shares.left` is known: that of steering alone is, else the rest says so."""
        return self.rest is None or self.rest.tells_left(effectors)
