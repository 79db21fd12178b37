"""`jaxsat reproduce`: the paper's figures redrawn and its claims checked."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.computing import in_background, interruptibly, use_double_precision
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.options import Results
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.terminal import (
    FAILED_RUN,
    SUCCESS,
    output_problem,
    print_stderr,
    print_stdout,
    show_table,
)

if TYPE_CHECKING:
    import xarray as xr

    from jaxsat.report.reproduction import Claim
    from jaxsat.store import OutputFolder

COLOURS = {"HOLDS": "green", "ONLY_IF": "yellow", "FAILS": "red"}


def reproduce(
    *,
    results: Results = Results(),
) -> int:
    """Simulate the paper's section 5, draw its Figs. 3-7 and judge each of its claims.

    Parameters
    ----------
    results.out
        Output folder; by default jaxsat-reproduction.
    """
    out, quiet = results.out or Path("jaxsat-reproduction"), results.quiet
    planned = planned_report(results, out)

    from jaxsat.store import OutputError, OutputFolder

    try:
        with OutputFolder(out, kind="reproduction", overwrite=results.overwrite) as folder:
            use_double_precision()
            in_background("jaxsat.report.figures")
            datasets = _simulate_all(quiet)
            show_progress("judging claims, drawing figures")
            claims = interruptibly(lambda: _write(folder, datasets))
    except OutputError as error:
        raise output_problem(error) from None
    if not quiet:
        _print_verdicts(claims)
        print_stdout(f"written to {out}: verdicts.md, figures (PNG, SVG), trajectories (netCDF)")
    finish_report(planned, quiet=quiet)
    failed = [name for name, data in datasets.items() if data.attrs["outcome_code"] != 0]
    if failed:
        print_stderr(
            f"these runs ended early, so their claims are not reliable: {', '.join(failed)}"
        )
        return FAILED_RUN
    return SUCCESS


def _simulate_all(quiet: bool) -> "dict[str, xr.Dataset]":
    """Every run the claims need, by name, with a line a run."""
    from jaxsat.report.reproduction import RUNS
    from jaxsat.scenario import dump
    from jaxsat.scenario.build.run import build
    from jaxsat.store import trajectory_dataset

    datasets = {}
    for number, (name, run) in enumerate(RUNS.items(), start=1):
        if not quiet:
            print_stderr(f"[{number}/{len(RUNS)}] {run.purpose}", "")
        show_progress(f"simulating {name}, run {number} of {len(RUNS)}")
        scenario = load_or_explain(run.scenario, run.overrides)
        built = build(scenario)
        trajectory = interruptibly(built.simulate)
        datasets[name] = trajectory_dataset(
            trajectory,
            title=run.purpose,
            scenario=dump(scenario),
            seed=scenario.simulation.seed,
            modes=built.modes,
        )
    return datasets


def _write(folder: "OutputFolder", datasets: "dict[str, xr.Dataset]") -> "list[Claim]":
    from jaxsat.report.reproduction import judge, markdown_table, paper_figures
    from jaxsat.report.saving import save_figures
    from jaxsat.store import dataset_bytes

    claims = judge(datasets)
    heading = (
        "# Claims of Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53, section 5\n\n"
        "Found by `jaxsat reproduce`; every number comes from the runs in this folder.\n\n"
    )
    folder.write("verdicts.md", heading + markdown_table(claims))
    for name, dataset in datasets.items():
        folder.write(f"{name}.nc", dataset_bytes(dataset))
    save_figures(lambda: paper_figures(datasets), folder.write)
    return claims


def _print_verdicts(claims: "Sequence[Claim]") -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(show_lines=True, pad_edge=False, expand=True)
    for heading, ratio in (("where", 2), ("claim", 4), ("found", 8), ("verdict", 4)):
        table.add_column(heading, ratio=ratio, overflow="fold")
    for claim in claims:
        verdict = Text(claim.verdict_text, style=COLOURS[claim.verdict.name])
        table.add_row(claim.source, claim.statement, claim.found, verdict)
    show_table(table)
