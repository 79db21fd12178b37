"""What flywheels do to the body, and how they take part in a commanded torque."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from flywheels.declaration import FlywheelFailureKind
from jaxsat.core.ranges import TORQUE
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.dispersible import Dispersible, Limits
from jaxsat.spacecraft.effector import AbstractEffector, Effect, Reach
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.spacecraft.steering import AbstractSteering


class FlywheelFailures(AbstractFailures):
    """Failures of flywheels."""

    part: ClassVar[str] = "flywheel"
    kinds: ClassVar = FlywheelFailureKind

    def gain(self, struck, count):
        """What is left of the torque of each."""
        last = self.last(struck, count)
        worn = jnp.where(last.kind == FlywheelFailureKind.WORN, last.amount, 1.0)
        return jnp.where(last.kind == FlywheelFailureKind.LOOSE, 0.0, worn)


class FlywheelMomenta(eqx.Module):
    """The state: the momentum of each relative to the body, N m s."""

    momentum: jax.Array


class Flywheels(AbstractEffector):
    """Flywheels along unit `axes` (3, k); a torque c on the body takes c out of the momentum."""

    kind: ClassVar[str] = "flywheel"
    dispersible: ClassVar[Mapping[str, Dispersible]] = {
        "flywheel_momentum_start": Dispersible(
            lambda one, state, momentum: (one, FlywheelMomenta(momentum)),
            lambda one: Limits.between(TORQUE),
        )
    }

    axes: jax.Array
    limit: jax.Array
    failures: FlywheelFailures | None

    @classmethod
    def from_tables(cls, tables, context):
        """Those of checked tables, and their state at the start."""
        axes = np.array([one.axis for one in tables], float).T
        limit = jnp.asarray([one.torque_limit_N_m for one in tables])
        failures = FlywheelFailures.of_tables(context.failures)
        made = cls(jnp.asarray(axes / np.linalg.norm(axes, axis=0)), limit, failures)
        return made, made.init()

    @property
    def count(self):
        """How many there are."""
        return self.axes.shape[1]

    def init(self):
        """All stand still."""
        return FlywheelMomenta(jnp.zeros(self.count))

    def with_momenta(self, state, change):
        """That of each changed."""
        return FlywheelMomenta(change(state.momentum))

    def momentum(self, state):
        """The sum in body axes, N m s."""
        return self.axes @ state.momentum

    def driven(self, state, command, struck):
        """Flywheels that fail no more, and what their motors make, N m."""
        command = jnp.clip(command, -self.limit, self.limit)
        if self.failures is None:
            return self, command
        gain = self.failures.gain(struck, self.count)
        return eqx.tree_at(lambda one: one.failures, self, None), gain * command

    def reach(self, t, plant, state, struck, span):
        """The torque of each motor, N m."""
        gain = 1.0 if self.failures is None else self.failures.gain(struck, self.count)
        return Reach(self.axes, -gain * self.limit, gain * self.limit)

    def piece(self, mode, command):
        """The torque of each, N m."""
        return command

    def effect(self, piece, t, plant, state):
        """The torque on the body."""
        return Effect(self.axes @ piece)

    def derivative(self, piece, plant, state, acceleration):
        """Of each momentum, N m."""
        return FlywheelMomenta(-piece)

    def stored(self, state):
        """The momentum of each."""
        return {"flywheel_momentum": state.momentum}


class FlywheelSteering(AbstractSteering):
    """Least squares within the limits of those that work."""

    kind: ClassVar[str] = "flywheel"

    axes: jax.Array
    limit: jax.Array
    shares: jax.Array

    @classmethod
    def from_tables(cls, effector, tables, context):
        """Of those that have not failed before the start."""
        works = np.array([not one.failed for one in tables], float)
        shares = np.linalg.pinv(np.asarray(effector.axes) * works)
        return cls(effector.axes, effector.limit * works, jnp.asarray(shares))

    def __call__(self, t, state, command):
        """The torque of each, and what is left to others, N m."""
        reach = Reach(self.axes, -self.limit, self.limit)
        torques = allocate(reach, self.within_reach(t, state, command)).use
        return torques, command - self.axes @ torques

    def within_reach(self, t, state, torque):
        """The part of a torque along their axes, N m."""
        return self.axes @ (self.shares @ torque)
