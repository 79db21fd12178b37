"""Effectors that take their part of a commanded torque before all other actuators."""

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
    """Steering of one `kind` of effector: its commands for a law's command of three torques.

    The steering of an effector of a scenario has a class method `from_tables(effector, tables,
    context)`, named in the declaration of the actuator; `context` is a `SteeringContext`.
    """

    kind: ClassVar[str]
    """Kind of the commanded effector."""

    @abc.abstractmethod
    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """Return the command of each device at time `t` (s), and the torque left to others (N m).

        `state` is the law's estimate of the plant's state.
        """

    def within_reach(self, t: RealScalar, state: PlantState, torque: Vector) -> Vector:
        """Return the part of a torque (N m) that the kind would make without limits."""
        del t, state
        return torque


class SteeringContext(NamedTuple):
    """Inputs from a scenario for a steering besides its effector and the effector's tables.

    `left` (3, 3) is the part of a command of three torques that wheels do not make. Wheels along
    unit `wheel_axes`, zero for failed ones, are unloaded towards the `bias` (N m s, body axes) at
    the rate `unloading` (1/s).
    """

    wheel_axes: Float[np.ndarray, "3 wheels"] | None
    left: Float[np.ndarray, "3 3"]
    unloading: float
    bias: Float[np.ndarray, "3"]


class Steered(AbstractDistribution):
    """Effectors that share a torque by a `steering` of their own, in its order, then others.

    The torque that steering leaves goes to the other effectors by `rest`; with None it stays
    unmade. A torque out of reach at any limits, such as that of magnetorquers along the field,
    without wheels to make it, does not count as unmade.
    """

    steering: tuple[AbstractSteering, ...] = ()
    rest: AbstractDistribution | None = None

    def __call__(self, t, state, command, effectors) -> Shares:
        """Return each effector's command; raises `ValueError` if a steered one is absent."""
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
        rest = None if shares.remainder is None else shares.remainder - torque_of(beyond)
        queue = iter(shares.uses)
        uses = tuple(steered[kind] if kind in steered else next(queue) for kind in kinds)
        return Shares(uses, rest)

    def tells_remainder(self, effectors) -> bool:
        """Whether `Shares.remainder` is computed: with steering alone, or if `rest` does so."""
        return self.rest is None or self.rest.tells_remainder(effectors)
