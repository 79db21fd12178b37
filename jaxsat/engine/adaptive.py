"""Adaptive steps through a loop in smooth pieces, each trajectory at its own pace.

During a step the loop is held in one of its pieces (`loop.piece`). Where a switching function has
changed its sign at the middle or the end of the step, the instant is located on the step's dense
output, the step ends there, and the next one is taken in the other piece. Nothing else ends a
step: the instants that are looked at, and the end of the run, lie on the dense output.

The program of one trajectory is `begin`, then `iterate` while `unfinished`, then `finish`, on a
`Progress` of fixed size; any engine that runs these runs the method.

Derivatives by forward mode are those of the law with its switches. The step length until a
switch carries one differentiable step of Newton's method, so the instant moves with the
parameters as it should, and so does all that follows; which steps are taken is held fixed.
"""

from collections.abc import Callable
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.checks import as_float, require_positive
from jaxsat.engine.crossing import Bracket, located, sign_change
from jaxsat.engine.program import Copy, Program
from jaxsat.engine.progress import (
    Integrals,
    Outputs,
    Progress,
    Sight,
    begun,
    looked_at,
    outputs_of,
)
from jaxsat.engine.rates import running_cost
from jaxsat.engine.runge_kutta import dense_weights, stage_rates, tableau_of, weighted
from jaxsat.simulation import AbstractContinuousLoop, Outcome, Signals

SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.9, 0.2, 5.0
AXES = 3


class Tolerance(eqx.Module):
    """What adaptive steps are held to: the error of a step below atol + rtol |state|.

    The norm is the root mean square over the loop's state and the cost; the effort goes along
    unjudged. Steps begin at `first_step` (s) and are never below `min_step` (s), which passes
    points where a law has no derivative and surfaces on which it slides; a case has at most
    `max_steps` of them.
    """

    rtol: Float[Array, ""] = eqx.field(converter=as_float, default=1e-9)
    atol: Float[Array, ""] = eqx.field(converter=as_float, default=1e-9)
    first_step: Float[Array, ""] = eqx.field(converter=as_float, default=1e-2)
    min_step: Float[Array, ""] = eqx.field(converter=as_float, default=1e-9)
    max_steps: int = eqx.field(static=True, default=2**17)

    def __check_init__(self):
        for name in ("rtol", "atol", "first_step", "min_step"):
            require_positive(name, getattr(self, name))
        if self.max_steps < 1:
            raise ValueError(f"Argument `max_steps` must be at least 1, but got {self.max_steps}.")


class Stretch(NamedTuple):
    """The last step with its dense output.

    It began at `begin` (s) in the flat state `state`, and after the part θ of its `length` (s) has
    grown by Σ_p θ^p growth[p]. The torques change their signs at the parts `turns`; `effort` is
    that before the step.
    """

    begin: Float[Array, ""]
    length: Float[Array, ""]
    state: Float[Array, " n"]
    growth: Float[Array, "4 n"]
    turns: Float[Array, "3"]
    effort: Float[Array, ""]


class Walk(NamedTuple):
    """Where a trajectory is: time (s), next instant to be looked at by number, flat state, the
    sides of the switching functions it is on with their values, and its last step.

    The flat state is the loop's state turned back, the cost, and the three torques' integrals
    since the step began.
    """

    t: Float[Array, ""]
    number: Int[Array, ""]
    state: Float[Array, " n"]
    sides: Bool[Array, " m"]
    gaps: Float[Array, " m"]
    stretch: Stretch


class Course(NamedTuple):
    """What stays the same along one trajectory: program, loop, and how the flat state is read."""

    program: Program
    loop: AbstractContinuousLoop
    restore: Callable[[Float[Array, " n"]], PyTree]

    @staticmethod
    def of(program: Program, copy: Copy) -> "Course":
        """The course of one case."""
        shapes = jax.eval_shape(_flat_parts, copy)
        template = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        return Course(program, copy.loop, ravel_pytree(template)[1])

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
            return _flat((motion.rate, running_cost(cost, motion), motion.torque))

        return lambda t, flat: rate(piece, self.program.cost, t, flat)


