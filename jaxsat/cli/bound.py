"""`jaxsat bound`: the least time or effort in which a scenario's manoeuvre can be done."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.options import End, Flag, OptionalPath, Overrides, Seed, Starts, number
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import (
    FAILED_RUN,
    SUCCESS,
    FailedRun,
    UserMistake,
    output_problem,
    print_document,
    print_stderr,
)
from jaxsat.cli.words import command_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxsat.core.tolerances import Tolerances
    from jaxsat.report.document import Document
    from jaxsat.scenario import Scenario
    from jaxsat.synthesis.bounds import Bound, Solution
    from jaxsat.synthesis.bounds.manoeuvre import Manoeuvre

Longest = Annotated[float | None, Parameter(converter=number(0.01, 1e9))]
UNITS = {"time": "s", "effort": "N m s"}


def bound(
    scenario: str,
    /,
    *,
    objective: Literal["time", "effort"] = "time",
    target: Literal["attitude", "rates"] = "attitude",
    end: End = "settled",
    starts: Starts = 12,
    longest: Longest = None,
    seed: Seed = 0,
    overrides: Overrides = (),
    out: OptionalPath = None,
    overwrite: Flag = False,
    quiet: Flag = False,
) -> int:
    """Find how fast, or with how little effort, the scenario's start can be brought to its target.

    An open-loop optimum as a reference for feedback laws: open-loop thrusts bring the spacecraft to
    where it counts as settled, or exactly to rest in the orbit frame. It is the best of several
    starts of a local search, the plans of `jaxsat.control.planning` among them, without a proof of
    optimality, and verified by an independent integrator.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with a torque limit; its control law
        does not matter.
    objective
        time, or effort: the integral of the sum of the torques' magnitudes.
    target
        attitude: rest in the orbit frame; rates: no rotation, in any attitude.
    end
        settled: within the tolerances of the scenario's [settled]; rest: exactly at rest.
    starts
        Random guesses from which the search begins.
    longest
        Longest duration in seconds; by default that of the scenario.
    seed
        Seed of the guesses.
    overrides
        KEY=VALUE that replaces a value of the scenario, as for `jaxsat simulate`.
    out
        JSON file for the thrusts, the states and the result; by default none.
    overwrite
        Replace an existing file.
    quiet
        Print only warnings and errors.
    """
    if out is not None:
        _refuse_existing(out, overwrite)
    chosen = load_or_explain(scenario, overrides, "motion")
    use_double_precision()
    rates_only, tolerances = target == "rates", tolerances_at(chosen, end)
    manoeuvre = required_manoeuvre(chosen, tolerances, rates_only=rates_only)
    from jaxsat.scenario.build.run import build_uncontrolled
    from jaxsat.synthesis.bounds import BoundObjective

    loop, beginning = build_uncontrolled(chosen)

    limit = chosen.simulation.duration_s if longest is None else longest
    _require_time(limit, "simulation.duration_s")
    what, aim = f"least {objective}", BoundObjective(objective)
    plans = [] if rates_only else planned(loop, beginning, aim, limit, tolerances, what)
    found = searched(manoeuvre, aim, starts, limit, seed, what, plans)
    if found is None:
        print_stderr(f"none of {starts} starts found a solution in {limit:g} s; give more starts")
        return FAILED_RUN
    if out is not None:
        _write(out, found, target, end_data(end, tolerances), overwrite)
    if not quiet:
        print_document(_document(chosen.title, found, objective, tolerances, rates_only))
    return SUCCESS


def _document(
    title: str,
    found: "Bound",
    objective: str,
    tolerances: "Tolerances | None",
    rates_only: bool,
) -> "Document":
    from jaxsat.report.document import Document, Facts, Verdict

    flight, unit = found.verification, UNITS[objective]
    where = f"{flight.angle:.1e} rad and {flight.rate:.1e} rad/s from rest in the orbit frame"
    if tolerances is not None:
        where = f"at {flight.tilt:.3g} rad of tilt, {flight.turn:.3g} rad of turn and "
        where += f"{flight.rate:.3g} rad/s"
    where = f"with {flight.rate:.1e} rad/s" if rates_only else where
    listed = ", ".join(f"{value:.4g}" for value in found.values)
    facts = {
        "duration": f"{found.solution.duration:.4g} s",
        "effort": f"{flight.effort:.4g} N m s",
        "end": end_text(tolerances, not rates_only),
        "flown again": f"ends {where}",
        "local optima": f"{listed} {unit}, of {found.starts} starts",
    }
    text = f"Least {objective}: {found.solution.value:.4g} {unit}, not certified."
    return Document(title, Verdict(None, text), [Facts("Best found", facts)])


def required_manoeuvre(
    scenario: "Scenario", tolerances: "Tolerances | None" = None, *, rates_only: bool = False
) -> "Manoeuvre":
    """The manoeuvre of a scenario; raises `UserMistake` for one that a bound does not support."""
    require_ideal_thrusters(scenario, "a bound")
    from jaxsat.scenario.build.run import build_uncontrolled
    from jaxsat.synthesis.bounds.manoeuvre import manoeuvre_of

    try:
        return manoeuvre_of(*build_uncontrolled(scenario), rates_only, tolerances)
    except ValueError as error:
        raise UserMistake(str(error)) from None


def tolerances_at(scenario: "Scenario", end: End) -> "Tolerances | None":
    """Those of the scenario, or None for an end exactly at rest."""
    from jaxsat.scenario.build.run import build_tolerances

    return build_tolerances(scenario) if end == "settled" else None


def end_text(tolerances: "Tolerances | None", attitude: bool = True) -> str:
    """What a manoeuvre ends at, in a line."""
    if tolerances is None:
        return "exactly at rest"
    return f"settled, {tolerances.limits_text(attitude)}"


def end_data(end: End, tolerances: "Tolerances | None") -> dict[str, Any]:
    """The same as plain data."""
    return {"end": end, "end_meaning": end_text(tolerances)}


def require_ideal_thrusters(scenario: "Scenario", what: str) -> None:
    """Raise `UserMistake` unless the scenario has limited thrusters that make any torque exactly.

    `what` needs them.
    """
    if scenario.thruster:
        raise UserMistake(
            f"thruster: must be left out for {what}, which supports only thrusters that make a "
            f"torque of either sign, got {len(scenario.thruster)}"
        )
    for kind in ("wheel", "magnetorquer"):
        if getattr(scenario, kind):
            raise UserMistake(
                f"{kind}: must be left out for {what}, which supports only thrusters that make a "
                f"torque of either sign, got {len(getattr(scenario, kind))}"
            )
    if scenario.spacecraft.torque_limit_N_m is None:
        raise UserMistake(
            "spacecraft.torque_limit_N_m: must be given in N m, as thrusters without a limit need "
            "no time, got nothing; give it with --set"
        )
    if scenario.actuators is not None:
        raise UserMistake(
            f"actuators: must be left out for {what}, which supports only thrusters that make "
            f"their torque exactly, got {scenario.actuators.kind}"
        )


def planned(
    loop: Any, start: Any, objective: Any, longest: float, tolerances: Any, what: str
) -> "list[Solution]":
    """Plans from which a search begins, told of while they are made."""
    from jaxsat.synthesis.bounds import plans_of

    show_progress(f"{what}: planning")
    return interruptibly(lambda: plans_of(loop, start, objective, longest, tolerances))


def searched(
    manoeuvre: Any,
    objective: Any,
    starts: int,
    longest: float,
    seed: int,
    what: str,
    plans: "Sequence[Solution]" = (),
) -> "Bound | None":
    """The best of several starts and plans, told of while it runs."""
    from jaxsat.synthesis.bounds import best_of_starts

    count = len(plans) + starts
    show_progress(f"{what}: start 1 of {count}")

    def told(done: int, best: float) -> None:
        known = f", {best:.4g} so far" if math.isfinite(best) else ""
        show_progress(f"{what}: {done} of {count} starts{known}")

    keys: dict[str, Any] = {"longest": longest, "seed": seed, "plans": plans, "report": told}
    try:
        return interruptibly(lambda: best_of_starts(manoeuvre, objective, starts, **keys))
    except (ValueError, ModuleNotFoundError) as error:
        raise UserMistake(str(error)) from None
    except RuntimeError as error:  # CasADi's own
        reason = (str(error).splitlines() or [type(error).__name__])[-1]
        raise FailedRun(f"{what}: CasADi cannot solve this: {reason[:200]}") from None


def _require_time(longest: float, name: str) -> None:
    from jaxsat.synthesis.bounds.transcription import MIN_DURATION_S

    if longest < MIN_DURATION_S:
        raise UserMistake(f"{name}: must be at least {MIN_DURATION_S:g} s, got {longest:g}")


def _refuse_existing(target: Path, overwrite: bool) -> None:
    from jaxsat.store import OutputError, refuse_existing

    try:
        refuse_existing(target, overwrite=overwrite)
    except OutputError as error:
        raise output_problem(error) from None


def _write(path: Path, found: "Bound", target: str, end: dict[str, Any], overwrite: bool) -> None:
    from jaxsat.store import OutputError, provenance, save_file

    solution = found.solution
    record = {
        "command": command_line(),
        "objective": found.objective.value,
        "target": target,
        **end,
        "value": solution.value,
        "duration_s": solution.duration,
        "starts": found.starts,
        "local_optima": found.values,
        "flown_again": found.verification._asdict(),
        "thrust_N_m": solution.thrust.tolist(),
        "states_quaternion_omega": solution.states.tolist(),
        **provenance(),
    }
    text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    try:
        save_file(path, text, overwrite=overwrite)
    except OutputError as error:
        raise output_problem(error) from None
