"""Pareto front of time against effort, and laws beside it."""

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
from jaxsat.synthesis.execution import plain_data
from jaxsat.synthesis.optima.manoeuvre import End, Manoeuvre, ideal_thrusters, manoeuvre_of
from jaxsat.synthesis.optima.search import propagate, quickest_plans, solution_of

STRETCHES = (1.005, 1.01, 1.02, 1.05, 1.1, 1.2, 1.35, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Durations of the front over the least time."""


class FrontPoint(NamedTuple):
    """A plan on the front: duration (s) and effort ∫ Σ|T_i| dt (N m s)."""

    duration: float
    effort: float


class FlownPoint(NamedTuple):
    """A law flown from the same start: settling time (s) and effort until then (N m s).

    A law that does not settle has infinite time and NaN effort.
    """

    law: str
    settled_from: float
    effort: float


class Front(NamedTuple):
    """The front under a torque limit (N m), and the laws beside it.

    `points` begin with the least time; each takes longer than the one before and less effort.
    `failed` are the durations (s) without a plan that arrives. `end` is where plans end, laws
    settle.
    """

    torque_limit: float
    points: list[FrontPoint]
    failed: list[float]
    flown: list[FlownPoint]
    end: End = "settled"

    def as_data(self) -> dict[str, Any]:
        """Convert to plain data; None for numbers that are not finite."""
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
    """Return the least effort of the scenario's manoeuvre within each time, and laws beside it.

    The scenario has ideal thrusters with a torque limit; its own law does not matter. Plans know
    the disturbance and use the whole torque; they end within the scenario's tolerances, or exactly
    at rest. Each duration of `STRETCHES` is planned from `guesses` ways to the target and near the
    plans of the next shorter and the next longer duration. DOP853 flies every plan again; those
    that miss the target do not count. `report` receives progress. Every law of `laws` (as
    `scenario_under` takes them) flies from the same start; one that settles before every plan ends
    is itself the first point. Where no plan arrives there is no point. Raises as `manoeuvre_of` and
    `scenario_under` do.
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
    """Return the points that no other one dominates, the quickest first."""
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
    """Whether a plan, flown by DOP853, ends where the manoeuvre does."""
    if int(plan.status) == PlanStatus.FAILED:
        return False
    return propagate(manoeuvre, solution_of(plan)).arrives(manoeuvre)


def _fly(law: str, run: Run, manoeuvre: Manoeuvre) -> FlownPoint:
    """Fly a law from the scenario's start, with its torque at the saved times."""
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
    """Return the scenario saved at every sample of its law, at which alone the torque changes."""
    period = getattr(scenario.control, "period_s", None)
    return scenario if period is None else scenario.with_keys("simulation", save_every_s=period)
