"""Planner from any state to rest at the target, in least time or with least effort."""

import dataclasses
import enum
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.guesses import guess, random_numbers, resampled
from jaxsat.control.planning.interior_point import Iterate, solve
from jaxsat.control.planning.search import ARRIVING, CLOSE, ROUGH, in_hemisphere_of, worth_of
from jaxsat.control.planning.transcription import PlanObjective, Transcription, Unknowns
from jaxsat.core.array_types import IntScalar, RealScalar
from jaxsat.core.checks import (
    as_float,
    not_negative,
    require_counts,
    require_directions,
    require_finite,
    require_positive,
)
from jaxsat.core.errors import ArgumentError
from jaxsat.core.tolerances import Tolerances
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState, RigidBody

FINE = CLOSE._replace(iterations=80)
"""Settings of the search from the best guess. The search from every guess, `ROUGH`, has half of the
intervals."""

STRETCHED = FINE._replace(first_barrier=1e-2, iterations=150)
"""Settings of the search near a plan of another duration, which is a more distant start."""

FINE_SUBSTEPS = 4
"""Number of Runge-Kutta steps per interval in that search; one in the search before."""


class PlanStatus(enum.IntEnum):
    """Status of a plan.

    A SOLVED plan is locally optimal. A FLYABLE one arrives within `ARRIVING`, but may be longer or
    costlier than necessary. A FAILED one must not be flown.
    """

    SOLVED = 0
    FLYABLE = 1
    FAILED = 2


class Plan(NamedTuple):
    """Torques of the thrusters (N m), held over equal intervals, and the states at their ends.

    The plan begins at `begin` and takes `duration` (s). `quaternion` is scalar first, from the
    orbit to the body frame, `omega` in rad/s. `effort` is ∫ Σ|T_i| dt of the thrusters (N m s),
    `status` a `PlanStatus`, `defects` the dimensionless sum of the defects.
    """

    begin: RealScalar
    duration: RealScalar
    torque: Float[Array, "n m"]
    quaternion: Float[Array, "ends 4"]
    omega: Float[Array, "ends 3"]
    effort: RealScalar
    status: IntScalar
    iterations: IntScalar
    defects: RealScalar

    def torque_at(self, t: RealScalar) -> Float[Array, " m"]:
        """The thrusters' torques at time `t` (s), N m; zero before and after the plan."""
        count = self.torque.shape[0]
        place = (t - self.begin) / self.duration * count
        torque = self.torque[jnp.clip(place.astype(int), 0, count - 1)]
        return jnp.where((place >= 0) & (place < count), torque, 0.0)


