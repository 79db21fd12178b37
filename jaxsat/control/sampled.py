"""Interface of sampled controllers, which run once per period."""

import abc
import enum
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.controller import Memory
from jaxsat.core.array_types import IntScalar, Pair, RealScalar
from jaxsat.core.declaration.keys import Key
from jaxsat.spacecraft.dynamics import PlantState


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
