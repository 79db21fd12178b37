"""`jaxsat bound`: the least time or effort of a scenario's manoeuvre."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import End, Output, Overrides, Seed, Starts, number
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import FAILED_RUN, SUCCESS, UserMistake, print_document, print_stderr

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario
    from jaxsat.synthesis.optima.run import UnsuitableScenario
    from jaxsat.synthesis.optima.search import Bound

Longest = Annotated[float | None, Parameter(converter=number(0.01, 1e9))]
Objective = Literal["time", "effort"]
Target = Literal["attitude", "rates"]


def bound(
    scenario: str,
    /,
    *,
    objective: Objective = "time",
    target: Target = "attitude",
    end: End = "settled",
    starts: Starts = 12,
    longest: Longest = None,
    seed: Seed = 0,
    overrides: Overrides = (),
    output: Output = Output(),
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
    output.out
        JSON file for the thrusts, the states and the result; by default none.
    output.overwrite
        Replace an existing file.
    """
    from jaxsat.store.files import refuse_existing

    if output.out is not None:
        refuse_existing(output.out, overwrite=output.overwrite)
    chosen = load_scenario(scenario, overrides, "motion")
    best = _best(
        chosen, objective, target=target, end=end, starts=starts, longest=longest, seed=seed
    )
    if best is None:
        limit = chosen.simulation.duration_s if longest is None else longest
        print_stderr(f"none of {starts} starts found a solution in {limit:g} s; give more starts")
        return FAILED_RUN
    from jaxsat.report.front import bound_document
    from jaxsat.synthesis.optima.run import end_text, tolerances_at

    meaning = end_text(tolerances_at(chosen, end), target == "attitude")
    record = {"target": target, "end": end, "end_meaning": meaning, **best.as_data()}
    if output.out is not None:
        _write(output.out, record, output.overwrite)
    if not output.quiet:
        print_document(bound_document(chosen.title, record))
    return SUCCESS


def _best(scenario: "Scenario", objective: Objective, **keys: Any) -> "Bound | None":
    """Return the bound from the library; its errors become mistakes and failures."""
    import jaxsat
    from jaxsat.synthesis.optima.run import UnsuitableScenario

    try:
        return interruptibly(
            lambda: jaxsat.bound(scenario, objective, report=show_progress, **keys)
        )
    except UnsuitableScenario as error:
        raise unsuitable(error) from None
    except (ValueError, ModuleNotFoundError) as error:
        raise UserMistake(str(error)) from None


def unsuitable(error: "UnsuitableScenario") -> UserMistake:
    """Return the mistake for a scenario that cannot be bounded, with the option that may help."""
    return UserMistake(f"{error}; give it with --set" if error.lacking else str(error))


def _write(path: Path, data: dict[str, Any], overwrite: bool) -> None:
    from jaxsat.store.files import save_file
    from jaxsat.store.provenance import record_of

    text = json.dumps(record_of(data), indent=1, allow_nan=False) + "\n"
    save_file(path, text, overwrite=overwrite)
