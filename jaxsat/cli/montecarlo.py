"""`jaxsat montecarlo`: dispersed copies of a scenario into a store, or one case recomputed."""

import contextlib
import itertools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.listening import progress_text, require_approval
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import (
    Case,
    Cases,
    Instants,
    OptionalPath,
    OptionalSeed,
    Overrides,
    Resumable,
    Text,
)
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import PlannedReport, finish_report, planned_report
from jaxsat.cli.study_executors import Sharing, chosen_executor
from jaxsat.cli.study_files import (
    figures_folder,
    refuse_csv,
    refuse_nested,
    try_folder,
    write_csv,
    write_figures,
    write_one_case,
)
from jaxsat.cli.terminal import (
    SUCCESS,
    UserMistake,
    print_document,
    print_stderr,
    print_stdout,
    print_warning,
)
from jaxsat.core.errors import LibraryError

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario
    from jaxsat.studies.ensemble import Study
    from jaxsat.studies.executors import AbstractExecutor
    from jaxsat.studies.statistics import StopRule


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Saved:
    """Outputs of a study besides its store.

    Parameters
    ----------
    figures
        Folder for figures: settling times, where cases settle, convergence, fan charts of attitude
        and rates.
    csv
        CSV file of the cases, one row each: outcome, times, effort, final state and drawn values.
        Column names contain the units.
    history
        Save attitude, rates and torque of every case at this number of instants, evenly spaced over
        the horizon.
    """

    figures: OptionalPath = None
    csv: OptionalPath = None
    history: Instants = None

    def places(self) -> list[tuple[str, Path]]:
        """Return the requested files and folders, each after the name of its option."""
        options = (("--figures", self.figures), ("--csv", self.csv))
        return [(option, place) for option, place in options if place is not None]


def montecarlo(
    scenario: str,
    /,
    *,
    count: Cases = 1000,
    seed: OptionalSeed = None,
    overrides: Overrides = (),
    until_ci: Text = None,
    case: Case = None,
    controller: OptionalPath = None,
    saved: Saved = Saved(),
    sharing: Sharing = Sharing(),
    results: Resumable = Resumable(),
) -> int:
    """Simulate many dispersed copies of a scenario, as its [dispersion] table says.

    The same command resumes an interrupted run: an existing store of the same study is completed.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file.
    count
        Number of cases.
    seed
        Seed of the study; by default that of the scenario.
    until_ci
        Stop when the half width of the interval of the settled fraction is below this, such as
        0.5%.
    case
        Recompute this case alone and write its whole trajectory.
    controller
        Library that `make` built in the folder of `jaxsat export`: its C code replaces law and
        estimator, in threads of this process.
    results.out
        Zarr store of the results, by default jaxsat-NAME.zarr; with --case a folder for the
        trajectory.
    results.engine
        native: machine code compiled for the scenario, fastest; scan: a plain loop in XLA; diffrax:
        the method of a single run; auto: native; it prints a line if it has to use scan.
    results.workers
        Threads of each process, each of which computes one chunk. The default, also the maximum, is
        the number of processors, divided by the number of processes.
    results.overwrite
        Replace the files of --csv and --report, or with --case the folder, if jaxsat wrote it; a
        store is resumed.
    results.report
        Also write a report, as `jaxsat report` does: next to the store, with .html in place of
        .zarr, or the given file; with --case report.html in its folder.
    """
    _refuse_contradictions(case, controller, saved, sharing, results)
    suffix = ".zarr" if case is None else f"-{case}"
    target = results.out or Path(f"jaxsat-{Path(scenario).stem}{suffix}")
    report = _plan_report(target, saved, results, store=case is None)
    chosen = load_scenario(scenario, overrides, "study")
    rule = None if until_ci is None else _stop_rule(until_ci)
    chosen, study = _build_study(
        chosen,
        count,
        results.quiet,
        seed=seed,
        engine=results.engine,
        batch_size=sharing.batch_size,
        chunk=sharing.chunk,
        history=saved.history,
        controller=controller,
    )
    if study.remark is not None and not results.quiet:
        print_stderr(study.remark, "")
    if rule is not None and study.has_fixed_size:
        raise UserMistake("--until-ci: must be given with a design other than latin-hypercube")
    if case is None:
        _write_study(chosen, study, target, rule, saved, sharing, results)
    else:
        overwrite, quiet = results.overwrite, results.quiet
        write_one_case(chosen, study, case, target, overwrite=overwrite, quiet=quiet)
    finish_report(report, quiet=results.quiet)
    return SUCCESS


