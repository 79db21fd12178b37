"""Interface of steppers, which integrate one trajectory with fixed, adaptive or sampled steps."""

import abc
import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxsat.core.array_types import BoolScalar, IntScalar
from jaxsat.core.solvers import Solver
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import Outputs, Progress
from jaxsat.simulation.trajectory import Outcome, Signals

Number = int | IntScalar
"""A number, known at trace time or traced."""


class AbstractStepper(eqx.Module):
    """Integrates one case of a program, from a `Progress` of fixed size to the next.

    Instants are numbers of the program's intervals. An engine maps cases over these functions.
    """

    solver: eqx.AbstractVar[Solver]

    @abc.abstractmethod
    def identity(self) -> dict[str, Any]:
        """The properties of the steps that the bits of a case depend on, as plain data."""

    @abc.abstractmethod
    def begin(self, program: Program, case: Case) -> Progress:
        """The progress at time zero."""

    @abc.abstractmethod
    def advance(
        self,
        program: Program,
        case: Case,
        progress: Progress,
        first: Number,
        count: Number,
        axis_name: str | None = None,
    ) -> Progress:
        """The progress after `count` intervals from number `first` on.

        Under `vmap` over an axis of the name `axis_name`, the cases of a batch share work.
        """

    @abc.abstractmethod
    def finish(
        self, program: Program, case: Case, progress: Progress, number: IntScalar
    ) -> Outputs:
        """Outputs of a trajectory after all its intervals, `number` of them."""

    @abc.abstractmethod
    def signals(
        self, program: Program, case: Case, progress: Progress, number: IntScalar
    ) -> Signals:
        """Signals at the beginning of interval `number`, which the trajectory has reached."""

    def observe(
        self, program: Program, case: Case, progress: Progress, number: IntScalar
    ) -> Signals:
        """Signals at the beginning of interval `number`; NaN after the end of a failed run.

        Where the progress has `sums`, they are those at the beginning of its last advance.
        """
        at_end = progress.code != int(Outcome.SUCCESS)
        if progress.sums is None:
            return nan_where(at_end, self.signals(program, case, progress, number))
        assert progress.held_torque is not None
        torques = nan_where(at_end, progress.held_torque.range())
        return dataclasses.replace(progress.sums, torque_range=torques)


def nan_where(ended: BoolScalar, values: PyTree) -> PyTree:
    """The values, or NaN where a case has `ended`."""
    return jax.tree.map(lambda x: jnp.where(ended, jnp.nan, x), values)
