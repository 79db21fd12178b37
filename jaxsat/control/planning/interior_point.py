"""An interior-point method for the nonlinear program of a plan.

Every iteration takes one Newton step, shortened until it leaves the torques within their limits and
decreases a merit function: the objective with its barriers plus ρ Σ|defects|, ρ above every
multiplier. The barrier parameter μ decreases once steps are long and the defects small.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.barriers import (
    TO_BOUNDARY,
    EndTerms,
    TorqueCost,
    barrier,
    longest_place_step,
    moved_multipliers,
    slacks,
    stepped,
)
from jaxsat.control.planning.riccati import NewtonStep, QuadraticTerms, newton_step
from jaxsat.control.planning.transcription import ARRIVALS, PlanObjective, Transcription, Unknowns
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector

INSIDE = 0.9
"""Largest torque of a guess, relative to the limit."""

HALVINGS = 6
"""Largest number of halvings of a step."""

DEFECT_TOLERANCE = 1e-7
"""Dimensionless tolerance on the sum of all defects and of the arrival of a flyable plan."""

LARGEST_CHANGE = 1.0
"""Largest change of any state in one step."""

LARGEST_STRETCH = 0.3
"""Largest relative change of the duration in one step."""

STEADY = 1e-3
"""Tolerance on the remaining change of a converged plan: of the duration and of the objective with
its barriers, relative to their values with the largest cost of the barriers."""

CALM = 0.1
"""Σ of defects below which μ falls."""

FALL = 0.5
"""Factor of μ per decrease."""

PROXIMITIES = (1e-4, 1e4)
"""Range of the weight of squared changes of the torques."""

PENALTY = 1.5
"""ρ relative to the largest multiplier."""

SUFFICIENT, ROUNDING = 1e-4, 1e-9
"""Least decrease of the merit, relative to its slope's prediction, and its round-off."""


class Settings(NamedTuple):
    """Initial and final μ, the initial weight of changes, and the largest number of iterations.

    Σ 2 μ over all torques bounds the excess of the objective over the optimum, in units of τ. The
    duration stays above `least_duration` (τ): near the target a shorter one would gain more than
    its defects cost.
    """

    first_barrier: float | RealScalar
    last_barrier: float | RealScalar
    proximity: float | RealScalar
    iterations: int | IntScalar
    least_duration: float | RealScalar = 0.0


class Iterate(NamedTuple):
    """State of the method: unknowns, torques' cost, multipliers of the arrival and of its balls.

    `defects` is the sum of all defects; `done` is true if the plan is optimal.
    """

    unknowns: Unknowns
    cost: TorqueCost
    arrival_multipliers: Float[Array, "6"]
    barrier: RealScalar
    proximity: RealScalar
    iterations: IntScalar
    defects: RealScalar
    done: BoolScalar
    end_multipliers: Vector | None = None


def solve(
    program: Transcription, begin: RealScalar, guess: Unknowns, settings: Settings
) -> Iterate:
    """The local optimum from a guess, if the iterations suffice: see `Iterate.done`."""

    def under_way(at: Iterate):
        return ~at.done & (at.iterations < settings.iterations)

    first = begun(program, begin, guess, settings)
    return lax.while_loop(under_way, lambda at: iterated(program, begin, at, settings), first)


def begun(
    program: Transcription, begin: RealScalar, guess: Unknowns, settings: Settings
) -> Iterate:
    """The iterate before the first iteration from a guess."""
    torque = lax.map(lambda u: jnp.clip(u, -INSIDE, INSIDE), guess.torque)
    unknowns, dtype = guess._replace(torque=torque), guess.last.dtype
    mu, length = jnp.asarray(settings.first_barrier, dtype), guess.duration / program.intervals
    return Iterate(
        unknowns,
        lax.map(lambda u: _cost(program, u, mu, length), torque),
        jnp.zeros(ARRIVALS, dtype),
        mu,
        jnp.asarray(settings.proximity, dtype),
        jnp.array(0),
        program.defects(begin, unknowns),
        jnp.array(False),
        None if unknowns.place is None else mu / slacks(unknowns.place),
    )


