"""The tracker of a plan that was made before, which flight code has in place of a planner."""

import enum
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.normal_form import NormalForm, clipped
from jaxsat.control.planning.search import PlanSearch, in_hemisphere_of
from jaxsat.control.planning.tracking import (
    LAST_WEIGHTS,
    WEIGHTS,
    Guidance,
    PlanTable,
    table_of,
    tracking_gains,
)
from jaxsat.control.planning.transcription import (
    AbstractCorrection,
    PlanObjective,
    Transcription,
)
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.supervisor import Phase, SettlingMemory, ThreeSlewSettling
from jaxsat.core.array_types import BoolScalar, IntScalar, Pair, RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.declaration.keys import LARGEST, Key, number
from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import Range
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

GUESSES = 24
"""Paths to the target from which a plan is searched."""

ANY = Range(-LARGEST, LARGEST)
"""Range of gains: all that is finite."""

FAR = 0.1
"""Rotation from the target (rad) above which three slews follow a failed plan; below, the
oscillation does."""


class PlanTrackingMode(enum.IntEnum):
    """The active mode: that of the law of three slews, or FOLLOWING the plan."""

    STOPPING = Phase.STOPPING.value
    SLEWING = Phase.SLEWING.value
    OSCILLATING = Phase.OSCILLATING.value
    HOLDING = Phase.HOLDING.value
    FOLLOWING = 6


class PlanTrackingMemory(NamedTuple):
    """Memory of the law of three slews, and whether a plan is followed or still ahead."""

    settling: SettlingMemory
    follows: BoolScalar
    waits: BoolScalar


class PlanRow(NamedTuple):
    """One interval of a `PlanTable`, with its number."""

    number: RealScalar
    attitude: Float[Array, "4"]
    rate: Vector
    torque: Pair
    attitude_gain: Float[Array, "m 4"]
    rate_gain: Float[Array, "m 3"]


class AbstractPlanLaw(AbstractSampledController):
    """A law that follows plans; before and after them `settling`, the law of three slews, acts."""

    settling: eqx.AbstractVar[ThreeSlewSettling]

    @property
    def period(self) -> RealScalar:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The control period, s: that of `settling`."""
        return self.settling.period

    @property
    def form(self) -> NormalForm:
        """The law's model of the plant, with its frame."""
        return self.settling.form

    def judged(self, memory: Any) -> SettlingMemory:
        """The memory of the law of three slews, without that of a search, whose trials may
        diverge."""
        return memory.settling


class PlanTracking(AbstractPlanLaw):
    """Follows a plan by feedback along it, and settles the remaining errors by three slews.

    The plan is data: another one may take its place at any time before its own begin. It is
    followed from its begin on, by at most the whole torque limit. It is given up where the attitude
    differs from the plan's by more than `largest_error` (rad). Before the plan and after it
    `settling`, the law of three slews, acts; after one that has arrived, with its fine stage.
    """

    modes: ClassVar[type[enum.IntEnum]] = PlanTrackingMode

    settling: ThreeSlewSettling
    plan: PlanTable
    largest_error: RealScalar = eqx.field(converter=positive("largest_error"), default=0.5)

    @property
    def plan_keys(self) -> tuple[Key, ...]:
        """Units and ranges of the numbers of a plan, by their fields."""
        limit = float(np.asarray(self.settling.torque_limit))
        torque = Range(-limit, limit)
        return (
            number("begin", "Begin", "s", at_least=0, at_most=1e9, tunable="plan.begin"),
            number("duration", "Duration", "s", above=0, at_most=1e6, tunable="plan.duration"),
            number("attitude", "Quaternions", at_least=-1, at_most=1, tunable="plan.attitude"),
            number("rate", "Rates", "rad/s", at_least=-100, at_most=100, tunable="plan.rate"),
            number("torque", "Torques", "N m", within=torque, tunable="plan.torque"),
            number("attitude_gain", "Gains", "N m", within=ANY, tunable="plan.attitude_gain"),
            number("rate_gain", "Gains", "N m s", within=ANY, tunable="plan.rate_gain"),
        )

    def init(self, state: PlantState) -> PlanTrackingMemory:
        """The initial memory; a plan that begins with the law is ahead."""
        return PlanTrackingMemory(self.settling.init(state), jnp.array(False), jnp.array(True))

    def step(
        self, t: RealScalar, state: PlantState, memory: PlanTrackingMemory
    ) -> tuple[Pair, PlanTrackingMemory]:
        """One sample of the law of three slews, and the torque along the plan while it lasts."""
        program = program_of(self.settling, 0.0, self.plan.torque.shape[0], None)
        clock, elapsed = self.settling.clock(memory.settling), t - self.plan.begin
        prescribed = jnp.where(memory.follows, Phase.OSCILLATING, 0)
        torque, settling = self.settling.in_phase(state, memory.settling, prescribed)
        due = elapsed > -self.period / 2
        row, mean = self._now(elapsed)
        x = filtered(self.settling, program, state, settling)
        target = self._target(program, elapsed, row)
        follows = memory.follows | (memory.waits & due)
        follows = follows & due & (elapsed < self.plan.duration)
        follows = follows & (error_angle(target, x) < self.largest_error)
        error = in_hemisphere_of(target, x) - target
        feedback = row.attitude_gain @ error[:4]
        feedback = feedback + row.rate_gain @ (error[4:] / program.time_unit)
        along = clipped(mean + feedback, self.settling.torque_limit)
        torque = jnp.where(follows, self.form.command(along), torque)

        ends = memory.follows & ~follows
        far = ends & (error_angle(program.target, x) > FAR)
        fine = choose(ends & ~far, settling.fine, self.settling.fine.init(state.omega))
        phase = jnp.where(far, Phase.STOPPING, Phase.OSCILLATING)
        signs = choose(far, self.settling.rate_law.init(state), settling.signs)
        waiting = settling._replace(phase=phase, signs=signs, fine=fine, since=clock)
        settling = choose(memory.follows | follows, waiting, settling)
        return torque, PlanTrackingMemory(settling, follows, ~due)

    def _now(self, elapsed: RealScalar) -> tuple[PlanRow, Pair]:
        """The interval at a time (s) after the begin, and the mean torque (N m) of the period from
        then on, zero beyond the plan."""
        plan, count = self.plan, self.plan.torque.shape[0]
        length, until = plan.duration / count, elapsed + self.period

        def one(carry: tuple[PlanRow, Pair], row: PlanRow):
            current, mean = carry
            begin, end = row.number * length, (row.number + 1) * length
            overlap = jnp.clip(until, begin, end) - jnp.clip(elapsed, begin, end)
            current = choose(elapsed >= begin, row, current)
            return (current, mean + row.torque * (overlap / self.period)), None

        rows = PlanRow(jnp.arange(count, dtype=length.dtype), *plan[2:])
        first = jax.tree.map(lambda leaf: leaf[0], rows)
        return lax.scan(one, (first, jnp.zeros_like(first.torque)), rows)[0]

    def _target(
        self, program: Transcription, elapsed: RealScalar, row: PlanRow
    ) -> Float[Array, "7"]:
        """The plan's state (dimensionless) a time (s) after its begin, by the law's model."""
        unit, length = program.time_unit, self.plan.duration / program.intervals
        begin = row.number * length
        share = jnp.clip((elapsed - begin) / length, 0.0, 1.0)
        x, u = jnp.concatenate([row.attitude, row.rate * unit]), row.torque / program.limit
        since, first = (self.plan.begin + begin) / unit, jnp.zeros_like(share)
        return program.interval(since, first, x, share * self.plan.duration / unit, u)

    def rate_error(self, state: PlantState, memory: PlanTrackingMemory) -> Pair:
        """ω - ω_d of the law of three slews while it is active, else NaN, rad/s."""
        error = self.settling.rate_error(state, memory.settling)
        return jnp.where(memory.follows, jnp.nan, error)

    def mode(self, memory: PlanTrackingMemory) -> IntScalar:
        """The active `PlanTrackingMode`."""
        phase = self.settling.mode(memory.settling)
        return jnp.where(memory.follows, PlanTrackingMode.FOLLOWING, phase)