def _flat_parts(copy: Copy) -> PyTree:
    zero = jnp.zeros((), copy.start.omega.dtype)
    back = copy.loop.turned_back(zero, copy.loop.start(copy.start))
    return back, zero, jnp.zeros(AXES, zero.dtype)


def _flat(tree: PyTree) -> Float[Array, " n"]:
    return ravel_pytree(tree)[0]


def _constant(tree: PyTree) -> PyTree:
    """The tree with nothing to be differentiated."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_array(x) else x, tree)


def begin(tolerance: Tolerance, program: Program, copy: Copy) -> Progress:
    """Progress of one trajectory at time zero."""
    course, flat = Course.of(program, copy), _flat(_flat_parts(copy))
    zero = jnp.zeros((), flat.dtype)
    gaps = copy.loop.switches(zero, course.state(zero, flat))
    nowhere = jnp.zeros(AXES, flat.dtype)
    stretch = Stretch(zero, zero + 1.0, flat, jnp.zeros((4, flat.size), flat.dtype), nowhere, zero)
    walk = Walk(zero, jnp.array(0), flat, gaps > 0, gaps, stretch)
    return begun(walk, copy.start.omega, copy.possible, tolerance.first_step)


def unfinished(program: Program, bound: Int[Array, ""], progress: Progress) -> Bool[Array, ""]:
    """Whether instant `bound` is still ahead, or an earlier one still to be looked at."""
    walk: Walk = progress.state
    ahead = (walk.t < bound * program.interval) | (walk.number < bound)
    return ahead & (progress.code == int(Outcome.SUCCESS))


def iterate(
    solver: diffrax.AbstractSolver,
    tolerance: Tolerance,
    course: Course,
    bound: Int[Array, ""],
    progress: Progress,
) -> Progress:
    """One step tried, and all instants before number `bound` that it has passed looked at."""
    walk: Walk = progress.state
    looked_behind = walk.t < walk.number * course.program.interval
    needed = looked_behind & (walk.t < bound * course.program.interval)
    tried = _attempt(solver, tolerance, course, progress)
    progress = jax.tree.map(lambda new, old: jnp.where(needed, new, old), tried, progress)
    return _look_back(course, bound, progress)


def advance_adaptively(solver, tolerance, program, copy, progress, bound) -> Progress:
    """Progress of one trajectory up to instant number `bound`."""
    course, bound = Course.of(program, copy), jnp.asarray(bound)
    return jax.lax.while_loop(
        lambda progress: unfinished(program, bound, progress),
        lambda progress: iterate(solver, tolerance, course, bound, progress),
        progress,
    )


def finish(program: Program, copy: Copy, progress: Progress) -> Outputs:
    """Outputs of a trajectory that has gone all its way."""
    end = program.duration
    course, stretch = Course.of(program, copy), progress.state.stretch
    flat = _dense(stretch, _part(stretch, end))
    state = course.state(end, flat)
    plant = copy.loop.plant_state(state)
    sight = Sight.of(copy.loop.plant, plant)
    progress = looked_at(progress, end, sight, program.tolerances)
    success = progress.code == int(Outcome.SUCCESS)
    cost = course.restore(jnp.where(success, flat, progress.state.state))[1]
    progress = progress._replace(
        integrals=Integrals(cost, _effort(stretch, _part(stretch, end))),
        ended_at=jnp.where(success, end, progress.ended_at),
    )
    return outputs_of(progress, plant, end, copy.drawn, program.cost)


def observe(program: Program, copy: Copy, progress: Progress, number: Int[Array, ""]) -> Signals:
    """Signals at instant `number`, which the last step must have reached or passed."""
    t, stretch = number * program.interval, progress.state.stretch
    flat = _dense(stretch, _part(stretch, t))
    return copy.loop.signals(t, Course.of(program, copy).state(t, flat))


def _part(stretch: Stretch, t: Float[Array, ""]) -> Float[Array, ""]:
    return (t - stretch.begin) / stretch.length


def _dense(stretch: Stretch, part: Float[Array, ""]) -> Float[Array, " n"]:
    one, two, three, four = stretch.growth
    return stretch.state + part * (one + part * (two + part * (three + part * four)))


def _effort(stretch: Stretch, part: Float[Array, ""]) -> Float[Array, ""]:
    """∫ Σ|T_i| until a part of the step, from the integrals of T_i between its signs' changes."""
    turns = jnp.minimum(stretch.turns, part)
    one, two, three, four = stretch.growth[:, -AXES:]

    def integral(at):
        return at * (one + at * (two + at * (three + at * four)))

    until = integral(turns)
    return stretch.effort + jnp.sum(jnp.abs(until) + jnp.abs(integral(part) - until))