def _cost(
    program: Transcription, u: Float[Array, " m"], mu: RealScalar, length: RealScalar
) -> TorqueCost:
    if program.objective is PlanObjective.TIME:
        return TorqueCost.free(u, mu)
    return TorqueCost.of_sizes(u, mu, length)


def _length(program: Transcription, at: Iterate) -> RealScalar:
    return at.unknowns.duration / program.intervals


def _terms(program: Transcription, at: Iterate, settings: Settings) -> QuadraticTerms:
    mu, length = at.barrier, _length(program, at)
    spare = at.unknowns.duration - settings.least_duration
    curvature, gradient = lax.map(lambda cost: cost.terms(mu, length), at.cost)
    if program.objective is PlanObjective.TIME:
        of_duration = (mu / spare**2, 1 - mu / spare)
    else:
        of_duration = (jnp.full_like(mu, jnp.inf), jnp.zeros_like(mu))
    end, place, radii = None, at.unknowns.place, program.radii
    if place is not None and radii is not None and at.end_multipliers is not None:
        end = EndTerms.of(place, at.end_multipliers, radii, mu)
    return QuadraticTerms(curvature, gradient, *of_duration, at.proximity, end)


def iterated(program: Transcription, begin: RealScalar, at: Iterate, settings: Settings) -> Iterate:
    """The iterate after one more step."""
    terms = _terms(program, at, settings)
    step = newton_step(program, begin, at.unknowns, at.arrival_multipliers, terms)
    cost_change, primal, dual = _cost_change(program, at, step.change, settings)
    length, defects, slope = _line_search(program, begin, at, step, cost_change, primal, settings)
    accepted = length > 0
    dual = jnp.where(accepted, dual, 0.0)

    def moved(rows):
        cost, change = rows
        return cost.moved(change, length, dual, at.barrier)

    calm = (length > LARGEST_STRETCH) & (defects < CALM)
    mu = jnp.maximum(at.barrier * FALL, settings.last_barrier)
    steady = jnp.abs(step.change.duration) < STEADY * at.unknowns.duration
    # A large weight of changes makes the step small, but not the possible gain.
    freed = jnp.abs(slope) * jnp.maximum(1.0, at.proximity)
    steady = steady & (freed < STEADY * _scale(program, at))
    last = at.barrier <= settings.last_barrier
    return Iterate(
        _moved(at.unknowns, step.change, length),
        lax.map(moved, (at.cost, cost_change)),
        jnp.where(accepted, step.arrival_multipliers, at.arrival_multipliers),
        jnp.where(calm, mu, at.barrier),
        _next_proximity(at.proximity, length),
        at.iterations + 1,
        defects,
        last & accepted & steady & (defects < DEFECT_TOLERANCE),
        _end_multipliers(at, step.change, length, dual),
    )


def _end_multipliers(
    at: Iterate, change: Unknowns, length: RealScalar, dual: RealScalar
) -> Vector | None:
    place, change_of_place = at.unknowns.place, change.place
    if place is None or change_of_place is None or at.end_multipliers is None:
        return None
    return moved_multipliers(place, at.end_multipliers, change_of_place, length, dual, at.barrier)


def _scale(program: Transcription, at: Iterate) -> RealScalar:
    """The objective, plus its largest excess over the optimum by the barriers: μ for each limit."""
    limits = len(at.cost.limits) * at.unknowns.torque.size
    limits += 0 if at.end_multipliers is None else len(at.end_multipliers)
    return program.value(at.unknowns) + limits * at.barrier


def _moved(at: Unknowns, change: Unknowns, step: RealScalar) -> Unknowns:
    states, torque = lax.map(
        lambda row: (stepped(row[0], row[1], step), stepped(row[2], row[3], step)),
        (at.states, change.states, at.torque, change.torque),
    )
    duration = stepped(at.duration, change.duration, step)
    place = at.place
    if place is not None and change.place is not None:
        place = stepped(place, change.place, step)
    return Unknowns(states, stepped(at.last, change.last, step), torque, duration, place)


