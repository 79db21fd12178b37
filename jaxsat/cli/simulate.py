"""`jaxsat simulate`: run one scenario and write its results."""

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

    from matplotlib.figure import Figure

    from jaxsat.scenario import Scenario
    from jaxsat.store.folder import OutputFolder
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

    from jaxsat.scenario.resolution import excessive_error
    from jaxsat.store.folder import OutputFolder

    output_folder = OutputFolder(target, kind="run", overwrite=results.overwrite)
    with output_folder as folder:
        show_progress(f"simulating {scenario}")
        remarks: list[str] = []
        begin = time.perf_counter()
        chosen, dataset = interruptibly(lambda: _simulated(chosen, remarks.append), brief=True)
        seconds = time.perf_counter() - begin
        show_progress("drawing figures")
        interruptibly(lambda: _write(folder, chosen, dataset), brief=True)
        files = folder.names
    from jaxsat.store.dataset import coarseness, errors_of

    for warning in (coarseness(dataset), excessive_error(errors_of(dataset), chosen)):
        if warning:
            print_warning(warning)
    for remark in dict.fromkeys(remarks):
        print_stderr(remark, "")
    if not results.quiet:
        from jaxsat.report.run_document import run_document

        print_document(run_document(dataset))
        print_stdout(f"{seconds:.1f} s with compilation; written to {target}: {', '.join(files)}")
    finish_report(report, quiet=results.quiet)
    if dataset.attrs["outcome_code"] == 0:
        return SUCCESS
    print_stderr(f"{failure_advice(dataset)}; the results so far were written to {target}")
    return FAILED_RUN


def _simulated(
    scenario: "Scenario", tell: "Callable[[str], None]"
) -> tuple["Scenario", "LabelledArrays"]:
    from jaxsat.scenario.build.datasets import simulated_finely

    return simulated_finely(scenario, tell)


def _write(folder: "OutputFolder", scenario: "Scenario", dataset: "LabelledArrays") -> None:
    record = json.dumps(_record(scenario, dataset), indent=2, ensure_ascii=False)
    folder.write("run.json", record + "\n")
    write_trajectory(folder, dataset)


def write_trajectory(folder: "OutputFolder", dataset: "LabelledArrays") -> None:
    """Write the scenario of a trajectory, the trajectory and its figures."""
    from jaxsat.report.saving import save_figures
    from jaxsat.store.netcdf import dataset_bytes

    def figures() -> "dict[str, Figure]":
        from jaxsat.report.figures import trajectory_figures  # `save_figures` imports matplotlib

        return trajectory_figures(dataset)

    folder.write("scenario.toml", dataset.attrs["scenario"])
    folder.write("trajectory.nc", dataset_bytes(dataset))
    save_figures(figures, folder.write)


def _record(scenario: "Scenario", dataset: "LabelledArrays") -> dict[str, Any]:
    from jaxsat.store.provenance import command_line, provenance

    return {
        "title": scenario.title,
        "command": command_line(),
        "outcome": dataset.attrs["outcome"],
        "seed": scenario.simulation.seed,
        **provenance(),
    }


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
