"""`jaxsat reproduce`: the paper's figures redrawn and its claims checked."""

from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import Results
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.terminal import FAILED_RUN, SUCCESS, print_document, print_stderr, print_stdout

if TYPE_CHECKING:
    import xarray as xr

    from jaxsat.report.document import Document
    from jaxsat.store.folder import OutputFolder


def reproduce(*, results: Results = Results()) -> int:
    """Simulate the paper's section 5, draw its Figs. 3-7 and judge each of its claims.

    Parameters
    ----------
    results.out
        Output folder; by default jaxsat-reproduction.
    """
    out, quiet = results.out or Path("jaxsat-reproduction"), results.quiet
    report = planned_report(results, out)

    from jaxsat.store.folder import OutputFolder

    with OutputFolder(out, kind="reproduction", overwrite=results.overwrite) as folder:
        use_double_precision()
        datasets = _simulate_all(quiet)
        show_progress("judging claims, drawing figures")
        document = interruptibly(lambda: _write(folder, datasets))
    if not quiet:
        print_document(document)
        print_stdout(f"written to {out}: verdicts.md, figures (PNG, SVG), trajectories (netCDF)")
    finish_report(report, quiet=quiet)
    failed_runs = [name for name, data in datasets.items() if data.attrs["outcome_code"] != 0]
    if failed_runs:
        print_stderr(
            f"these runs ended early, so their claims are not reliable: {', '.join(failed_runs)}"
        )
        return FAILED_RUN
    return SUCCESS


def _simulate_all(quiet: bool) -> "dict[str, xr.Dataset]":
    from jaxsat.report.reproduction import RUNS
    from jaxsat.scenario.build.datasets import simulated

    datasets = {}
    for number, (name, run) in enumerate(RUNS.items(), start=1):
        if not quiet:
            print_stderr(f"[{number}/{len(RUNS)}] {run.purpose}", "")
        show_progress(f"simulating {name}, run {number} of {len(RUNS)}")
        scenario = load_scenario(run.scenario, run.overrides)
        dataset = interruptibly(lambda scenario=scenario: simulated(scenario)).dataset()
        datasets[name] = dataset.assign_attrs(title=run.purpose)
    return datasets


def _write(folder: "OutputFolder", datasets: "dict[str, xr.Dataset]") -> "Document":
    from jaxsat.report.printers import markdown_page
    from jaxsat.report.reproduction import claims_document, judge
    from jaxsat.report.reproduction.figures import paper_figures
    from jaxsat.report.saving import save_figures
    from jaxsat.store.netcdf import dataset_bytes

    document = claims_document(judge(datasets))
    folder.write("verdicts.md", markdown_page(document))
    for name, dataset in datasets.items():
        folder.write(f"{name}.nc", dataset_bytes(dataset))
    save_figures(lambda: paper_figures(datasets), folder.write)
    return document
