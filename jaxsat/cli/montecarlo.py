"""`jaxsat montecarlo`: dispersed copies of a scenario into a store, or one case recomputed."""

import contextlib
import itertools
import re
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.integration_error import excessive_error
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.options import (
    BatchSize,
    Case,
    Cases,
    Digits,
    Flag,
    Instants,
    OptionalBatchSize,
    OptionalPath,
    OptionalSeed,
    Overrides,
    Report,
    Text,
    Workers,
)
from jaxsat.cli.places import refuse_nested, try_folder
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.study_executors import chosen_executor, study_problems
from jaxsat.cli.study_files import (
    figures_folder,
    refuse_csv,
    tell_repair,
    write_csv,
    write_figures,
    write_one_case,
)
from jaxsat.cli.study_text import progress_text, summary_lines
from jaxsat.cli.terminal import (
    SUCCESS,
    Terminated,
    UserMistake,
    print_stderr,
    print_stdout,
)
from jaxsat.cli.work import require_approval
from jaxsat.core.errors import LibraryError

if TYPE_CHECKING:
    from jaxsat.studies import AbstractExecutor, StopRule, Study, Summary


def montecarlo(
    scenario: str,
    /,
    *,
    count: Cases = 1000,
    seed: OptionalSeed = None,
    out: OptionalPath = None,
    overrides: Overrides = (),
    engine: Literal["auto", "native", "scan", "diffrax"] = "auto",
    workers: Workers = None,
    batch_size: BatchSize = 64,
    chunk: OptionalBatchSize = None,
    until_ci: Text = None,
    case: Case = None,
    overwrite: Flag = False,
    processes: Workers = None,
    scheduler: Text = None,
    devices: Workers = None,
    figures: OptionalPath = None,
    csv: OptionalPath = None,
    report: Report = False,
    history: Instants = None,
    yes: Flag = False,
    elsewhere: Flag = False,
    controller: OptionalPath = None,
    digits: Digits = None,
    quiet: Flag = False,
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
    out
        Zarr store of the results, by default jaxsat-NAME.zarr; with --case a folder for the
        trajectory.
    overrides
        KEY=VALUE that replaces a value of the scenario, as for `jaxsat simulate`.
    engine
        native: machine code compiled for the scenario, fastest; scan: a plain loop in XLA; diffrax:
        the method of a single run; auto: native on a CPU; it prints a line if it has to use scan.
    workers
        Threads of each process, each of which computes one chunk. The default, also the maximum, is
        the number of processors, divided by the number of processes.
    processes
        Processes on this machine that share the chunks, at most as many as processors; a process
        that dies is replaced.
    scheduler
        Distribute the chunks to the workers of this dask scheduler: an address such as
        tcp://host:8786, or the scheduler's JSON file.
    devices
        Devices (accelerators) of this machine that share the chunks.
    batch_size
        Cases per pass of the compiled loop; the last bits of results may depend on it.
    chunk
        Cases that are computed and written together; by default a number that suits the engine.
    until_ci
        Stop when the half width of the interval of the settled fraction is below this, such as
        0.5%.
    case
        Recompute this case alone and write its whole trajectory.
    overwrite
        Replace the files of --csv and --report, or with --case the folder, if jaxsat wrote it; a
        store is resumed.
    report
        Also write a report, as `jaxsat report` does: next to the store, with .html in place of
        .zarr, or the given file; with --case report.html in its folder.
    figures
        Folder for figures: settling times, where cases settle, convergence, fan charts of attitude
        and rates.
    csv
        CSV file of the cases, one row each: outcome, times, effort, final state and drawn values.
        Column names contain the units.
    history
        Save attitude, rates and torque of every case at this number of instants, evenly spaced over
        the horizon.
    yes
        Start even if the work exceeds the limits of steps, memory or disk.
    elsewhere
        Resume a store that was started with other versions or on another processor, if the program
        is the same.
    controller
        Library that `make` built in the folder of `jaxsat export`: its C code replaces law and
        estimator, in threads of this process.
    digits
        Significant digits of the numbers that are printed, at least; by default about four.
    quiet
        Print only warnings and errors.
    """
    del digits  # `jaxsat.cli.app` sees to it
    stem = Path(scenario).stem
    if case is not None and figures is not None:
        raise UserMistake("--case: must be given without --figures, which show a whole study")
    if case is not None and csv is not None:
        raise UserMistake("--case: must be given without --csv, which has all cases of a study")
    if case is None and csv is None and report is False and overwrite:
        raise UserMistake(
            "--overwrite: must be given with --case, --csv or --report; a store is resumed"
        )
    if controller is not None and (processes or scheduler or devices):
        raise UserMistake(
            "--controller: must be given without --processes, --scheduler and --devices"
        )
    target = out or Path(f"jaxsat-{stem}{'.zarr' if case is None else f'-{case}'}")
    more = {"--figures": figures, "--csv": csv}
    places = [(option, place) for option, place in more.items() if place is not None]
    for one, other in itertools.combinations([*places, ("--out", target)], 2):
        refuse_nested(one, other)
    if csv is not None:
        refuse_csv(csv, overwrite=overwrite)
    planned = planned_report(report, target, overwrite=overwrite, store=case is None)
    chosen = load_or_explain(scenario, overrides, "study")
    if figures is not None:
        try_folder(lambda: figures_folder(figures))
    rule = None if until_ci is None else _stop_rule(until_ci)
    use_double_precision()
    try:
        from jaxsat.scenario.build.study import build_study
        from jaxsat.studies import study_work

        show_progress("compiling")
        study = interruptibly(
            lambda: build_study(
                chosen,
                count,
                seed=seed,
                engine=engine,
                batch_size=batch_size,
                chunk=chunk,
                history=history,
                controller=controller,
            )
        )
    except LibraryError as error:
        raise UserMistake(f"--controller: {error}") from None
    except ValueError as error:
        raise UserMistake(str(error)) from None
    if study.remark is not None and not quiet:
        print_stderr(study.remark, "")
    if rule is not None and study.has_fixed_size:
        raise UserMistake("--until-ci: must be given with a design other than latin-hypercube")
    if case is not None:
        write_one_case(chosen, study, case, target, overwrite=overwrite, quiet=quiet)
        finish_report(planned, quiet=quiet)
        return SUCCESS
    executor = chosen_executor(workers, processes, scheduler, devices)
    require_approval([study_work(study, rule)], target, yes=yes, quiet=quiet)
    try:
        counted = _run(study, target, executor, rule, elsewhere)
        show_progress("summarising")
        summary = interruptibly(lambda: _summary(target, counted))
        if figures is not None:
            show_progress("drawing figures")
            write_figures(figures, chosen.title, study, target, summary)
        if csv is not None:
            show_progress("writing the table")
            write_csv(csv, target, counted, overwrite=overwrite)
    except (KeyboardInterrupt, Terminated) as stop:
        with contextlib.suppress(KeyboardInterrupt, Terminated):  # a second one does not wait
            executor.stop()
        raise type(stop)(_what_is_left(target)) from None
    excess = excessive_error((summary.rate_error, summary.attitude_error), chosen)
    if excess:
        print_stderr(excess, "warning: ")
    if not quiet:
        for line in summary_lines(summary):
            print_stdout(line)
        written = [target, *(place for _, place in places)]
        print_stdout(f"written          {', '.join(map(str, written))}")
    finish_report(planned, quiet=quiet)
    return SUCCESS


def _what_is_left(target: Path) -> str:
    if not target.exists():
        return "nothing was written"
    return f"the finished chunks are in {target}; the same command resumes"


def _summary(target: Path, counted: int) -> "Summary":
    from jaxsat.store import study_columns
    from jaxsat.studies import summarise

    return summarise(study_columns(target), counted)


def _stop_rule(text: str) -> "StopRule":
    from jaxsat.studies import StopRule

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
    from jaxsat.studies import run_study

    with study_problems():
        return interruptibly(
            lambda: run_study(
                study,
                target,
                executor=executor,
                until=rule,
                report=lambda progress: show_progress(progress_text(progress)),
                tell=tell_repair,
                elsewhere=elsewhere,
            )
        )
