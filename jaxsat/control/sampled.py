"""Interface of sampled controllers, which run once per period, and the guard of their loop.

The guard is against samples with invalid measurements. `jaxsat.flight.guard` writes its rules as C.
"""

import abc
import enum
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree

from jaxsat.control.controller import Memory
from jaxsat.core.array_types import BoolScalar, IntScalar, Pair, RealScalar
from jaxsat.core.checks import as_array
from jaxsat.core.declaration.keys import Key
from jaxsat.core.declaration.sensors import HOLD_SAMPLES
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.held_effector import GuardDecision


class OneMode(enum.IntEnum):
    """The mode of a controller that is one law."""

    ONE_LAW = 0


def mode_label(mode: enum.IntEnum) -> str:
    """Label of a mode for people: its `label` if it has one, else its name in words."""
    return getattr(mode, "label", mode.name.lower().replace("_", " "))


class AbstractSampledController(eqx.Module):
    """A controller that runs once every `period` seconds; its torque is held in between.

    A controller with several modes lists them in `modes` and returns the active one in `mode`.
    Files and figures show a mode by its name in words, or by a property `label` of the enumeration.
    A controller without flight code states the reason in `no_flight_code`. Raises `TypeError` for
    `modes` that are no `enum.IntEnum`, or without an own `mode`.
    """

    period: eqx.AbstractVar[RealScalar]
    modes: ClassVar[type[enum.IntEnum]] = OneMode
    no_flight_code: ClassVar[str | None] = None

    def __check_init__(self):
        law, modes = type(self), self.modes
        if not (isinstance(modes, type) and issubclass(modes, enum.IntEnum)):
            raise TypeError(f"{law.__name__}.modes must be an enum.IntEnum, but got {modes!r}.")
        if modes is not OneMode and law.mode is AbstractSampledController.mode:
            raise TypeError(f"{law.__name__} has `modes`, so it must have a method `mode`.")

    @abc.abstractmethod
    def init(self, state: PlantState) -> Memory:
        """The memory before the first sample."""

    @abc.abstractmethod
    def step(
        self, t: RealScalar, state: PlantState, memory: Memory
    ) -> tuple[Float[Array, " torques"], Memory]:
        """The torque to hold, N m, and the memory for the next sample."""

    def rate_error(self, state: PlantState, memory: Memory) -> Pair:
        """Rate error relative to the reference of the active law, rad/s; here NaN, for none."""
        return jnp.full(2, jnp.nan, state.omega.dtype)

    def judged(self, memory: Memory) -> Memory:
        """The part of the memory that must stay finite, else the run has diverged; here, all of
        it."""
        return memory

    def telemetry(self, memory: Memory) -> Mapping[str, Array]:
        """Telemetry of the controller, by the names of signals."""
        return {}

    @property
    def tells_unmade(self) -> bool:
        """Whether `telemetry` has the torque that actuators do not make; here, no."""
        return False

    @property
    def known(self) -> Bool[Array, " wheels"] | None:
        """Mask of wheels known to have failed before the start; here None, for a law without
        diagnosis."""
        return None

    def holds_by_rods(
        self, axes: Float[np.ndarray, "3 k"], rods: Bool[np.ndarray, " rods"]
    ) -> bool:
        """Whether, over an orbit, these magnetorquers produce the torques that wheels along these
        axes cannot; here, always."""
        return True

    def flight_law(self, start: PlantState, begin: float = 0.0) -> "AbstractSampledController":
        """The law that flight code has for a `start` at the time `begin` (s); here, this one."""
        return self

    @property
    def plan_keys(self) -> tuple[Key, ...]:
        """Units and ranges of the arrays of a field `plan`, which the law follows from the start of
        a scenario and which may be replaced in flight; here none, for a law without a plan."""
        return ()

    def mode(self, memory: Memory) -> IntScalar:
        """The active mode, a member of `modes`; here, the only one."""
        return jnp.array(OneMode.ONE_LAW)


class GuardState(NamedTuple):
    """The last commands, and the number of successive samples held since the law's last step."""

    last: PyTree
    missed: IntScalar


class Guard(eqx.Module):
    """A guard skips the law at a sample with invalid measurements, and keeps its memory.

    At the first `hold_samples` such samples in a row, effectors repeat their last command, then
    receive none. Raises `ArgumentError` for a number of samples below zero.
    """

    hold_samples: IntScalar

    def __init__(self, hold_samples: ArrayLike = HOLD_SAMPLES):
        if np.less(hold_samples, 0):
            raise ArgumentError("hold_samples", "must be zero or positive", hold_samples)
        self.hold_samples = as_array(np.asarray(hold_samples, np.int32))

    def init(self, command: PyTree) -> GuardState:
        """The state before the first sample, with the structure of a `command`."""
        last = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), command)
        return GuardState(last, jnp.zeros_like(self.hold_samples))

    def decide(self, valid: BoolScalar, state: GuardState) -> GuardDecision:
        """The decision at a sample."""
        return GuardDecision(valid, state.missed < self.hold_samples)

    def command(
        self, decision: GuardDecision, command: PyTree, state: GuardState
    ) -> tuple[PyTree, GuardState]:
        """The commands, from the `command` of a step, and the next state."""

        def one(new: Array, last: Array) -> Array:
            return jnp.where(decision.steps, new, jnp.where(decision.held, last, 0))

        output = jax.tree.map(one, command, state.last)
        skips = jnp.where(decision.held, state.missed + 1, state.missed)
        return output, GuardState(output, jnp.where(decision.steps, 0, skips))
