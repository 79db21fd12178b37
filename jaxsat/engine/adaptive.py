"""Adaptive steps through a loop in smooth pieces, each trajectory at its own pace.

During a step the loop is held in one of its pieces (`loop.piece`). Where a switching function has
changed its sign at the end of one of a step's equal parts, the instant is located on the step's
dense output, the step ends there, and the next one is taken in the other piece. Nothing else ends
a step: the instants that are looked at, and the end of the run, lie on the dense output. When a
trajectory settles is judged on the dense output of a step that is left behind, whatever instants
are looked at.

The program of one trajectory is `begin`, then `iterate` while `unfinished`, then `finish`, on a
`Progress` of fixed size; any engine that runs these runs the method.

Derivatives by forward mode are those of the law with its switches. The step length until a
switch carries one differentiable step of Newton's method, so the instant moves with the
parameters as it should, and so does all that follows; which steps are taken is held fixed.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.checks import as_float, require_positive
from jaxsat.engine.crossing import sign_changes
from jaxsat.engine.program import Copy, Program
from jaxsat.engine.progress import (
    Integrals,
    Outputs,
    Progress,
    begun,
    looked_at,
    outputs_of,
)
from jaxsat.engine.runge_kutta import stage_rates, tableau_of, weighted
from jaxsat.engine.settling import judged_along
from jaxsat.engine.switching import Landing, until_switch
from jaxsat.engine.walk import (
    Course,
    Stretch,
    Walk,
    constant,
    flat_of,
    flat_parts,
    part_of,
)
from jaxsat.simulation import Outcome, Signals
from jaxsat.simulation.assessment import Sight

SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.9, 0.2, 5.0


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


def begin(
    solver: diffrax.AbstractSolver, tolerance: Tolerance, program: Program, copy: Copy
) -> Progress:
    """Progress of one trajectory at time zero."""
    course, flat = Course.of(solver, program, copy), flat_of(flat_parts(copy))
    zero = jnp.zeros((), flat.dtype)
    gaps = course.loop.switches(zero, course.state(zero, flat))
    nowhere = jnp.zeros((course.output.parts, course.axes), flat.dtype)
    stretch = Stretch(
        zero,
        zero + 1.0,
        flat,
        jnp.zeros((course.output.rows, flat.size), flat.dtype),
        nowhere,
        zero,
    )
    rate = course.rate(gaps > 0)(zero, flat)
    walk = Walk(zero, jnp.array(0), flat, rate, gaps > 0, gaps, stretch)
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
    needed &= progress.code == int(Outcome.SUCCESS)
    return _look_back(course, bound, _attempt(solver, tolerance, course, needed, progress))


def advance_adaptively(solver, tolerance, program, copy, progress, bound, batch=None) -> Progress:
    """Progress of one trajectory up to instant number `bound`, while any of a `batch` goes on.

    An iteration leaves a trajectory that has ended as it is.
    """
    course, bound = Course.of(solver, program, copy, batch), jnp.asarray(bound)
    return jax.lax.while_loop(
        lambda progress: course.anywhere(unfinished(program, bound, progress)),
        lambda progress: iterate(solver, tolerance, course, bound, progress),
        progress,
    )


def finish(
    solver: diffrax.AbstractSolver,
    program: Program,
    copy: Copy,
    progress: Progress,
    end: Float[Array, ""],
) -> Outputs:
    """Outputs of a trajectory that has gone all its way, until time `end` (s)."""
    course, stretch = Course.of(solver, program, copy), progress.state.stretch
    flat = course.dense(stretch, part_of(stretch, end))
    state = course.state(end, flat)
    plant = course.loop.plant_state(state)
    progress = looked_at(progress, Sight.of(course.loop.plant, plant))
    settled = judged_along(course, stretch, part_of(stretch, end), progress.settled)
    success = progress.code == int(Outcome.SUCCESS)
    cost = course.restore(jnp.where(success, flat, progress.state.state))[1]
    progress = progress._replace(
        integrals=Integrals(cost, course.effort_until(stretch, part_of(stretch, end))),
        settled=settled,
        ended_at=jnp.where(success, end, progress.ended_at),
    )
    return outputs_of(progress, plant, end, copy.drawn, program.cost)


def observe(
    solver: diffrax.AbstractSolver,
    program: Program,
    copy: Copy,
    progress: Progress,
    number: Int[Array, ""],
) -> Signals:
    """Signals at instant `number`, which the last step must have reached or passed."""
    course, stretch = Course.of(solver, program, copy), progress.state.stretch
    t = number * program.interval
    return course.loop.signals(t, course.state(t, course.dense(stretch, part_of(stretch, t))))


def _attempt(solver, tolerance, course: Course, needed, progress: Progress) -> Progress:
    """Progress after one step, accepted or not; as it was unless that is `needed`."""
    tableau, walk, step = tableau_of(solver), progress.state, progress.step
    begin_state = course.with_no_torque(walk.state)
    rates = stage_rates(tableau, course.rate(walk.sides), walk.t, step, begin_state, walk.rate)
    grown = step * weighted(tableau.b_sol, rates)
    after = begin_state + grown
    error = step * weighted(tableau.b_error, rates)
    size = constant(_size(tolerance, *map(course.judged, (begin_state, after, error))))
    accepted = needed & ((size <= 1) | (step <= tolerance.min_step))
    growth = course.growth(step, rates, grown)
    turns = jnp.zeros((course.output.parts, course.axes), growth.dtype)
    stretch = Stretch(walk.t, step, begin_state, growth, turns, progress.integrals.effort)
    end = Landing(step, after, rates[-1], walk.sides, walk.gaps)
    landing = until_switch(course, walk, stretch, end, accepted, tolerance.min_step)
    part = landing.seconds / step
    powers = course.torque_powers(growth)
    turns = sign_changes(powers, course.output.parts, part, accepted, course.seldom)
    stretch = stretch._replace(turns=constant(turns))
    further = Walk(
        walk.t + landing.seconds,
        walk.number,
        landing.state,
        landing.rate,
        landing.sides,
        landing.gaps,
        stretch,
    )
    integrals = progress.integrals._replace(effort=course.effort_until(stretch, part))
    left_behind = part_of(walk.stretch, walk.t)
    settled = judged_along(course, walk.stretch, left_behind, progress.settled)
    moved = progress._replace(
        state=further, integrals=integrals, settled=settled, ended_at=further.t
    )
    following = _judged(tolerance, course, progress, moved, needed, accepted)
    # no longer step after one that met a switch: a law that slides would lose its way
    factor = jnp.minimum(
        _factor(size, solver.order(None)), jnp.where(part < 1, 1.0, LARGEST_FACTOR)
    )
    proposal = jnp.maximum(step * constant(factor), tolerance.min_step)
    return following._replace(step=jnp.where(needed, proposal, step))


def _judged(tolerance, course, before: Progress, moved: Progress, needed, accepted) -> Progress:
    """Further on, where it was, or ended."""
    limit = course.program.state_limit
    fine = jnp.all(jnp.abs(course.judged(moved.state.state)[:-1]) < limit)  # NaN fails it
    steps = before.steps + needed
    code = jnp.where(accepted & ~fine, int(Outcome.STATE_LIMIT), before.code)
    out = needed & (code == int(Outcome.SUCCESS)) & (steps >= tolerance.max_steps)
    code = jnp.where(out, int(Outcome.MAX_STEPS), code)
    kept = jax.tree.map(lambda new, old: jnp.where(accepted & fine, new, old), moved, before)
    return kept._replace(code=code, steps=steps)


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
        state = course.state(t, course.dense(walk.stretch, part_of(walk.stretch, t)))
        sight = Sight.of(course.loop.plant, course.loop.plant_state(state))
        seen = looked_at(progress, sight)
        return seen._replace(state=walk._replace(number=walk.number + 1))

    return jax.lax.while_loop(pending, look, progress)


def _size(tolerance, before, after, error) -> Float[Array, ""]:
    """The error in parts of what is tolerated; NaN where it is no number, never accepted."""
    scale = tolerance.atol + tolerance.rtol * jnp.maximum(jnp.abs(before), jnp.abs(after))
    return jnp.sqrt(jnp.mean((error / scale) ** 2))


def _factor(size: Float[Array, ""], order: int) -> Float[Array, ""]:
    """How much longer the next step may be; much shorter where the error is no number."""
    wanted = SAFETY * jnp.exp(-(1 / order) * jnp.log(jnp.maximum(size, 1e-12)))
    known = jnp.where(jnp.isfinite(size), wanted, LEAST_FACTOR)
    return jnp.clip(known, LEAST_FACTOR, LARGEST_FACTOR)
