"""Least time or effort of a scenario's manoeuvre in one call: `bound`."""

import math
from collections.abc import Callable
from typing import Any, Literal

from jaxsat.core.declaration.actuators import PARTS
from jaxsat.core.errors import JaxsatError
from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build_tolerances, build_uncontrolled
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.synthesis.optima.manoeuvre import End, Manoeuvre, manoeuvre_of
from jaxsat.synthesis.optima.search import Bound, best_of_starts, plans_of
from jaxsat.synthesis.optima.transcription import SHORTEST, BoundObjective

Report = Callable[[str], None]
"""Callback for progress messages."""


class UnsuitableScenario(JaxsatError, ValueError):
    """A scenario without a computable bound or front; the message names its key.

    `lacking` says that the key is missing and may be given.
    """

    lacking: bool

    def __init__(self, message: str, *, lacking: bool = False):
        super().__init__(message)
        self.lacking = lacking


class UnsolvedBound(JaxsatError):
    """A manoeuvre for which CasADi fails."""

    failure = True


def bound(
    scenario: Scenario,
    objective: Literal["time", "effort"] = "time",
    *,
    target: Literal["attitude", "rates"] = "attitude",
    end: End = "settled",
    starts: int = 12,
    longest: float | None = None,
    seed: int = 0,
    report: Report = lambda what: None,
) -> Bound | None:
    """Return the least time (s) or effort (N m s) from a scenario's start to its target, or None.

    None means that no start of the search arrives. The scenario has a torque limit and ideal
    thrusters; its law does not matter. The `target` is rest in the orbit
    frame, or "rates" alone; the manoeuvre ends within the scenario's tolerances, or exactly there.
    `longest` (s) bounds the duration, by default the scenario's. Raises `UnsuitableScenario`,
    `UnsolvedBound`, and `ModuleNotFoundError` without CasADi.
    """
    rates_only, tolerances = target == "rates", tolerances_at(scenario, end)
    manoeuvre = required_manoeuvre(scenario, tolerances, rates_only=rates_only)
    longest = scenario.simulation.duration_s if longest is None else longest
    shortest = SHORTEST * manoeuvre.time_unit()
    if longest < shortest:
        raise UnsuitableScenario(
            f"simulation.duration_s: must be at least {shortest:.3g} s, got {longest:g}"
        )
    return search_bound(
        None if rates_only else build_uncontrolled(scenario),
        manoeuvre,
        BoundObjective(objective),
        tolerances,
        starts=starts,
        longest=longest,
        seed=seed,
        report=report,
    )


def search_bound(
    problem: tuple[AbstractLoop, PlantState] | None,
    manoeuvre: Manoeuvre,
    objective: BoundObjective,
    tolerances: Tolerances | None,
    *,
    starts: int,
    longest: float,
    seed: int,
    report: Report,
) -> Bound | None:
    """Return the best of several starts, and of the plans for the `problem`, a loop and its start.

    Raises `UnsolvedBound`.
    """
    what = f"least {objective.value}"
    report(f"{what}: planning")
    plans = plans_of(*problem, objective, longest, tolerances) if problem else []
    count = len(plans) + starts
    report(f"{what}: start 1 of {count}")

    def report_starts(start_count: int, best: float) -> None:
        least_so_far = f", {best:.4g} so far" if math.isfinite(best) else ""
        report(f"{what}: {start_count} of {count} starts{least_so_far}")

    keys: dict[str, Any] = {
        "longest": longest,
        "seed": seed,
        "plans": plans,
        "report": report_starts,
    }
    try:
        return best_of_starts(manoeuvre, objective, starts, **keys)
    except RuntimeError as error:  # CasADi's own
        reason = (str(error).splitlines() or [type(error).__name__])[-1]
        raise UnsolvedBound(f"{what}: CasADi cannot solve this: {reason[:200]}") from error


def required_manoeuvre(
    scenario: Scenario, tolerances: Tolerances | None = None, *, rates_only: bool = False
) -> Manoeuvre:
    """Return a scenario's manoeuvre; raises `UnsuitableScenario` for one without bound."""
    require_ideal_thrusters(scenario, "a bound")
    loop, start = build_uncontrolled(scenario)
    try:
        return manoeuvre_of(loop, start, rates_only, tolerances)
    except ValueError as error:
        raise UnsuitableScenario(str(error)) from None


def require_ideal_thrusters(scenario: Scenario, what: str) -> None:
    """Raise `UnsuitableScenario` without limited ideal thrusters, which `what` needs."""
    names = [one.name for one in PARTS]
    counts = {kind: len(getattr(scenario, kind)) for kind in names}
    for kind, count in counts.items():
        if count:
            raise UnsuitableScenario(
                f"{kind}: must be left out for {what}, which supports only ideal thrusters, the "
                f"rows of spacecraft.thruster_torque_axes, got {count}"
            )
    in_flight = [one.of for one in scenario.failure if not one.of_sensor]
    if in_flight:
        raise UnsuitableScenario(
            f"failure: must be left out for {what}, in which no thruster fails in flight; one that "
            f"has failed before is in spacecraft.failed_thrusters, got {', '.join(in_flight)}"
        )
    if scenario.spacecraft.torque_limit_N_m is None:
        raise UnsuitableScenario(
            "spacecraft.torque_limit_N_m: must be given in N m, as thrusters without a limit need "
            "no time, got nothing",
            lacking=True,
        )
    if scenario.actuators is not None:
        raise UnsuitableScenario(
            f"actuators: must be left out for {what}, which supports only thrusters that make "
            f"their torque exactly, got {scenario.actuators.kind}"
        )


def tolerances_at(scenario: Scenario, end: End) -> Tolerances | None:
    """Return the tolerances of the scenario, or None for an end exactly at rest."""
    return build_tolerances(scenario) if end == "settled" else None


def end_text(tolerances: Tolerances | None, attitude: bool = True) -> str:
    """Describe the end of a manoeuvre."""
    if tolerances is None:
        return "exactly at rest"
    return f"settled, {tolerances.limits_text(attitude)}"


def end_data(end: End, tolerances: Tolerances | None) -> dict[str, Any]:
    """Return the end of a manoeuvre, with its description, as plain data."""
    return {"end": end, "end_meaning": end_text(tolerances)}
