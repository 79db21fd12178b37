"""Phases of a trajectory as functions of one case: begin, advance (or attempt), finish, observe.

`begin` computes the dispersed loop of a case once; it is *fixed* from then on; the progress of its
trajectory is *moving*. `ForwardModePhases` carries the derivatives by the gains beside both.
"""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from jaxsat.core.array_types import BoolScalar
from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.fixed import stepper_for
from jaxsat.simulation.engine.interface import CostGradient
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.stepper import AbstractStepper


class AbstractPhases(abc.ABC):
    """The functions of a trajectory; `numbers` are those of stepper and program."""

    @abc.abstractmethod
    def begin(self, case: PyTree, numbers: PyTree, gains: PyTree) -> tuple[PyTree, PyTree]:
        """The fixed and the moving part at time zero. Called before all others."""

    @abc.abstractmethod
    def advance(self, fixed, moving, numbers, first, count) -> PyTree:
        """The moving part, `count` intervals after number `first`."""

    @property
    @abc.abstractmethod
    def paced(self) -> bool:
        """Whether every trajectory has its own pace: then it advances by `attempt` while `going`.

        Available after `begin`.
        """

    @abc.abstractmethod
    def attempt(self, fixed, moving, numbers, first, count) -> PyTree:
        """The moving part after one attempted step towards `count` intervals after `first`."""

    @abc.abstractmethod
    def going(self, fixed, moving, numbers, first, count) -> BoolScalar:
        """Whether the end, `count` intervals after number `first`, is still ahead."""

    @abc.abstractmethod
    def finish(self, fixed, moving, numbers, first, count) -> PyTree:
        """The outputs of the trajectory at its end, `count` intervals after number `first`."""

    @abc.abstractmethod
    def observe(self, fixed, moving, numbers, number) -> PyTree:
        """The observation at the beginning of interval `number`."""

    @abc.abstractmethod
    def learn(self, zero: list[bool]) -> None:
        """Receive, after `begin`, the mask of leaves of the fixed part that are all zero."""


class PrimalPhases(AbstractPhases):
    """The phases of a program by a stepper, without derivatives."""

    def __init__(self, stepper: AbstractStepper, program: Program):
        self.static = eqx.partition((stepper, program.of_any_length()), eqx.is_array)[1]
        self._rest: Any = None

    def begin(self, case, numbers, gains):
        """The case's arrays and the progress."""
        case = eqx.combine(numbers, self.static)[1].case_factory(case, gains)
        arrays, self._rest = eqx.partition(case, eqx.is_array)
        stepper, program, case = self._with(arrays, numbers)
        return arrays, stepper.begin(program, case)

    def advance(self, fixed, moving, numbers, first, count):
        """The progress after `count` intervals from number `first` on."""
        stepper, program, case = self._with(fixed, numbers)
        return stepper.advance(program, case, moving, first, count)

    @property
    def paced(self) -> bool:
        """Whether steps are adaptive."""
        return isinstance(stepper_for(self.static[0], self._rest.loop), AdaptiveStepper)

    def attempt(self, fixed, moving, numbers, first, count):
        """The progress after one attempted step."""
        stepper, program, case = self._with(fixed, numbers)
        assert isinstance(stepper, AdaptiveStepper)
        return stepper.attempt(program, case, moving, first + count)

    def going(self, fixed, moving, numbers, first, count):
        """Whether the trajectory is unfinished."""
        stepper, program, _ = self._with(fixed, numbers)
        assert isinstance(stepper, AdaptiveStepper)
        return stepper.unfinished(program, moving, first + count)

    def finish(self, fixed, moving, numbers, first, count):
        """Outputs of the trajectory."""
        stepper, program, case = self._with(fixed, numbers)
        return stepper.finish(program, case, moving, first + count)

    def observe(self, fixed, moving, numbers, number):
        """Signals at the beginning of interval `number`."""
        stepper, program, case = self._with(fixed, numbers)
        return stepper.observe(program, case, moving, number)

    def learn(self, zero: list[bool]) -> None:
        """Do nothing: zeros make no difference here."""

    def _with(self, arrays, numbers) -> tuple[AbstractStepper, Program, Case]:
        stepper, program = eqx.combine(numbers, self.static)
        case = eqx.combine(arrays, self._rest)
        return stepper_for(stepper, case.loop), program, case