def _attempt(solver, tolerance, course: Course, progress: Progress) -> Progress:
    """Progress after one step, accepted or not."""
    tableau, walk, step = tableau_of(solver), progress.state, progress.step
    begin_state = walk.state.at[-AXES:].set(0.0)
    rates = stage_rates(tableau, course.rate(walk.sides), walk.t, step, begin_state)
    after = begin_state + step * weighted(tableau.b_sol, rates)
    error = step * weighted(tableau.b_error, rates)
    size = _constant(_size(tolerance, begin_state, after, error))
    accepted = (size <= 1) | (step <= tolerance.min_step)
    growth = jnp.stack([step * weighted(row, rates) for row in dense_weights(solver)])
    turns = jnp.zeros(AXES, growth.dtype)
    stretch = Stretch(walk.t, step, begin_state, growth, turns, progress.integrals.effort)
    seconds, state, sides, gaps = _until_switch(tolerance, course, walk, stretch, after)
    part = seconds / step
    turns = _constant(sign_change(growth[:, -AXES:], part))
    stretch = stretch._replace(turns=turns)
    further = Walk(walk.t + seconds, walk.number, state, sides, gaps, stretch)
    integrals = progress.integrals._replace(effort=_effort(stretch, part))
    moved = progress._replace(state=further, integrals=integrals, ended_at=further.t)
    following = _judged(tolerance, course.program, progress, moved, accepted)
    # no longer step after one that met a switch: a law that slides would lose its way
    factor = jnp.minimum(_factor(size), jnp.where(part < 1, 1.0, LARGEST_FACTOR))
    proposal = step * _constant(factor)
    return following._replace(step=jnp.maximum(proposal, tolerance.min_step))


def _judged(tolerance, program, before: Progress, moved: Progress, accepted) -> Progress:
    """Further on, where it was, or ended."""
    judged = moved.state.state[: -AXES - 1]
    fine = jnp.all(jnp.abs(judged) < program.state_limit)  # NaN fails the comparison
    steps = before.steps + 1
    code = jnp.where(accepted & ~fine, int(Outcome.STATE_LIMIT), before.code)
    out = (code == int(Outcome.SUCCESS)) & (steps >= tolerance.max_steps)
    code = jnp.where(out, int(Outcome.MAX_STEPS), code)
    kept = jax.tree.map(lambda new, old: jnp.where(accepted & fine, new, old), moved, before)
    return kept._replace(code=code, steps=steps)


