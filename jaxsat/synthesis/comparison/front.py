"""Time against effort: the least effort within each time, and what laws take of both."""

import functools
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsat.control.planning.planner import Plan, Planner, PlanStatus
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import Run, build, build_tolerances, build_uncontrolled
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.synthesis.comparison.in_scenario import scenario_under
from jaxsat.synthesis.optima.manoeuvre import End, Manoeuvre, ideal_thrusters, manoeuvre_of
from jaxsat.synthesis.optima.search import propagate, quickest_plans, solution_of
from jaxsat.synthesis.plain_data import plain_data

STRETCHES = (1.005, 1.01, 1.02, 1.05, 1.1, 1.2, 1.35, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Durations of the front over the least time."""


class FrontPoint(NamedTuple):
    """A plan of the front: its duration (s) and effort ∫ Σ|T_i| dt (N m s)."""

    duration: float
    effort: float


class FlownPoint(NamedTuple):
    """A law flown from the same start: when it settles (s), and its effort until then (N m s).

    Infinite and NaN for one that does not settle.
    """

    law: str
    settled_from: float
    effort: float


class Front(NamedTuple):
    """The front under a torque limit (N m), and the laws beside it.

    `points` begin with the least time; each takes longer than the one before it and less effort.
    `failed` are the durations (s) for which no plan arrives. `end` says where plans end, laws
    where they settle.
    """

    torque_limit: float
    points: list[FrontPoint]
    failed: list[float]
    flown: list[FlownPoint]
    end: End = "settled"

    def as_data(self) -> dict[str, Any]:
        """The front and the laws as plain data; None for what is not finite."""
        laws = [
            {"law": one.law, "settled_from_s": one.settled_from, "effort_N_m_s": one.effort}
            for one in self.flown
        ]
        record = {
            "torque_limit_N_m": self.torque_limit,
            "end": self.end,
            "front": [
                {"duration_s": one.duration, "effort_N_m_s": one.effort} for one in self.points
            ],
            "failed_durations_s": self.failed,
            "laws": laws,
        }
        return plain_data(record)


def front(
    scenario: Scenario,
    laws: Iterable[str] = (),
    guesses: int = 24,
    report: Callable[[str], None] = lambda what: None,
    end: End = "settled",
) -> Front:
    """The least effort of the scenario's manoeuvre within each time, and laws beside it.

    The scenario has ideal thrusters with a torque limit; its own law does not matter. Plans know
    the disturbance and use the whole torque; they end where laws do, within the scenario's
    tolerances, or exactly at rest. Each duration of `STRETCHES` is planned from `guesses`
    ways to the target, near the plan of the next shorter duration and near that of the next longer
    one. DOP853 flies every plan again; those that miss the target do not count. `report` receives
    what is under way. Every law of `laws` (as `scenario_under` takes them) flies from the same
    start; one that settles before every plan ends is itself the first point. Where no plan arrives
    there is no point. Raises as `manoeuvre_of` and `scenario_under` do.
    """
    runs = {law: build(_save_every_sample(scenario_under(scenario, law))) for law in laws}
    loop, start = build_uncontrolled(scenario)
    tolerances = build_tolerances(scenario) if end == "settled" else None
    manoeuvre = manoeuvre_of(loop, start, tolerances=tolerances)
    thrusters = cast(Actuators, ideal_thrusters(loop.plant))
    keys: dict[str, Any] = {"guesses": guesses, "tolerances": tolerances}
    planner = Planner(loop.plant, thrusters.torque_axes, thrusters.limit, **keys)
    report("least time")
    candidates = quickest_plans(planner, start)
    arriving = functools.partial(arrives, manoeuvre)
    quickest = min(
        filter(arriving, candidates), key=lambda plan: float(plan.duration), default=None
    )
    plans = [] if quickest is None else _cheapest(planner, start, quickest, arriving, report)
    failed_durations = [float(duration) for duration, plan in plans if plan is None]
    arrived = ([] if quickest is None else [quickest]) + [plan for _, plan in plans if plan]
    points = [FrontPoint(float(one.duration), float(one.effort)) for one in arrived]
    flights = []
    for law, run in runs.items():
        report(f"flying {law}")
        flights.append(_fly(law, run, manoeuvre))
    if points and end == "settled":
        settled = [FrontPoint(one.settled_from, one.effort) for one in flights]
        points += [one for one in settled if math.isfinite(one.duration)]
    return Front(float(thrusters.limit), _falling(points), failed_durations, flights, end)


def _falling(points: Iterable[FrontPoint]) -> list[FrontPoint]:
    """The points that no other one beats, the quickest first."""
    front: list[FrontPoint] = []
    for point in sorted(points):
        if not front or point.effort < front[-1].effort:
            front.append(point)
    return front


@eqx.filter_jit
def _plan_from_guesses(planner: Planner, start: PlantState, duration) -> Plan:
    return planner.cheapest(jnp.zeros(()), start, duration)


@eqx.filter_jit
def _plan_near(planner: Planner, start: PlantState, duration, plan: Plan) -> Plan:
    return planner.cheapest(jnp.zeros(()), start, duration, plan)


def _cheapest(
    planner: Planner,
    start: PlantState,
    quickest: Plan,
    arriving: Callable[[Plan], bool],
    report: Callable[[str], None],
) -> list[tuple[Float[np.ndarray, ""], Plan | None]]:
    """The best plan of each duration that arrives, if there is one."""
    durations = [jnp.asarray(stretch) * quickest.duration for stretch in STRETCHES]
    arriving_plans: list[list[Plan]] = []
    near = quickest
    for number, duration in enumerate(durations):
        report(f"least effort: {number} of {2 * len(durations)}")
        plans = [
            _plan_from_guesses(planner, start, duration),
            _plan_near(planner, start, duration, near),
        ]
        arriving_plans.append([plan for plan in plans if arriving(plan)])
        near = min(arriving_plans[-1], key=_effort, default=near)
    longer = None
    for number, duration in reversed(list(enumerate(durations))):
        report(f"least effort: {2 * len(durations) - number} of {2 * len(durations)}")
        if longer is not None:
            plan = _plan_near(planner, start, duration, longer)
            arriving_plans[number] += [plan] if arriving(plan) else []
        longer = min(arriving_plans[number], key=_effort, default=longer)
    best = [min(plans, key=_effort, default=None) for plans in arriving_plans]
    return [(np.asarray(one), plan) for one, plan in zip(durations, best, strict=True)]


def _effort(plan: Plan) -> float:
    return float(plan.effort)


def arrives(manoeuvre: Manoeuvre, plan: Plan) -> bool:
    """Whether a plan ends where the manoeuvre does when DOP853 flies it."""
    if int(plan.status) == PlanStatus.FAILED:
        return False
    return propagate(manoeuvre, solution_of(plan)).arrives(manoeuvre)


def _fly(law: str, run: Run, manoeuvre: Manoeuvre) -> FlownPoint:
    """A law from the scenario's start; its torque is taken at the instants that are saved."""
    run_result = run.simulate()
    settled = float(run_result.assessment.settled_from)
    if not math.isfinite(settled):
        return FlownPoint(law, settled, math.nan)
    times, torque = np.asarray(run_result.times), np.asarray(run_result.signals.torque)
    sizes = np.abs(np.linalg.lstsq(manoeuvre.torque_axes, torque.T)[0]).sum(axis=0)
    if isinstance(run.loop, SampledLoop):
        sums = np.concatenate([[0.0], np.cumsum(sizes[:-1] * np.diff(times))])
    else:
        sums = np.concatenate([[0.0], np.cumsum((sizes[1:] + sizes[:-1]) / 2 * np.diff(times))])
    return FlownPoint(law, settled, float(np.interp(settled, times, sums)))


def _save_every_sample(scenario: Scenario) -> Scenario:
    """The scenario saved at every sample of its law, whose torque changes at no other time."""
    period = getattr(scenario.control, "period_s", None)
    if period is None:
        return scenario
    simulation = scenario.simulation.model_copy(update={"save_every_s": period})
    return scenario.model_copy(update={"simulation": simulation})