def program_of(
    settling: ThreeSlewSettling,
    margin: RealScalar | float,
    intervals: int,
    correction: AbstractCorrection | None,
) -> Transcription:
    """The nonlinear program of plans by the two torques of a law, by its model with a `correction`.

    Plans use 1 - `margin` of the torque limit.
    """
    limit, axes = settling.torque_limit * (1 - margin), settling.form.axes[:2].T
    objective = PlanObjective.TIME
    return Transcription(settling.form.model, axes, limit, objective, intervals, 1, correction)


def quickest_plan(
    settling: ThreeSlewSettling,
    margin: RealScalar,
    intervals: int,
    begin: RealScalar,
    state: PlantState,
) -> PlanTable:
    """The plan of least time from a state at the time `begin` (s), as a table.

    Raises `ArgumentError` if no plan arrives.
    """
    table, arrives = _searched(settling, margin, intervals, begin, state)
    if not arrives:
        raise ArgumentError("state", "must be one from which a plan to the target is found")
    return table


@eqx.filter_jit
def _searched(settling, margin, intervals: int, begin: RealScalar, state: PlantState):
    """The table of a plan, and whether it arrives."""
    program = program_of(settling, margin, intervals, None)
    pieces = PlanSearch(GUESSES, 1).most_pieces
    search = PlanSearch(GUESSES, pieces)
    first = begin / program.time_unit, program.scaled(state)
    result = search.advanced(program, search.from_guesses(search.idle(program), *first), *first)
    plan = result.iterate.unknowns
    gains = tracking_gains(program, first[0], plan, jnp.array(WEIGHTS), jnp.array(LAST_WEIGHTS))
    table = table_of(program, Guidance(plan, gains, first[0]))
    return table._replace(begin=begin), search.arrives(result)


def filtered(
    law: ThreeSlewSettling, program: Transcription, state: PlantState, memory: SettlingMemory
) -> Float[Array, "7"]:
    """The state of a plan, with s as the law's estimator has filtered it."""
    x, observer = program.scaled(state), law.estimator.observer
    if observer is None:
        return x
    s = law.form.slow(law.form.axes @ state.omega)[2]
    error = observer.believed(memory.estimator.ripple).rate - s
    return x.at[4:].add(law.form.axes[2] * (error * program.time_unit))


def error_angle(reference: Float[Array, "7"], x: Float[Array, "7"]) -> RealScalar:
    """The rotation (rad, for small ones) between the attitudes of two states of a plan."""
    difference = in_hemisphere_of(reference, x)[1:4] - reference[1:4]
    return 2 * jnp.sqrt(jnp.sum(difference**2))