def _refuse_contradictions(
    case: int | None, controller: Path | None, saved: Saved, sharing: Sharing, results: Resumable
) -> None:
    if case is not None and saved.figures is not None:
        raise UserMistake("--case: must be given without --figures, which show a whole study")
    if case is not None and saved.csv is not None:
        raise UserMistake("--case: must be given without --csv, which has all cases of a study")
    if case is None and saved.csv is None and results.report is False and results.overwrite:
        raise UserMistake(
            "--overwrite: must be given with --case, --csv or --report; a store is resumed"
        )
    if controller is not None and (sharing.processes or sharing.scheduler or sharing.devices):
        raise UserMistake(
            "--controller: must be given without --processes, --scheduler and --devices"
        )


def _plan_report(
    target: Path, saved: Saved, results: Resumable, *, store: bool
) -> PlannedReport | None:
    """Return the requested report; raises `UserMistake` for places that cannot be written to."""
    for one, other in itertools.combinations([*saved.places(), ("--out", target)], 2):
        refuse_nested(one, other)
    if saved.csv is not None:
        refuse_csv(saved.csv, overwrite=results.overwrite)
    if saved.figures is not None:
        folder = saved.figures
        try_folder(lambda: figures_folder(folder))
    return planned_report(results, target, store=store)


def _build_study(
    scenario: "Scenario", count: int, quiet: bool, **keys: Any
) -> tuple["Scenario", "Study"]:
    from jaxsat.scenario.build.study import refined_study

    show_progress("compiling")
    tell = (lambda text: None) if quiet else (lambda text: print_stderr(text, ""))
    try:
        return interruptibly(lambda: refined_study(scenario, count, tell, **keys))
    except LibraryError as error:
        raise UserMistake(f"--controller: {error}") from None
    except ValueError as error:
        raise UserMistake(str(error)) from None


def _write_study(
    scenario: "Scenario",
    study: "Study",
    target: Path,
    rule: "StopRule | None",
    saved: Saved,
    sharing: Sharing,
    results: Resumable,
) -> None:
    """Run the study into its store; write and print the requested outputs."""
    from jaxsat.scenario.resolution import excessive_error
    from jaxsat.store.ledger import study_columns
    from jaxsat.studies.summary import summarise
    from jaxsat.studies.work import study_work

    executor = chosen_executor(
        results.workers, sharing.processes, sharing.scheduler, sharing.devices
    )
    work = study_work(study, rule, executor.at_once)
    require_approval([work], target, yes=results.yes, quiet=results.quiet)
    try:
        count = _run(study, target, executor, rule, results.elsewhere)
        show_progress("summarising")
        summary = interruptibly(lambda: summarise(study_columns(target), count))
        if saved.figures is not None:
            show_progress("drawing figures")
            write_figures(saved.figures, scenario.title, study, target, summary)
        if saved.csv is not None:
            show_progress("writing the table")
            write_csv(saved.csv, target, count, overwrite=results.overwrite)
    except KeyboardInterrupt as stop:
        with contextlib.suppress(KeyboardInterrupt):  # a second interruption does not wait
            executor.stop()
        raise type(stop)(interruption_text(target)) from None
    excess = excessive_error((summary.rate_error, summary.attitude_error), scenario)
    if excess:
        print_warning(excess)
    if not results.quiet:
        from jaxsat.report.study_document import study_document

        tables, again = scenario.model_dump(exclude_none=True), "`--case` reruns one of them."
        print_document(study_document(summary, tables, again))
        places = [target, *(place for _, place in saved.places())]
        print_stdout(f"written to {', '.join(map(str, places))}")


def interruption_text(target: Path) -> str:
    """Return what an interrupted study leaves in its store, and what the same command does."""
    from jaxsat.store.ledger import status_chunks

    if not target.exists():
        return "nothing was written"
    if not status_chunks(target):
        return "no chunk is finished yet; the same command starts again"
    return f"the finished chunks are in {target}; the same command resumes"


def _stop_rule(text: str) -> "StopRule":
    from jaxsat.studies.statistics import StopRule

    match = re.fullmatch(r"([0-9.eE+-]+)\s*(%?)", text.strip())
    try:
        number = float(match.group(1)) if match else float("nan")
        return StopRule(number / 100 if match and match.group(2) else number)
    except ValueError:
        raise UserMistake(
            f"--until-ci: must be a half width such as 0.5% or 0.005, got {text}"
        ) from None


def _run(
    study: "Study",
    target: Path,
    executor: "AbstractExecutor",
    rule: "StopRule | None",
    elsewhere: bool,
) -> int:
    from jaxsat.studies.run import run_study

    return interruptibly(
        lambda: run_study(
            study,
            target,
            executor=executor,
            until=rule,
            report=lambda progress: show_progress(progress_text(progress)),
            tell=print_warning,
            elsewhere=elsewhere,
        )
    )
