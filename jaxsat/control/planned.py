"""A manoeuvre planned in flight: search, tracking, then the end game of the law of three slews."""

import dataclasses
import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.driven_axes import DrivenFit, DrivenMemory, FittedDynamics
from jaxsat.control.handover import RippleSlack
from jaxsat.control.normal_form import clipped
from jaxsat.control.plan_tracking import (
    FAR,
    AbstractPlanLaw,
    PlanTracking,
    error_angle,
    filtered,
    program_of,
    quickest_plan,
)
from jaxsat.control.planning.search import PlanSearch, Search
from jaxsat.control.planning.tracking import Guidance, following_torque, guidance_if
from jaxsat.control.planning.transcription import STATES, Transcription
from jaxsat.control.supervisor import Phase, SettlingMemory, ThreeSlewSettling
from jaxsat.core.array_types import IntScalar, Pair, RealScalar
from jaxsat.core.checks import not_negative, positive, require_counts, require_positive
from jaxsat.core.declaration.settling import PLANNING_MARGIN, REPLAN_TIME
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

FLOWN_OUT = 0.2
"""The rest of a plan, in τ, that is flown without replanning; at least the duration of a search."""

MOST_MANOEUVRES = 6
"""Largest number of successive plans from all guesses without a lasting hold."""

RIPPLE_SLACK = (1.0, 3.0, 3.0)
"""Slack on the slow rate of a hold, at its begin and during it, relative to the expected ripple,
and its duration, in radians of the ripple."""

RATE_NOISE = 2.5e-4
"""Noise of the rates in the fit of the driven axes, rad per τ."""


class PlannedMode(enum.IntEnum):
    """The active mode. STOPPING and SLEWING are active only after a failed plan."""

    STOPPING = Phase.STOPPING.value
    SLEWING = Phase.SLEWING.value
    OSCILLATING = Phase.OSCILLATING.value
    HOLDING = Phase.HOLDING.value
    PLANNING = 5
    FOLLOWING = 6

    @property
    def label(self) -> str:
        """The name of the mode for people."""
        fallback = self in (PlannedMode.STOPPING, PlannedMode.SLEWING)
        return f"plan failed {self.name.lower()}" if fallback else self.name.lower()


SETTLING = 0
"""Value of `PlannedMemory.stage` while the law of three slews is active, in any phase."""


class PlannedMemory(NamedTuple):
    """Memories of the law of three slews and of the search, and the tracked plan.

    `stage` is PLANNING, FOLLOWING or `SETTLING`, `failures` the number of failed plans,
    `manoeuvres` that of plans since the last hold, `search_begin` the time in units of τ at which
    the last search began, negative before the first.
    """

    settling: SettlingMemory
    driven: DrivenMemory
    search: Search
    guidance: Guidance
    stage: IntScalar
    failures: IntScalar
    manoeuvres: IntScalar
    search_begin: RealScalar


