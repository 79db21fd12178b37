"""`jaxsat simulate`: run one scenario and write its results."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import Overrides, Results
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.terminal import (
    FAILED_RUN,
    SUCCESS,
    print_document,
    print_stderr,
    print_stdout,
    print_warning,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from jaxsat.report.results import Flight
    from jaxsat.scenario import Scenario
    from jaxsat.store.labelled import LabelledArrays

ADVICE = {
    "STATE_LIMIT": 'check gains and initial state, and use simulation.attitude = "quaternion" '
    "where the body turns upside down",
    "MAX_STEPS": "in [simulation.solver], with adaptive steps, raise max_steps, loosen rtol and "
    "atol, or set min_step_s; with fixed steps, raise step_s",
    "STEP_UNDERFLOW": "set simulation.solver.min_step_s to pass points where the law has a corner",
}
"""Advice after a run that did not reach its end, by its outcome."""


def simulate(scenario: str, /, *, overrides: Overrides = (), results: Results = Results()) -> int:
    """Simulate a scenario and write its trajectory, figures and settings to a folder.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file.
    """
    chosen = load_scenario(scenario, overrides)
    target = results.out or Path(f"jaxsat-{Path(scenario).stem}")
    report = planned_report(results, target)

    from jaxsat.store.folder import OutputFolder

    output_folder = OutputFolder(target, kind="run", overwrite=results.overwrite)
    with output_folder as folder:
        show_progress(f"simulating {scenario}")
        remarks: list[str] = []
        begin = time.perf_counter()
        flight = interruptibly(lambda: _flight(chosen, remarks.append), brief=True)
        seconds = time.perf_counter() - begin
        show_progress("drawing figures")
        interruptibly(lambda: flight.write(folder), brief=True)
        files = folder.names
    for caution in flight.cautions:
        print_warning(caution)
    for remark in dict.fromkeys(remarks):
        print_stderr(remark, "")
    if not results.quiet:
        print_document(flight.document)
        print_stdout(f"{seconds:.1f} s with compilation; written to {target}: {', '.join(files)}")
    finish_report(report, quiet=results.quiet)
    dataset = flight.arrays
    if dataset.attrs["outcome_code"] == 0:
        return SUCCESS
    print_stderr(f"{failure_advice(dataset)}; the results so far were written to {target}")
    return FAILED_RUN


def _flight(scenario: "Scenario", tell: "Callable[[str], None]") -> "Flight":
    from jaxsat.report.results import fly

    return fly(scenario, tell)


def failure_advice(dataset: "LabelledArrays") -> str:
    """Return the outcome of a run that ended early, and advice."""
    import numpy as np

    good = np.isfinite(dataset["omega"].values).all(axis=1)
    end = float(dataset["time"].values[good][-1]) if good.any() else 0.0
    outcome = dataset.attrs["outcome"]
    return (
        f"the run ended early, after t = {end:g} s ({dataset.attrs['outcome_explanation']}); "
        f"{ADVICE[outcome]}"
    )
