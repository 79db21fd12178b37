"""Where an adaptive trajectory is, its last step, and how its flat state is read."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.compiler import apart
from jaxsat.engine.program import Copy, Program
from jaxsat.engine.rates import running_cost
from jaxsat.simulation import AbstractContinuousLoop


class Stretch(NamedTuple):
    """The last step with its dense output.

    It began at `begin` (s) in the flat state `state`. `growth` has in its rows how far that grows
    over the `length` (s) of the step at the rate of its begin, until its middle, until its end, and
    at the rate of its end; the dense output is the polynomial of fourth degree through these. The
    torques change their signs at the parts `turns`; `effort` is that before the step.
    """

    begin: Float[Array, ""]
    length: Float[Array, ""]
    state: Float[Array, " n"]
    growth: Float[Array, "4 n"]
    turns: Float[Array, " axes"]
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
    """What stays the same along one trajectory: program, loop, and how the flat state is read."""

    program: Program
    loop: AbstractContinuousLoop
    restore: Callable[[Float[Array, " n"]], PyTree]
    batch: str | None = None

    @staticmethod
    def of(program: Program, copy: Copy, batch: str | None = None) -> "Course":
        """The course of one case; under `vmap` `batch` may tell the name of the cases' axis."""
        shapes = jax.eval_shape(flat_parts, copy)
        template = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        return Course(program, continuous(copy), ravel_pytree(template)[1], batch)

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

    def torques(self, flat: Float[Array, "*rows n"]) -> Float[Array, "*rows axes"]:
        """The torques' part of flat states."""
        return flat[..., -self.axes :]

    def state(self, t: Float[Array, ""], flat: Float[Array, " n"]) -> PyTree:
        """The loop's state in a flat one."""
        return self.loop.turned(t, self.restore(flat)[0])

    def gaps(self, sides, t: Float[Array, ""], flat: Float[Array, " n"]) -> Float[Array, " m"]:
        """The switching functions as the piece on these sides has them."""
        return self.loop.piece(sides).switches(t, self.state(t, flat))

    def rate(self, sides) -> Callable:
        """The rate of the flat state in the piece on these sides."""
        piece = self.loop.piece(sides)

        @eqx.filter_jit  # traced once for all stages
        def rate(piece, cost, t, flat):
            motion = piece.turned_back_motion(t, self.restore(flat)[0])
            torque = motion.torque[: self.axes]
            return motion.rate, running_cost(cost, motion), torque

        def flat_rate(t, flat):
            if self.batch is None:
                return flat_of(rate(piece, self.program.cost, t, flat))
            return flat_of(apart(rate, piece, self.program.cost, t, flat))

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


def dense(stretch: Stretch, part: Float[Array, ""]) -> Float[Array, " n"]:
    """The flat state after a part of the step."""
    at_begin, middle, whole, at_end = stretch.growth
    rest, square = 1 - part, part * part
    bend = rest * (1 - 2 * part)
    return (
        stretch.state
        + (part * rest * bend) * at_begin
        + (16 * square * rest * rest) * middle
        + (square * (14 * part - 5 - 8 * square)) * whole
        + (square * bend) * at_end
    )


def powers(growth: Float[Array, "4 n"]) -> Float[Array, "4 n"]:
    """The rows of a dense output's growth as those by which the powers 1 to 4 of the part count."""
    at_begin, middle, whole, at_end = growth
    return jnp.stack(
        [
            at_begin,
            at_end - 4 * at_begin - 5 * whole + 16 * middle,
            5 * at_begin - 3 * at_end + 14 * whole - 32 * middle,
            2 * (at_end - at_begin) - 8 * whole + 16 * middle,
        ]
    )


def effort_until(stretch: Stretch, part: Float[Array, ""]) -> Float[Array, ""]:
    """∫ Σ|T_i| until a part of the step, from the integrals of T_i between its signs' changes."""
    turns = jnp.minimum(stretch.turns, part)
    one, two, three, four = powers(stretch.growth[:, -turns.size :])

    def integral(at):
        return at * (one + at * (two + at * (three + at * four)))

    until = integral(turns)
    return stretch.effort + jnp.sum(jnp.abs(until) + jnp.abs(integral(part) - until))