class PlannedSettling(AbstractPlanLaw):
    """Plans the fastest manoeuvre in flight, tracks it, and settles the remaining errors.

    During the search for the first plan, of at most `search.most_pieces` periods, the body coasts.
    The plan begins `search.closing_pieces` periods after the choice of the best guess, in the state
    that the model predicts for that time. Plans use 1 - `margin` of the torque limit, feedback
    along the plan (`jaxsat.control.planning.tracking`) all of it. Every `replan` seconds a search
    from the measured state begins near the current plan, which is tracked until the new one is
    ready; the end of a plan is flown unchanged. If the plan misses the target, as with an
    inaccurate model, another manoeuvre is planned. Then `settling`, the law of three slews,
    oscillates and holds. If no plan arrives, that law does everything, and the failure counts. When
    the end game loses the attitude a new manoeuvre is planned. No sample takes more than
    `search.iterations` iterations of the planner. A plan has `intervals` intervals.

    Raises `ArgumentError` for numbers out of range.
    """

    modes: ClassVar[type[enum.IntEnum]] = PlannedMode
    no_flight_code: ClassVar[str | None] = "it plans in flight; flight code has its tracker"

    settling: ThreeSlewSettling
    driven: DrivenFit
    replan: RealScalar = eqx.field(converter=positive("replan"))
    margin: RealScalar = eqx.field(converter=not_negative("margin"), default=PLANNING_MARGIN)
    search: PlanSearch = PlanSearch()
    intervals: int = eqx.field(static=True, default=32)

    def __check_init__(self):
        require_counts(intervals=self.intervals)
        require_positive("1 - margin", 1 - self.margin)

    def program(self, settling: SettlingMemory, driven: DrivenMemory) -> Transcription:
        """The nonlinear program of the plans: torques about x and y, the dynamics as estimated."""
        fit, correction = settling.estimator.fit, None
        if fit is not None:
            errors = self.driven.believed(driven)
            correction = FittedDynamics(self.form, self.driven, fit.estimate, errors)
        return program_of(self.settling, self.margin, self.intervals, correction)

    def flight_law(self, start: PlantState, begin: float = 0.0) -> PlanTracking:
        """The tracker of a plan from `start` at the time `begin` (s).

        Raises `ArgumentError` if no plan arrives.
        """
        sizes = self.margin, self.intervals
        plan = quickest_plan(self.settling, *sizes, jnp.asarray(begin, start.omega.dtype), start)
        return PlanTracking(self.settling, plan)  # pyright: ignore[reportCallIssue]

    def init(self, state: PlantState) -> PlannedMemory:
        """The initial memory, without a plan."""
        zero = jnp.zeros_like(state.omega[0])
        settling = self.settling.init(state)._replace(phase=jnp.array(Phase.OSCILLATING))
        driven = self.driven.init(self.form.slow(self.form.axes @ state.omega))
        search = self.search.idle(self.program(settling, driven))
        gains = jnp.zeros((self.intervals, 2, STATES), state.omega.dtype)
        none = jnp.array(0)
        idle = Guidance(search.best._replace(duration=zero + 1), gains, zero)
        return PlannedMemory(settling, driven, search, idle, none, none, none, zero - 1)

    def step(
        self, t: RealScalar, state: PlantState, memory: PlannedMemory
    ) -> tuple[Pair, PlannedMemory]:
        """One sample of the law of three slews, one piece of the search, and the torque."""
        driven = self.driven.sampled(t, state, memory.driven, self.period)
        program, stage = self.program(memory.settling, driven), memory.stage
        law_phase = jnp.where(stage == SETTLING, SETTLING, Phase.OSCILLATING)
        t = self.settling.clock(memory.settling)
        torque, settling = self.settling.in_phase(state, memory.settling, law_phase)
        now, x = t / program.time_unit, filtered(self.settling, program, state, settling)
        settles = (stage == SETTLING) & (memory.settling.phase == Phase.OSCILLATING)
        loss = settles & (settling.phase == Phase.STOPPING)
        slips = settles & memory.settling.fine.late & ~settling.fine.late
        over = stage == PlannedMode.FOLLOWING
        over = over & (now > memory.guidance.begin + memory.guidance.plan.duration)
        misses = slips | (over & ~settling.fine.late)
        misses = misses & (memory.manoeuvres < MOST_MANOEUVRES)
        begins = loss | misses | (memory.search_begin < 0)
        holds = (stage == SETTLING) & (self.settling.mode(settling) == Phase.HOLDING)
        holds = holds & (t - settling.since > self.settling.patience)
        manoeuvres = jnp.where(holds, 0, memory.manoeuvres) + jnp.where(begins, 1, 0)
        stage = jnp.where(over, SETTLING, stage)
        stage = jnp.where(begins, PlannedMode.PLANNING, stage)

        begin, ahead = self._ahead(program, now, x, begins, stage)
        search, search_begin = self._next_search(program, now, x, memory, begins, (begin, ahead))
        ends = ~self.search.over(search)
        search = self.search.advanced(program, search, begin, ahead)
        ends = ends & self.search.over(search)
        arrives = ends & self.search.arrives(search)
        fails = ends & ~arrives & (stage == PlannedMode.PLANNING)
        plan, begin = search.iterate.unknowns, search.begin
        guidance = guidance_if(program, arrives, plan, begin, memory.guidance)
        stage = jnp.where(arrives, PlannedMode.FOLLOWING, stage)
        stage = jnp.where(fails, SETTLING, stage)

        following = following_torque(program, now, x, guidance, self.period / program.time_unit)
        following = clipped(following * program.limit, self.settling.torque_limit)
        following = self.form.command(following)
        torque = jnp.where(stage == PlannedMode.FOLLOWING, following, torque)
        torque = jnp.where(stage == PlannedMode.PLANNING, 0.0, torque)
        far = error_angle(program.target, x) > FAR
        phase = jnp.where(fails & far, Phase.STOPPING, Phase.OSCILLATING)
        fine = choose(over & ~misses, settling.fine, self.settling.fine.init(state.omega))
        waiting = settling._replace(phase=phase, fine=fine, since=t + 0 * settling.since)
        settling = choose((stage != SETTLING) | over | fails, waiting, settling)
        failures = memory.failures + jnp.where(fails, 1, 0)
        progress = (stage, failures, manoeuvres, search_begin)
        driven = driven._replace(torque=self.form.to_command.T @ torque)
        return torque, PlannedMemory(settling, driven, search, guidance, *progress)

    def _ahead(
        self, program: Transcription, now: RealScalar, x, begins, stage: IntScalar
    ) -> tuple[RealScalar, Float[Array, "7"]]:
        """Time and state, after coasting, at which a plan of the current search begins.

        The best guess is improved from there; the guesses begin after half of the longest search.
        """
        halfway, closing = (self.search.most_pieces + 1) // 2, self.search.closing_pieces
        periods = jnp.where(stage == PlannedMode.PLANNING, jnp.where(begins, halfway, closing), 0)
        period, most = self.period / program.time_unit, max(halfway, closing)
        return now + periods * period, program.coasted(now, x, period, periods, most)

    def _next_search(
        self, program: Transcription, now: RealScalar, x, memory: PlannedMemory, begins, first
    ) -> tuple[Search, RealScalar]:
        """The search, which may now restart from all guesses or from the rest of the plan.

        `first` are time and state at the begin of a plan from all guesses.
        """
        plan, begin = memory.guidance.plan, memory.guidance.begin
        closing = self.search.most_closing_pieces * self.period / program.time_unit
        again = (memory.stage == PlannedMode.FOLLOWING) & self.search.over(memory.search)
        again = again & (now - memory.search_begin > self.replan / program.time_unit)
        again = again & (now > begin)
        again = again & (begin + plan.duration - now > jnp.maximum(FLOWN_OUT, closing))
        anew = self.search.from_guesses(memory.search, *first)
        near = self.search.near(program, memory.search, now, x, plan, now - begin)
        search = choose(begins, anew, choose(again, near, memory.search))
        return search, jnp.where(begins | again, now, memory.search_begin)

    def rate_error(self, state: PlantState, memory: PlannedMemory) -> Pair:
        """ω - ω_d of the law of three slews while it is active, else NaN, rad/s."""
        error = self.settling.rate_error(state, memory.settling)
        return jnp.where(memory.stage == SETTLING, error, jnp.nan)

    def mode(self, memory: PlannedMemory) -> IntScalar:
        """The active `PlannedMode`."""
        phase = self.settling.mode(memory.settling)
        return jnp.where(memory.stage == SETTLING, phase, memory.stage)


def planned_settling(settling: ThreeSlewSettling) -> PlannedSettling:
    """The planning law, from a law of three slews for the same spacecraft."""
    ripple = settling.estimator.observer
    if ripple is not None:
        enter, stay, grace = RIPPLE_SLACK
        times = enter * ripple.amplitude, stay * ripple.amplitude, grace / ripple.frequency
        handover = dataclasses.replace(settling.fine.handover, slack=RippleSlack(*times))
        fine = dataclasses.replace(settling.fine, handover=handover)
        settling = dataclasses.replace(settling, fine=fine)
    moments = settling.form.model.spacecraft.moments
    unit = jnp.sqrt(jnp.mean(moments) / settling.torque_limit)
    driven = DrivenFit(settling.form, settling.torque_limit, RATE_NOISE / unit)
    replan = REPLAN_TIME * unit
    return PlannedSettling(settling, driven, replan)  # pyright: ignore[reportCallIssue]
