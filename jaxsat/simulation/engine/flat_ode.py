"""A closed loop as an ordinary differential equation of one flat vector, in smooth pieces."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.array_types import BoolScalar, RealScalar
from jaxsat.core.solvers import Solver
from jaxsat.core.trees import apart
from jaxsat.simulation.engine.dense_output import AbstractDenseOutput, dense_output
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.rates import continuous_loop, running_cost
from jaxsat.simulation.engine.root_finding import ends_of_parts, polynomial
from jaxsat.simulation.loops import AbstractContinuousLoop, Motion
from jaxsat.simulation.units import in_units


class DenseStep(NamedTuple):
    """A step with its dense output.

    The step began at `begin` (s) in the flat state `state`, in the smooth piece with these `signs`,
    and has the `length` in s. `increments` has the rows of the method's dense output. In each of
    some equal parts of the step a torque has a sign change at `torque_zeros`, or none before that
    part's end; `effort` is the effort before the step, in a detailed program by torque.
    """

    begin: RealScalar
    length: RealScalar
    state: Float[Array, " n"]
    increments: Float[Array, "rows n"]
    torque_zeros: Float[Array, "parts axes"]
    effort: Float[Array, "*effort"]
    signs: Bool[Array, " m"]

    def fraction(self, t: RealScalar) -> RealScalar:
        """The elapsed fraction of the step at time `t` (s)."""
        return (t - self.begin) / self.length


class FlatODE(NamedTuple):
    """One case's loop as an ODE: program, loop, dense output, and the inverse of flattening.

    The flat state is the loop's state in the rotating frame of its integrating factor, the cost,
    and the integrals since the step began of the loop's torques. `axis_name` is that of the cases'
    axis under `vmap`, None for one case alone.
    """

    program: Program
    loop: AbstractContinuousLoop
    output: AbstractDenseOutput
    restore: Callable[[Float[Array, " n"]], PyTree]
    axis_name: str | None = None

    @staticmethod
    def of(solver: Solver, program: Program, case: Case, axis_name: str | None = None) -> "FlatODE":
        """The ODE of a case with this solver's dense output."""
        shapes = jax.eval_shape(lambda case: _initial_parts(program, case), case)
        template = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        restore = ravel_pytree(template)[1]
        return FlatODE(program, continuous_loop(case), dense_output(solver), restore, axis_name)

    def cold_branch(
        self, condition: BoolScalar, function: Callable[[], PyTree], default: PyTree
    ) -> PyTree:
        """The value of `function` where the rare `condition` holds, else `default`.

        Under `vmap` a `lax.cond` computes both for all cases. Here the whole batch skips the
        function while no case needs it.
        """
        if self.axis_name is None:
            return jax.lax.cond(condition, function, lambda: default)

        def some():
            return jax.tree.map(lambda x, y: jnp.where(condition, x, y), function(), default)

        return jax.lax.cond(self.in_any_case(condition), some, lambda: default)

    def in_any_case(self, condition: BoolScalar) -> BoolScalar:
        """Whether a condition holds in any case of the batch."""
        return (
            condition
            if self.axis_name is None
            else jax.lax.pmax(condition.astype(int), self.axis_name) > 0
        )

    @property
    def torque_count(self) -> int:
        """Number of torque integrals at the end of the flat state.

        In a detailed program the torque that holds the third rate is the last.
        """
        return _torque_count(self.program, self.loop)

    def at_step_begin(self, flat: Float[Array, " n"]) -> Float[Array, " n"]:
        """A flat state in which a step begins: the torques' integrals are zero."""
        torques = np.arange(flat.size) >= flat.size - self.torque_count
        return jnp.where(torques, 0.0, flat)

    def error_controlled(self, flat: Float[Array, " n"]) -> Float[Array, " m"]:
        """The error-controlled part of a flat state: the loop's state and, last, the cost.

        Momenta of wheels are in units of the body.
        """
        if not self.loop.plant.effectors:
            return flat[: -self.torque_count]
        state, cost, _ = self.restore(flat)
        return _flat((in_units(self.loop.plant, state), cost))

    def state(self, t: RealScalar, flat: Float[Array, " n"]) -> PyTree:
        """The loop's state in a flat one."""
        return out_of_frame(self.loop, t, self.restore(flat)[0])

    def increments(self, step, rates, increment) -> Float[Array, "rows n"]:
        """The rows of a step's dense output."""
        increments = eqx.filter_jit(self.output.increments)
        if self.axis_name is None:
            return increments(step, rates, increment)
        return apart(increments, step, rates, increment)

    def interpolated(self, step: DenseStep, fraction: RealScalar) -> Float[Array, " n"]:
        """The flat state after a fraction of a step."""
        return self.output.at(step.state, step.increments, fraction)

    def torque_coefficients(
        self, increments: Float[Array, "rows n"]
    ) -> Float[Array, "degree axes"]:
        """The torques' integrals within a step as polynomials of its fraction."""
        return self.output.coefficients(increments[:, -self.torque_count :])

    def effort(self, step: DenseStep, fraction: RealScalar) -> Float[Array, "*effort"]:
        """∫ Σ|T_i| until a fraction of a step, from the integrals of T_i between its zeros.

        In a detailed program one integral per torque.
        """
        coefficients = list(self.torque_coefficients(step.increments)[:, None])

        def integrals(at):
            return polynomial(coefficients, jnp.minimum(at, fraction))

        ends = integrals(ends_of_parts(self.output.sign_checks))
        begins = jnp.concatenate([jnp.zeros_like(ends[:1]), ends[:-1]])
        between = integrals(step.torque_zeros)
        axis = 0 if self.program.detailed else None
        sizes = jnp.abs(between - begins) + jnp.abs(ends - between)
        return step.effort + jnp.sum(sizes, axis=axis)

    def events(self, signs, t: RealScalar, flat: Float[Array, " n"]) -> Float[Array, " m"]:
        """The event functions of the smooth piece with these signs."""
        return self.loop.smooth_piece(signs).event_functions(t, self.state(t, flat))

    def rate(self, signs) -> Callable:
        """The rate of the flat state in the smooth piece with these signs."""
        piece = self.loop.smooth_piece(signs)

        @eqx.filter_jit  # traced once for all stages
        def rate(piece, cost, t, framed):
            motion = motion_in_frame(piece, t, framed)
            torque = motion.torque[: piece.torque_count]
            if self.program.detailed:
                constraint = piece.plant.constraint_torque(t, motion.plant, motion.torque)
                torque = torque if constraint is None else jnp.append(torque, constraint)
            of_cost = (cost, motion.plant, motion.relative_rate, motion.torque)
            return motion.rate, running_cost(*of_cost), torque

        @eqx.filter_jit  # small: XLA runs single operations one after the other
        def whole(piece, cost, t, flat):
            return _flat(apart(rate, piece, cost, t, self.restore(flat)[0]))

        def flat_rate(t, flat):
            if self.axis_name is None:
                return _flat(rate(piece, self.program.running_cost, t, self.restore(flat)[0]))
            return apart(whole, piece, self.program.running_cost, t, flat)

        return flat_rate


