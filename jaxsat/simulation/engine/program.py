"""Programs for engines: one trajectory, constructed anew for every case."""

import abc
import dataclasses
import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.core.array_types import BoolScalar, RealScalar
from jaxsat.core.checks import as_float, positive, require_counts
from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import STATE_LIMIT
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.engine.progress import RunningCost
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.requirements import Requirements
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState


class Case(NamedTuple):
    """One case: closed loop and start, draws by name, and whether it is possible."""

    loop: AbstractLoop
    start: PlantState
    drawn: dict[str, Array]
    possible: BoolScalar


class AbstractCaseFactory(eqx.Module):
    """Factory of a program's cases: closed loops that differ in some of their numbers."""

    @abc.abstractmethod
    def __call__(self, case: PyTree, gains: PyTree) -> Case:
        """The case of the numbers `case`, with `gains` in place of some of its controller's."""


class Program(eqx.Module):
    """One trajectory from zero to the end, and its required outputs.

    The state is observed every `interval` seconds, `intervals` times after the start. At these
    instants settling, the peak rate and divergence (a norm of `state_limit`) are judged. A sampled
    loop is observed at its samples. A `detailed` program computes the `Details` of each case
    instead of its cost, which is NaN. The error of equal steps is estimated in one of `error_every`
    intervals; never, if that is 0. `requirements` are judged where the state is observed.
    """

    case_factory: AbstractCaseFactory
    interval: RealScalar = eqx.field(converter=positive("interval"))
    intervals: int = eqx.field(static=True)
    tolerances: Tolerances = eqx.field(default_factory=Tolerances)
    cost: RunningCost = eqx.field(default_factory=RunningCost)
    state_limit: RealScalar = eqx.field(converter=as_float, default=STATE_LIMIT)
    detailed: bool = eqx.field(static=True, default=False)
    error_every: int = eqx.field(static=True, default=0)
    requirements: Requirements | None = None

    def __check_init__(self):
        if self.error_every < 0:
            raise ArgumentError("error_every", "must not be negative", self.error_every)
        require_counts(intervals=self.intervals)

    def instants(self, every: int = 1) -> np.ndarray:
        """Numbers of every `every`-th interval, and of the end."""
        return np.unique(np.append(np.arange(0, self.intervals, every), self.intervals))

    def evenly(self, count: int) -> np.ndarray:
        """Numbers of `count` intervals, rounded, evenly spaced from the first to the end.

        Raises `ValueError` for fewer than two, or for more than there are.
        """
        if not 2 <= count <= self.intervals + 1:
            raise ValueError(
                f"A history must have 2 to {self.intervals + 1} instants, as the state is "
                f"observed so often, but got {count}."
            )
        return np.round(np.linspace(0, self.intervals, count)).astype(int)

    def of_any_length(self) -> "Program":
        """The program with a placeholder length: compiled loops take the length as an input."""
        return dataclasses.replace(self, intervals=1)

    def time_of(self, number: Int[Array, "*n"] | int) -> Float[Array, "*n"]:
        """The time (s) at which an interval begins."""
        return jnp.asarray(number, self.interval.dtype) * self.interval

    @property
    def running_cost(self) -> RunningCost | None:
        """The integrand of the cost; None in a detailed program."""
        return None if self.detailed else self.cost

    @property
    def duration(self) -> RealScalar:
        """The time of the whole trajectory, s."""
        return self.interval * self.intervals


LONGEST_INTERVAL = 1.0
"""Longest time between two observations of a loop that is not sampled, s."""


def observations_per_save(save_every: float) -> int:
    """Number of observations of a loop that is not sampled between saved samples (s), so that the
    settling time does not depend on the save rate."""
    return max(1, math.ceil(save_every / LONGEST_INTERVAL - 1e-9))


def program_of(
    case_factory: AbstractCaseFactory,
    loop: AbstractLoop,
    duration: float,
    interval: float = 1.0,
    *,
    tolerances: Tolerances | None = None,
    cost: RunningCost | None = None,
) -> Program:
    """The program that runs cases of a loop like `loop` for `duration` seconds.

    A sampled loop is observed at its own samples, any other every `interval` seconds. Raises
    `ValueError` where the duration is not a whole number of these.
    """
    if isinstance(loop, SampledLoop):
        interval = float(np.asarray(loop.controller.period))
    count = round(duration / interval)
    if count < 1 or abs(count * interval - duration) > 1e-6 * interval:
        raise ArgumentError(
            "duration", f"must be a whole number of intervals of {interval} s", f"{duration} s"
        )
    return Program(case_factory, interval, count, tolerances or Tolerances(), cost or RunningCost())