class Planner(eqx.Module):
    """Plans for a body with thrusters that each produce up to `limit` N m of either sign.

    The plans use 1 - `margin` of the limit. `torque_axes` (3, m) are the directions of the
    thrusters' torques; a longer one than 1 exceeds the limit by that factor. Two are enough
    wherever the normal form has c ≠ 0. The search is local: it begins from `guesses` paths to the
    target, with half of the `intervals`, and continues from the best. The plan uses the model's
    disturbance in advance. Plans end at rest or, with `tolerances`, where a spacecraft enters them.

    Raises `ArgumentError` for numbers out of range, and for a model with wheels.
    """

    model: RigidBody
    torque_axes: Float[Array, "3 m"] = eqx.field(converter=as_float)
    limit: RealScalar = eqx.field(converter=as_float)
    margin: RealScalar = eqx.field(converter=not_negative("margin"), default=0.0)
    guesses: int = eqx.field(static=True, default=24)
    intervals: int = eqx.field(static=True, default=48)
    tolerances: Tolerances | None = None

    def __check_init__(self):
        require_directions("torque_axes", self.torque_axes)
        require_positive("limit", self.limit)
        require_finite("limit", self.limit)
        require_positive("1 - margin", 1 - self.margin)
        require_counts(guesses=self.guesses, intervals=self.intervals)
        if self.intervals % 2:
            raise ArgumentError("intervals", "must be even", self.intervals)
        if self.model.stores_momentum:
            raise ArgumentError("model", "must have no wheels")

    def quickest(self, t: RealScalar, state: PlantState) -> Plan:
        """The plan of least time from a state at time `t` (s)."""
        return self._searched(PlanObjective.TIME, t, state, None)

    def cheapest(
        self, t: RealScalar, state: PlantState, duration: RealScalar, near: Plan | None = None
    ) -> Plan:
        """The plan of least effort that takes `duration` (s).

        The status is FAILED if that is too short, not positive or not finite. With a plan `near` of
        another duration from the same state, the search starts from that plan alone, flown at
        another pace. Where the time hardly suffices guesses fail, and a fast plan leads there.
        """
        duration = as_float(duration)
        if near is None:
            plan = self._searched(PlanObjective.EFFORT, t, state, duration)
        else:
            plan = self._stretched(t, state, near, duration)
        possible = (duration > 0) & jnp.isfinite(duration)  # backwards in time it could be solved
        status = jnp.where(possible, plan.status, PlanStatus.FAILED)
        return plan._replace(duration=duration, status=status)

    def replanned(self, t: RealScalar, state: PlantState, plan: Plan) -> Plan:
        """The plan of least time from a state along an earlier plan, by a search near it."""
        program = self._program(PlanObjective.TIME, self.intervals, FINE_SUBSTEPS)
        unit, unknowns = program.time_unit, _unknowns(program, plan)
        x = in_hemisphere_of(unknowns.states[0], program.scaled(state))
        first = resampled(program, x, unknowns, (t - plan.begin) / unit)
        return self._plan(program, t, solve(program, t / unit, first, FINE))

    def _program(self, objective: PlanObjective, intervals: int, substeps: int) -> Transcription:
        limit = self.limit * (1 - self.margin)
        sizes = (objective, intervals, substeps)
        return Transcription(
            self.model, self.torque_axes, limit, *sizes, tolerances=self.tolerances
        )

    def _stretched(
        self, t: RealScalar, state: PlantState, near: Plan, duration: RealScalar
    ) -> Plan:
        """The plan of least effort near another one flown at another pace."""
        program = self._program(PlanObjective.EFFORT, self.intervals, FINE_SUBSTEPS)
        unit, unknowns = program.time_unit, _unknowns(program, near)
        pace = near.duration / duration
        slower = jnp.concatenate([jnp.ones(4), jnp.full(3, pace)])
        x = in_hemisphere_of(unknowns.states[0], program.scaled(state))
        states = (unknowns.states * slower[None]).at[0].set(x)
        torque, last = unknowns.torque * pace**2, unknowns.last
        first = Unknowns(states, last, torque, duration / unit, program.place(last))
        return self._plan(program, t, solve(program, t / unit, first, STRETCHED))

    def _searched(
        self,
        objective: PlanObjective,
        t: RealScalar,
        state: PlantState,
        duration: RealScalar | None,
    ) -> Plan:
        """The best of all guesses on half of the intervals, then improved on all of them."""
        coarse = self._program(objective, self.intervals // 2, 1)
        coarse = dataclasses.replace(coarse, tolerances=None)
        unit = coarse.time_unit
        x, begin = coarse.scaled(state), t / unit
        scaled = None if duration is None else duration / unit

        def better(best, numbers):
            solution = solve(coarse, begin, guess(coarse, x, numbers, scaled), ROUGH)
            worth = worth_of(coarse, x, solution)
            improves = worth < best[0]
            new = (worth, solution.unknowns)
            best_two = choose(improves, new, best[:2])
            return (*best_two, best[2] + solution.iterations), None

        numbers = {key: jnp.asarray(value) for key, value in random_numbers(self.guesses).items()}
        nothing = guess(coarse, x, {key: value[0] for key, value in numbers.items()}, scaled)
        first = (jnp.full_like(begin, jnp.inf), nothing, jnp.array(0))
        (_, best, iterations), _ = lax.scan(better, first, numbers)
        fine = self._program(objective, self.intervals, FINE_SUBSTEPS)
        first = resampled(fine, x, best, jnp.zeros_like(begin))
        solution = solve(fine, begin, first, FINE if self.tolerances is None else STRETCHED)
        plan = self._plan(fine, t, solution)
        return plan._replace(iterations=plan.iterations + iterations)

    def _plan(self, program: Transcription, t: RealScalar, solution: Iterate) -> Plan:
        unknowns, unit = solution.unknowns, program.time_unit
        arrives = solution.defects < ARRIVING  # not for NaN
        status = jnp.where(solution.done, PlanStatus.SOLVED, PlanStatus.FLYABLE)
        states = jnp.concatenate([unknowns.states, unknowns.last[None]])
        return Plan(
            begin=t,
            duration=unknowns.duration * unit,
            torque=unknowns.torque * program.limit,
            quaternion=states[:, :4],
            omega=states[:, 4:] / unit,
            effort=program.effort(unknowns) * unit * program.limit,
            status=jnp.where(arrives, status, PlanStatus.FAILED),
            iterations=solution.iterations,
            defects=solution.defects,
        )


def _unknowns(program: Transcription, plan: Plan) -> Unknowns:
    states = jnp.concatenate([plan.quaternion, plan.omega * program.time_unit], axis=1)
    torque, duration = plan.torque / program.limit, plan.duration / program.time_unit
    return Unknowns(states[:-1], states[-1], torque, duration)