def _cost_change(
    program: Transcription, at: Iterate, change: Unknowns, settings: Settings
) -> tuple[TorqueCost, RealScalar, RealScalar]:
    """Newton's step of slacks and multipliers, and the longest steps of both."""
    mu, length = at.barrier, _length(program, at)

    def one(longest, row):
        cost, du, dx = row
        cost_change = cost.change(du, mu, length)
        primal, dual = cost.longest(cost_change)
        by_state = LARGEST_CHANGE / jnp.maximum(jnp.max(jnp.abs(dx)), LARGEST_CHANGE)
        primal = jnp.minimum(jnp.minimum(primal, by_state), longest[0])
        return (primal, jnp.minimum(dual, longest[1])), cost_change

    most, spare = LARGEST_STRETCH * at.unknowns.duration, at.unknowns.duration
    spare = TO_BOUNDARY * (spare - settings.least_duration)
    most = jnp.where(change.duration < 0, jnp.minimum(most, spare), most)
    first = (most / jnp.maximum(jnp.abs(change.duration), most), jnp.ones_like(mu))
    (primal, dual), change_of_cost = lax.scan(one, first, (at.cost, change.torque, change.states))
    if at.unknowns.place is not None and change.place is not None:
        primal = jnp.minimum(primal, longest_place_step(at.unknowns.place, change.place))
    return change_of_cost, primal, dual


def _next_proximity(proximity: RealScalar, length: RealScalar) -> RealScalar:
    """The next weight: less after a long step, more after a short one, much more after none."""
    short = jnp.where(length < 0.1, 2.0, 1.0)
    factor = jnp.where(length > 0.4, 1 / 3, jnp.where(length > 0, short, 8.0))
    return jnp.clip(proximity * factor, *PROXIMITIES)


def _line_search(
    program: Transcription,
    begin: RealScalar,
    at: Iterate,
    step: NewtonStep,
    cost_change: TorqueCost,
    longest: RealScalar,
    settings: Settings,
) -> tuple[RealScalar, RealScalar, RealScalar]:
    """The step's length, 0 if none decreases the merit, the defects after it, and the first-order
    change of the objective with its barriers over the whole step."""
    length, mu = _length(program, at), at.barrier
    penalty = PENALTY * step.largest_multiplier

    def objective(share: RealScalar) -> RealScalar:
        def one(total, row):
            cost, change = row
            return total + cost.value(change, share, mu, length), None

        first = jnp.zeros_like(share)
        if program.objective is PlanObjective.TIME:
            duration = at.unknowns.duration + share * step.change.duration
            first = duration - mu * jnp.log(duration - settings.least_duration)
        if at.unknowns.place is not None and step.change.place is not None:
            first = first + barrier(at.unknowns.place + share * step.change.place, mu)
        return lax.scan(one, first, (at.cost, cost_change))[0]

    nowhere = jnp.zeros_like(longest)
    value, slope = jax.jvp(objective, (nowhere,), (jnp.ones_like(longest),))
    before = value + penalty * at.defects
    descent = slope - penalty * at.defects

    def going_on(search):
        _, accepted, halvings, _ = search
        return ~accepted & (halvings < 1 + HALVINGS)

    def attempt(search):
        share, _, halvings, _ = search
        defects = program.defects(begin, _moved(at.unknowns, step.change, share))
        merit = objective(share) + penalty * defects
        accepted = merit <= before + SUFFICIENT * share * descent + ROUNDING
        return jnp.where(accepted, share, share / 2), accepted, halvings + 1, defects

    start = (longest, jnp.array(False), jnp.array(0), at.defects)
    share, accepted, _, defects = lax.while_loop(going_on, attempt, start)
    defects = jnp.where(accepted, defects, at.defects)
    return jnp.where(accepted, share, 0.0), defects, slope
