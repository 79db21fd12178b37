"""`jaxsat tune`: better gains, with gradients through the simulator or without, verified."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.options import BatchSize, Flag, OptionalPath, Overrides, Report, Workers
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.terminal import (
    SUCCESS,
    FailedRun,
    Terminated,
    UserMistake,
    output_problem,
    print_document,
    print_stderr,
    print_stdout,
)
from jaxsat.cli.work import require_approval
from jaxsat.core.processors import processors

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario
    from jaxsat.studies import Work
    from jaxsat.synthesis.tuning import DescentProgress, DescentState, TuningPlan
    from jaxsat.synthesis.tuning.checkpoint import TuningFolder

CASE = 1000
"""Bytes of a case in memory, and as much for each gain, about."""

FOLDER = 10**7
"""Bytes of a folder, most of them figures, about."""


def tune(
    scenario: str,
    /,
    *,
    out: OptionalPath = None,
    overrides: Overrides = (),
    engine: Literal["auto", "native", "scan", "diffrax"] = "auto",
    workers: Workers = None,
    batch_size: BatchSize = 32,
    baselines: Flag = False,
    report: Report = False,
    overwrite: Flag = False,
    yes: Flag = False,
    elsewhere: Flag = False,
    quiet: Flag = False,
) -> int:
    """Tune gains of a scenario's control law over its dispersions, as its [tuning] table says.

    Writes tuned.toml, ready to run, a summary that begins with the check of the gradients, the
    verdict on cases not used for tuning, the history and figures. The same command resumes an
    interrupted run, with the same result.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with [dispersion] and [tuning] tables.
    out
        Output folder; by default jaxsat-NAME-tuned in the current folder.
    overrides
        KEY=VALUE that replaces a value of the scenario, such as tuning.steps=20; may be given
        several times.
    engine
        native: machine code compiled for the program; scan: a plain loop in XLA; diffrax: the
        method of a single run; auto: native if possible, else scan.
    workers
        Threads that share a batch; by default the number of processors.
    batch_size
        Cases per pass of the compiled loop.
    baselines
        Then run Nelder-Mead, random search, CMA-ES and BFGS with the same number of trajectories,
        or the number in [tuning].
    report
        Also write a report, as `jaxsat report` does: report.html in the output folder, or the given
        file.
    overwrite
        Replace the file of --report; results in the folder are resumed.
    yes
        Start even if the work exceeds the limits of steps, memory or disk.
    elsewhere
        Resume a run that was started with other versions or on another processor, if the program is
        the same.
    quiet
        Print only warnings and errors.
    """
    chosen = load_or_explain(scenario, overrides, "tuning")
    use_double_precision()
    target = Path(f"jaxsat-{Path(scenario).stem}-tuned") if out is None else out
    planned = planned_report(report, target, overwrite=overwrite)

    from jaxsat.store import OutputError
    from jaxsat.synthesis.tuning import NoGradient
    from jaxsat.synthesis.tuning.build import build_plan
    from jaxsat.synthesis.tuning.checkpoint import TuningFolder, plan_identity
    from jaxsat.synthesis.tuning.run import is_concluded, read_document

    try:
        show_progress("compiling")
        plan = interruptibly(
            lambda: build_plan(
                chosen, engine=engine, batch_size=batch_size, workers=workers or processors()
            )
        )
        if plan.remark is not None and not quiet:
            print_stderr(plan.remark, "")
        require_approval([_work(plan, baselines)], target, yes=yes, quiet=quiet)
        with TuningFolder(target, plan_identity(plan), elsewhere=elsewhere) as folder:
            done = is_concluded(folder, baselines)
            if folder.lost_state and not quiet:
                print_stderr(f"{target} has lost its state, so the run begins again", "warning: ")
            if not done:
                state = _descended(plan, chosen, folder)
                _concluded(plan, chosen, folder, state, baselines, quiet)
            if not quiet:
                print_document(read_document(chosen.title, folder))
                print_stdout("")
                print_stdout(f"{'already ' if done else ''}written to {target}")
    except NoGradient as error:
        raise FailedRun(str(error)) from None
    except OutputError as error:
        raise output_problem(error, "--elsewhere") from None
    except ValueError as error:
        raise UserMistake(str(error)) from None
    finish_report(planned, quiet=quiet)
    return SUCCESS


def _work(plan: "TuningPlan", baselines: bool) -> "Work":
    """What the descent and the verdict take, about; a gradient of n gains counts n + 1."""
    from jaxsat.studies import Work

    told = plan.settings
    free = told.descent.derivative_free
    gradients = told.steps * told.starts * told.cases * (1 if free else len(plan.start) + 1)
    screened = 0 if free else told.screened * len(told.screening())
    checks = (told.steps // told.validate_every + 2) * told.starts * told.validation_cases
    descent = gradients + screened + checks
    if baselines:
        descent += 4 * (told.baseline_trajectories or descent)
    trajectories = descent + 3 * told.held_out_cases
    together = max(told.cases, told.validation_cases, told.held_out_cases)
    memory = CASE * together * (len(plan.start) + 1)
    return Work(trajectories, trajectories * plan.intervals, memory, FOLDER)


def _descended(plan: "TuningPlan", scenario: "Scenario", folder: "TuningFolder") -> "DescentState":
    """The last state; an interruption says where the best gains so far are."""
    from jaxsat.synthesis.tuning.run import TUNED, run_descent

    show_progress("compiling; trying the starts")

    def told(progress: "DescentProgress") -> None:
        show_progress(progress_text(progress))

    try:
        return interruptibly(lambda: run_descent(scenario, plan, folder, report=told))
    except (KeyboardInterrupt, Terminated) as stop:
        steps = folder.saved_steps
        best = f"the best gains so far are in {folder.path / TUNED}" if steps else "no step"
        text = f"{best}, after {steps} steps; the same command resumes"
        raise type(stop)(text) from None


def progress_text(progress: "DescentProgress") -> str:
    """One line on how far a run is."""
    several = f", {progress.starts} starts" if progress.starts > 1 else ""
    slope = progress.gradient_norm
    gradient = f"gradient {slope:.3g}, " if slope == slope else ""
    return (
        f"step {progress.step} of {progress.steps}{several}: loss {progress.loss:.4g}, {gradient}"
        f"{progress.settled:.0%} settled; best on validation "
        f"{progress.best_loss:.4g}"
    )


def _concluded(
    plan: "TuningPlan",
    scenario: "Scenario",
    folder: "TuningFolder",
    state: "DescentState",
    baselines: bool,
    quiet: bool,
) -> None:
    """Receipt, verdict and all files; an interruption says where the tuned gains are."""
    from jaxsat.synthesis.tuning.run import TUNED, conclude

    def warn(text: str) -> None:
        if not quiet:
            print_stderr(text, "warning: ")

    try:
        interruptibly(
            lambda: conclude(
                scenario, plan, state, folder, baselines, tell=show_progress, warn=warn
            )
        )
    except (KeyboardInterrupt, Terminated) as stop:
        text = f"the tuned gains are in {folder.path / TUNED}; the same command resumes"
        raise type(stop)(text) from None
