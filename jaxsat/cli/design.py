"""`jaxsat design`: from a vehicle with failures to a controller verified on it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import vehicle_or_explain
from jaxsat.cli.options import (
    Digits,
    Flag,
    OptionalPath,
    OptionalSeed,
    Overrides,
    Report,
    Text,
    Workers,
    number,
    whole,
)
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.study_executors import chosen_executor, study_problems
from jaxsat.cli.study_text import progress_text as study_progress_text
from jaxsat.cli.terminal import (
    FAILED_RUN,
    SUCCESS,
    Terminated,
    UserMistake,
    print_stderr,
    print_stdout,
    print_text,
)
from jaxsat.cli.tune import progress_text as tuning_progress_text
from jaxsat.cli.work import require_approval

if TYPE_CHECKING:
    from jaxsat.studies import Work
    from jaxsat.synthesis.controller_design import ControllerDesign, Vehicle

MAX_STEPS, MAX_CASES, MIN_SETTLED = 10_000, 10**6, 1e-6
CASE = 400
"""Bytes of a case in memory and on the disk, about."""

USUAL_DURATION = 1200.0
"""Seconds of a case where the file has none, about."""

STUDIES = 4
"""Candidates in all steps before the verification, about."""


def design(
    scenario: str,
    /,
    *,
    out: OptionalPath = None,
    overrides: Overrides = (),
    law: Text = None,
    settled: Annotated[float, Parameter(converter=number(MIN_SETTLED, 1.0))] = 0.99,
    cases: Annotated[int, Parameter(converter=whole(1, MAX_CASES))] = 2000,
    steps: Annotated[int, Parameter(converter=whole(0, MAX_STEPS))] = 16,
    seed: OptionalSeed = None,
    attitude: Literal["wanted", "nearest"] = "wanted",
    goal: Literal["quickest", "settled"] = "quickest",
    engine: Literal["auto", "native", "scan", "diffrax"] = "auto",
    workers: Workers = None,
    report: Report = False,
    overwrite: Flag = False,
    yes: Flag = False,
    elsewhere: Flag = False,
    digits: Digits = None,
    quiet: Flag = False,
) -> int:
    """Design a controller for a vehicle with failures, and verify it on cases never seen before.

    States which torques are left and which attitude can be held, screens the laws that fit, tunes
    the best, and verifies it. Writes designed.toml, ready for every command, a page, a record and
    figures. The same command resumes an interrupted run. Exits with 1 if the wanted fraction does
    not settle, or if there is nothing to design.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file. [spacecraft] is enough: the command
        assumes the rest and lists the assumptions.
    out
        Output folder; by default jaxsat-NAME-designed in the current folder.
    overrides
        KEY=VALUE that replaces a value of the scenario, such as spacecraft.failed_thrusters=[2];
        may be given several times.
    law
        The law to design, or all for every law that fits; by default that of the scenario, or all
        if it names none.
    settled
        Fraction of the cases that must settle.
    cases
        Unseen cases of the verification; earlier steps use at most this number.
    steps
        Steps of the tuner; 0 skips tuning.
    seed
        Seed of the first step; the other steps use the following numbers. By default that of the
        scenario.
    attitude
        wanted: that of the orbit frame; nearest: if that cannot be held, the nearest one that can,
        to which the body axes of designed.toml are rotated.
    goal
        quickest: the fastest of the laws that settle most, with tuned gains; settled: the first law
        proven to settle the wanted fraction, and tuning only if there is none.
    engine
        As for `jaxsat montecarlo`.
    workers
        Threads, each of which computes one chunk; by default the number of processors.
    report
        Also write a report, as `jaxsat report` does: report.html in the output folder, or the given
        file.
    overwrite
        Replace the file of --report; results in the folder are resumed.
    yes
        Start even if the work exceeds the limits of steps, memory or disk.
    elsewhere
        Resume a design that was started with other versions or on another processor, if the
        programs are the same.
    digits
        Significant digits of the numbers that are printed, at least; by default about four.
    quiet
        Print only warnings and errors.
    """
    del digits  # `jaxsat.cli.app` sees to it
    vehicle = vehicle_or_explain(scenario, overrides)
    target = Path(f"jaxsat-{Path(scenario).stem}-designed") if out is None else out
    planned = planned_report(report, target, overwrite=overwrite)
    require_approval([_work(vehicle, cases, steps)], target, yes=yes, quiet=quiet)
    executor = chosen_executor(workers, None, None, None)

    import jaxsat

    told: set[str] = set()

    def remark(text: str) -> None:
        if text not in told and not quiet:
            print_stderr(text, "")
        told.add(text)

    try:
        with study_problems():
            found = interruptibly(
                lambda: jaxsat.design(
                    vehicle.scenario,
                    law=law or vehicle.law,
                    settled=settled,
                    cases=cases,
                    steps=steps,
                    seed=seed,
                    attitude=attitude,
                    goal=goal,
                    engine=engine,
                    executor=executor,
                    out=target,
                    elsewhere=elsewhere,
                    timed=vehicle.timed,
                    report=_told,
                    remark=remark,
                )
            )
    except ValueError as error:
        raise UserMistake(str(error)) from None
    except (KeyboardInterrupt, Terminated) as stop:
        kept = f"the results so far are in {target}; the same command resumes"
        raise type(stop)(kept) from None
    status = _concluded(found, target, quiet)
    finish_report(planned, quiet=quiet)
    return status


def _concluded(found: "ControllerDesign", target: Path, quiet: bool) -> int:
    """Print the page; the status says whether the wanted fraction settles."""
    from jaxsat.synthesis.controller_design.page import design_page, headline

    if not quiet:
        print_text(design_page(found))
        print_stdout("")
        print_stdout(f"written to {target}")
    if found.outcome == "reached":
        return SUCCESS
    if quiet:
        print_stderr(headline(found))
    return FAILED_RUN


def _work(vehicle: "Vehicle", cases: int, steps: int) -> "Work":
    """What all steps take, about."""
    from jaxsat.studies import Work
    from jaxsat.synthesis.controller_design.settings import SCREENING_CASES, VALIDATION_CASES
    from jaxsat.synthesis.controller_design.tuning import TUNED_CASES

    simulation = vehicle.scenario.simulation
    trajectories = STUDIES * (SCREENING_CASES + VALIDATION_CASES) + cases + 8 * steps * TUNED_CASES
    duration = simulation.duration_s if vehicle.timed else USUAL_DURATION
    intervals = round(duration / simulation.save_every_s)
    return Work(trajectories, trajectories * intervals, cases * CASE, cases * CASE)


def _told(what: str, progress: Any) -> None:
    """Progress of a study, of the tuner, or of neither."""
    from jaxsat.studies import StudyProgress

    text = what
    if isinstance(progress, StudyProgress):
        text = f"{what}: {study_progress_text(progress)}"
    elif progress is not None:
        text = f"{what}: {tuning_progress_text(progress)}"
    show_progress(text)
