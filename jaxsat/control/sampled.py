"""The contract of controllers that run once a period, as on a computer."""

import abc
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float, Int

from jaxsat.control.controller import Memory
from jaxsat.dynamics import PlantState

ModeNames = Mapping[int, str]
"""What the numbers of a controller's modes mean."""

ONE_MODE: ModeNames = MappingProxyType({0: "one law"})


class AbstractSampledController(eqx.Module):
    """A controller that runs once every `period` seconds; its torque is held in between."""

    period: eqx.AbstractVar[Float[Array, ""]]
    mode_names: ClassVar[ModeNames]

    @abc.abstractmethod
    def init(self, state: PlantState) -> Memory:
        """The memory before the first sample."""

    @abc.abstractmethod
    def step(
        self, t: Float[Array, ""], state: PlantState, memory: Memory
    ) -> tuple[Float[Array, " torques"], Memory]:
        """The torque to hold, N m, and the memory for the next sample."""

    @abc.abstractmethod
    def rate_error(self, state: PlantState, memory: Memory) -> Float[Array, "2"]:
        """How far the rates are from the reference of the law that is active, rad/s."""

    @abc.abstractmethod
    def mode(self, memory: Memory) -> Int[Array, ""]:
        """Which part of the controller is at work, by a number that the controller explains."""