def initial_state(program: Program, case: Case) -> Float[Array, " n"]:
    """The flat state at time zero."""
    return _flat(_initial_parts(program, case))


def _torque_count(program: Program, loop: AbstractContinuousLoop) -> int:
    return loop.torque_count + (program.detailed and loop.plant.third_rate_held)


def _initial_parts(program: Program, case: Case) -> PyTree:
    zero = jnp.zeros((), case.start.omega.dtype)
    loop = continuous_loop(case)
    framed = into_frame(loop, zero, loop.start(case.start))
    return framed, zero, jnp.zeros(_torque_count(program, loop), zero.dtype)


def _flat(tree: PyTree) -> Float[Array, " n"]:
    return ravel_pytree(tree)[0]


def into_frame(loop: AbstractContinuousLoop, t: RealScalar, state: PyTree) -> PyTree:
    """A state at time `t` (s) with its memory in the rotating frame."""
    factor = loop.integrating_factor(t)
    return state if factor is None else state._replace(memory=factor.into_frame(state.memory))


def out_of_frame(loop: AbstractContinuousLoop, t: RealScalar, framed: PyTree) -> PyTree:
    """Inverse of `into_frame`."""
    factor = loop.integrating_factor(t)
    return framed if factor is None else framed._replace(memory=factor.out_of_frame(framed.memory))


def motion_in_frame(loop: AbstractContinuousLoop, t: RealScalar, framed: PyTree) -> Motion:
    """`loop.motion` of a state in the rotating frame, with the rate of that state."""
    factor = apart(_integrating_factor, loop, t)
    if factor is None:
        return loop.motion(t, framed)
    motion = loop.motion(t, framed._replace(memory=factor.out_of_frame(framed.memory)))
    rate = motion.rate._replace(memory=factor.rate_in_frame(motion.rate_error))
    return motion._replace(rate=rate)


@eqx.filter_jit
def _integrating_factor(loop: AbstractContinuousLoop, t: RealScalar):
    return loop.integrating_factor(t)
