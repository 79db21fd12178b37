"""Where an adaptive trajectory is, its last step, and how its flat state is read."""

from collections.abc import Callable
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.compiler import apart
from jaxsat.engine.crossing import ends_of_parts, polynomial
from jaxsat.engine.dense_output import AbstractDenseOutput, dense_output
from jaxsat.engine.program import Copy, Program
from jaxsat.engine.rates import running_cost
from jaxsat.simulation import AbstractContinuousLoop


class Stretch(NamedTuple):
    """The last step with its dense output.

    It began at `begin` (s) in the flat state `state` and has the `length` in s. `growth` has the
    rows of the method's dense output. In each of some equal parts of the step a torque changes its
    sign at `turns`, or nowhere before that part's end; `effort` is that before the step.
    """

    begin: Float[Array, ""]
    length: Float[Array, ""]
    state: Float[Array, " n"]
    growth: Float[Array, "rows n"]
    turns: Float[Array, "parts axes"]
    effort: Float[Array, ""]


class Walk(NamedTuple):
    """Where a trajectory is: time (s), next instant to be looked at by number, flat state with its
    rate, the sides of the switching functions it is on with their values, and its last step.

    The flat state is the loop's state turned back, the cost, and the integrals since the step began
    of the torques that the loop can make.
    """

    t: Float[Array, ""]
    number: Int[Array, ""]
    state: Float[Array, " n"]
    rate: Float[Array, " n"]
    sides: Bool[Array, " m"]
    gaps: Float[Array, " m"]
    stretch: Stretch


class Course(NamedTuple):
    """What stays the same along one trajectory: program, loop, the method's dense output, and how
    the flat state is read."""

    program: Program
    loop: AbstractContinuousLoop
    output: AbstractDenseOutput
    restore: Callable[[Float[Array, " n"]], PyTree]
    batch: str | None = None

    @staticmethod
    def of(
        solver: diffrax.AbstractSolver, program: Program, copy: Copy, batch: str | None = None
    ) -> "Course":
        """The course of one case; under `vmap` `batch` may tell the name of the cases' axis."""
        shapes = jax.eval_shape(flat_parts, copy)
        template = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        restore = ravel_pytree(template)[1]
        return Course(program, continuous(copy), dense_output(solver), restore, batch)

    def seldom(
        self, wanted: Bool[Array, ""], function: Callable[[], PyTree], default: PyTree
    ) -> PyTree:
        """What `function` gives where it is `wanted`, else `default`.

        Under `vmap` a `lax.cond` computes both for all cases. Here the whole batch leaves the
        function out while no case wants it.
        """
        if self.batch is None:
            return jax.lax.cond(wanted, function, lambda: default)

        def some():
            return jax.tree.map(lambda x, y: jnp.where(wanted, x, y), function(), default)

        return jax.lax.cond(self.anywhere(wanted), some, lambda: default)

    def anywhere(self, true: Bool[Array, ""]) -> Bool[Array, ""]:
        """Whether it is true of any case of the batch."""
        return true if self.batch is None else jax.lax.pmax(true.astype(int), self.batch) > 0

    @property
    def axes(self) -> int:
        """How many torques' integrals end the flat state."""
        return self.loop.torque_count

    def with_no_torque(self, flat: Float[Array, " n"]) -> Float[Array, " n"]:
        """A flat state in which a step begins."""
        begun = np.arange(flat.size) >= flat.size - self.axes
        return jnp.where(begun, 0.0, flat)

    def judged(self, flat: Float[Array, " n"]) -> Float[Array, " m"]:
        """What of a flat state an error is judged by: the loop's state and, last, the cost."""
        return flat[: -self.axes]

    def state(self, t: Float[Array, ""], flat: Float[Array, " n"]) -> PyTree:
        """The loop's state in a flat one."""
        return self.loop.turned(t, self.restore(flat)[0])

    def growth(self, step, rates, grown) -> Float[Array, "rows n"]:
        """The rows of a step's dense output."""
        growth = eqx.filter_jit(self.output.growth)
        if self.batch is None:
            return growth(step, rates, grown)
        return apart(growth, step, rates, grown)

    def dense(self, stretch: Stretch, part: Float[Array, ""]) -> Float[Array, " n"]:
        """The flat state after a part of a step."""
        return self.output.at(stretch.state, stretch.growth, part)

    def torque_powers(self, growth: Float[Array, "rows n"]) -> Float[Array, "degree axes"]:
        """The torques' integrals within a step: the coefficients of the powers of its part."""
        return self.output.powers(growth[:, -self.axes :])

    def effort_until(self, stretch: Stretch, part: Float[Array, ""]) -> Float[Array, ""]:
        """∫ Σ|T_i| until a part of a step, from the integrals of T_i between its signs' changes."""
        coefficients = list(self.torque_powers(stretch.growth)[:, None])

        def integrals(at):
            return polynomial(coefficients, jnp.minimum(at, part))

        ends = integrals(ends_of_parts(self.output.parts))
        begins = jnp.concatenate([jnp.zeros_like(ends[:1]), ends[:-1]])
        between = integrals(stretch.turns)
        return stretch.effort + jnp.sum(jnp.abs(between - begins) + jnp.abs(ends - between))

    def gaps(self, sides, t: Float[Array, ""], flat: Float[Array, " n"]) -> Float[Array, " m"]:
        """The switching functions as the piece on these sides has them."""
        return self.loop.piece(sides).switches(t, self.state(t, flat))

    def rate(self, sides) -> Callable:
        """The rate of the flat state in the piece on these sides."""
        piece = self.loop.piece(sides)

        @eqx.filter_jit  # traced once for all stages
        def rate(piece, cost, t, back):
            motion = piece.turned_back_motion(t, back)
            torque = motion.torque[: self.axes]
            return motion.rate, running_cost(cost, motion), torque

        @eqx.filter_jit  # few operations by themselves: XLA does those one after the other
        def whole(piece, cost, t, flat):
            return flat_of(apart(rate, piece, cost, t, self.restore(flat)[0]))

        def flat_rate(t, flat):
            if self.batch is None:
                return flat_of(rate(piece, self.program.cost, t, self.restore(flat)[0]))
            return apart(whole, piece, self.program.cost, t, flat)

        return flat_rate


def continuous(copy: Copy) -> AbstractContinuousLoop:
    """The copy's loop, which must be one that adaptive steps can go through."""
    if not isinstance(copy.loop, AbstractContinuousLoop):
        raise TypeError(f"A continuous loop must take adaptive steps, but got {type(copy.loop)}.")
    return copy.loop


def flat_parts(copy: Copy) -> PyTree:
    """What the flat state is at time zero, part by part."""
    zero = jnp.zeros((), copy.start.omega.dtype)
    loop = continuous(copy)
    back = loop.turned_back(zero, loop.start(copy.start))
    return back, zero, jnp.zeros(loop.torque_count, zero.dtype)


def flat_of(tree: PyTree) -> Float[Array, " n"]:
    """The parts as one vector."""
    return ravel_pytree(tree)[0]


def constant(tree: PyTree) -> PyTree:
    """The tree with nothing to be differentiated."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_array(x) else x, tree)


def part_of(stretch: Stretch, t: Float[Array, ""]) -> Float[Array, ""]:
    """The part of the step that has gone by at time `t` (s)."""
    return (t - stretch.begin) / stretch.length