def _until_switch(tolerance, course: Course, walk: Walk, stretch: Stretch, after):
    """Length (s) of the step until it meets a switch, or its whole length, and what is there."""
    whole, end = stretch.length, walk.t + stretch.length
    if not walk.sides.size:
        return whole, after, walk.sides, walk.gaps
    sign = jnp.where(walk.sides, -1.0, 1.0)

    def excess(part):  # positive beyond a surface
        at = walk.t + part * whole
        return jnp.max(sign * still.gaps(walk.sides, at, _dense(still_stretch, part)))

    still = _constant(course)
    still_stretch = _constant(stretch)
    end_gaps = course.gaps(walk.sides, end, after)
    bracket = _bracket(sign, _constant(walk.gaps), excess, _constant(end_gaps))
    crosses = bracket.high_value > 0
    part = _constant(located(excess, bracket, crosses))
    at_part = still.gaps(walk.sides, walk.t + part * whole, _dense(still_stretch, part))
    one_hot = jnp.arange(sign.size) == jnp.argmax(sign * at_part)
    seconds = _corrected(course, walk, stretch, one_hot, part)
    seconds = jnp.where(
        crosses, jnp.clip(seconds, jnp.minimum(tolerance.min_step, whole), whole), whole
    )
    state = jnp.where(crosses, _dense(stretch, seconds / whole), after)
    flipped = walk.sides ^ (one_hot & crosses)
    gaps = course.gaps(flipped, walk.t + seconds, state)
    # what jumps with the piece may be on another side there
    sides = jnp.where(crosses & ~one_hot, gaps > 0, flipped)
    return seconds, state, sides, gaps


def _bracket(sign, begin_gaps, excess, end_gaps) -> Bracket:
    """The half of the step that first crosses a surface, if its `high_value` is positive."""
    begin_value, end_value = jnp.max(sign * begin_gaps), jnp.max(sign * end_gaps)
    half = jnp.full_like(begin_value, 0.5)
    middle_value = excess(half)
    early = middle_value > 0
    return Bracket(
        jnp.where(early, 0.0, half),
        jnp.where(early, begin_value, middle_value),
        jnp.where(early, half, 1.0),
        jnp.where(early, middle_value, end_value),
    )


def _corrected(course: Course, walk: Walk, stretch: Stretch, one_hot, part) -> Float[Array, ""]:
    """The seconds until the switch: one step of Newton's method, which moves with parameters."""
    first = part * stretch.length

    def gap(seconds):
        flat = _dense(stretch, seconds / stretch.length)
        gaps = course.gaps(walk.sides, walk.t + seconds, flat)
        return jnp.sum(jnp.where(one_hot, gaps, 0.0))

    value, slope = jax.jvp(gap, (first,), (jnp.ones_like(first),))
    slope = _constant(slope)
    correction = -value / jnp.where(slope == 0, 1.0, slope)
    sound = (slope != 0) & (jnp.abs(correction) < 1e-2 * stretch.length)
    return jnp.where(sound, first + correction, first)


def _look_back(course: Course, bound, progress: Progress) -> Progress:
    """With all instants looked at that the last step has passed."""
    program = course.program

    def pending(progress: Progress):
        walk: Walk = progress.state
        passed = (walk.number < bound) & (walk.number * program.interval <= walk.t)
        return passed & (progress.code == int(Outcome.SUCCESS))

    def look(progress: Progress) -> Progress:
        walk: Walk = progress.state
        t = walk.number * program.interval
        state = course.state(t, _dense(walk.stretch, _part(walk.stretch, t)))
        sight = Sight.of(course.loop.plant, course.loop.plant_state(state))
        seen = looked_at(progress, t, sight, program.tolerances)
        return seen._replace(state=walk._replace(number=walk.number + 1))

    return jax.lax.while_loop(pending, look, progress)


def _size(tolerance, before, after, error) -> Float[Array, ""]:
    """The error in parts of what is tolerated; NaN where it is no number, never accepted."""
    x, y, e = (values[:-AXES] for values in (before, after, error))
    scale = tolerance.atol + tolerance.rtol * jnp.maximum(jnp.abs(x), jnp.abs(y))
    return jnp.sqrt(jnp.mean((e / scale) ** 2))


def _factor(size: Float[Array, ""]) -> Float[Array, ""]:
    """How much longer the next step may be; much shorter where the error is no number."""
    wanted = SAFETY * jnp.maximum(size, 1e-12) ** -0.2
    known = jnp.where(jnp.isfinite(size), wanted, LEAST_FACTOR)
    return jnp.clip(known, LEAST_FACTOR, LARGEST_FACTOR)
