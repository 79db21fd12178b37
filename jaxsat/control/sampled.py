"""The contract of controllers that run once a period, as on a computer."""

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
from jaxsat.spacecraft.dynamics import PlantState


class OneMode(enum.IntEnum):
    """The mode of a controller that is one law."""

    ONE_LAW = 0


def mode_label(mode: enum.IntEnum) -> str:
    """How a mode is shown to people: its `label` if it has one, else its name in words."""
    return getattr(mode, "label", mode.name.lower().replace("_", " "))


class AbstractSampledController(eqx.Module):
    """A controller that runs once every `period` seconds; its torque is held in between.

    One with several modes lists them in `modes` and tells in `mode` which is at work. Files and
    figures show a mode by its name in words, or by a property `label` of the enumeration. One that
    cannot be written as flight code says why in `no_flight_code`. Raises
    `TypeError` for `modes` that are no `enum.IntEnum`, or of which `mode` does not tell.
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
        """How far the rates are from the reference of the active law, rad/s; here NaN, for none."""
        return jnp.full(2, jnp.nan, state.omega.dtype)

    def judged(self, memory: Memory) -> Memory:
        """What of the memory must stay finite, else the run ends as one that diverged; here, all of
        it."""
        return memory

    def telemetry(self, memory: Memory) -> Mapping[str, Array]:
        """What the controller tells of itself, by the names of signals."""
        return {}

    @property
    def tells_unmade(self) -> bool:
        """Whether `telemetry` has the torque that actuators do not make; here, that has none."""
        return False

    @property
    def known(self) -> Bool[Array, " wheels"] | None:
        """Which wheels it knows to have failed before the start; here None, of a law that watches
        none."""
        return None

    def holds_by_rods(
        self, axes: Float[np.ndarray, "3 k"], rods: Bool[np.ndarray, " rods"]
    ) -> bool:
        """Whether, over an orbit, these magnetorquers make the torques that wheels along these axes
        do not; here, always."""
        return True

    def mode(self, memory: Memory) -> IntScalar:
        """Which part of the controller is at work, a member of `modes`; here, the only one."""
        return jnp.array(OneMode.ONE_LAW)