class ForwardModePhases(AbstractPhases):
    """A program together with the derivatives by every gain, in forward mode.

    A derivative has the gains' numbers along its leading axis. Leaves of the fixed part that depend
    on no gain have none.
    """

    def __init__(self, plain: PrimalPhases):
        self._plain = plain
        self._moved: list[bool] = []

    def begin(self, case, numbers, gains):
        """Values and derivatives of the fixed and the moving part."""
        flat, restore = ravel_pytree(gains)
        directions = jnp.eye(flat.size, dtype=flat.dtype)

        def values(flat):
            return self._plain.begin(case, numbers, restore(flat))

        (fixed, moving), (d_fixed, d_moving) = _push_forward(values, flat, directions)
        return (fixed, d_fixed), (moving, d_moving)

    def learn(self, zero: list[bool]) -> None:
        """Store the mask of the leaves, first values, then derivatives, that depend on a gain."""
        self._moved = [not is_zero for is_zero in zero]

    def advance(self, fixed, moving, numbers, first, count):
        """Values and derivatives after `count` intervals from number `first` on."""
        return self._along(self._plain.advance, fixed, moving, numbers, first, count)

    @property
    def paced(self) -> bool:
        """Whether the steps of the program itself are adaptive."""
        return self._plain.paced

    def attempt(self, fixed, moving, numbers, first, count):
        """Values and derivatives after one attempted step."""
        return self._along(self._plain.attempt, fixed, moving, numbers, first, count)

    def going(self, fixed, moving, numbers, first, count):
        """Whether the trajectory is unfinished."""
        return self._plain.going(fixed[0], moving[0], numbers, first, count)

    def finish(self, fixed, moving, numbers, first, count):
        """Outputs, and the derivatives of the cost."""
        phase = (self._plain.finish, fixed, moving, numbers, first, count)
        outputs, derivatives = self._along(*phase)
        return CostGradient(outputs, derivatives.cost)

    def observe(self, fixed, moving, numbers, number):
        """Signals at the beginning of interval `number`."""
        return self._plain.observe(fixed[0], moving[0], numbers, number)

    def _along(self, phase: Callable, fixed, moving, *rest):
        """Value and derivatives of a phase of the program itself."""
        (x, d_x), (y, d_y) = fixed, moving
        leaves = jax.tree.leaves(d_x)
        moves = iter(self._moved[-len(leaves) :] if leaves else [])
        d_x = jax.tree.map(lambda d: d if next(moves) else None, d_x)
        return _push_forward(lambda both: phase(*both, *rest), (x, y), (d_x, d_y))


def _push_forward(function: Callable, x: PyTree, directions: PyTree) -> tuple[PyTree, PyTree]:
    """A function's value, and its derivatives along directions stacked before the leaves of `x`.

    A direction whose leaf is None is zero there. Derivatives of results that are not real-valued
    are None.
    """
    whole = jax.tree.structure(x).flatten_up_to(directions)
    leaves, structure = jax.tree.flatten(x)
    indices = [i for i, direction in enumerate(whole) if direction is not None]

    def of_chosen(values):
        now = list(leaves)
        for i, value in zip(indices, values, strict=True):
            now[i] = value
        return function(jax.tree.unflatten(structure, now))

    def one(direction):
        value, derivative = jax.jvp(of_chosen, ([leaves[i] for i in indices],), (direction,))
        real = jax.tree.map(lambda d: None if d.dtype == jax.dtypes.float0 else d, derivative)
        return value, real

    return jax.vmap(one, out_axes=(None, 0))([whole[i] for i in indices])


def zero_leaves(constants: list[list[Any]]) -> list[bool]:
    """Whether each leaf, given as a list of scalars, is known to be zero everywhere."""
    return [
        all(isinstance(x, np.generic) and x.dtype.kind == "f" and x == 0 for x in leaf)
        for leaf in constants
    ]
