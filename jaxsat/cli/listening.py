"""Reports of a library function to the command line: progress, remarks and warnings."""

from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.options import Resumable, option_mistake
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import planned_report, present
from jaxsat.cli.terminal import print_stderr, print_warning
from jaxsat.cli.work import require_approval

if TYPE_CHECKING:
    from jaxsat.studies.run import StudyProgress
    from jaxsat.synthesis.execution import Execution, Listener
    from jaxsat.synthesis.tuning.descent import DescentProgress

Result = TypeVar("Result", bound=Any)


def present_result(
    scenario: str,
    ending: str,
    results: Resumable,
    work: Callable[..., Result],
    options: Container[str] = (),
) -> Result:
    """Return the result of `work`, as `resumable` does, and print its document and write a report.

    The folder is by default jaxsat-NAME-ENDING. A `ValueError` becomes a `UserMistake` that names
    the option of the wrong argument, if it is in `options`.
    """
    target = results.out or Path(f"jaxsat-{Path(scenario).stem}-{ending}")
    report = planned_report(results, target)
    try:
        result = resumable(target, results, work)
    except ValueError as error:
        raise option_mistake(error, options) from None
    present(result.document, target, results, report)
    return result


def resumable(target: Path, results: Resumable, work: Callable[..., Result]) -> Result:
    """Return the result of `work`, called with folder, execution of studies and a listener.

    An interruption reports that the results so far are in `target`.
    """
    with resumed_later(target):
        return interruptibly(
            lambda: work(
                out=target, execution=execution(results), listener=listener(target, results)
            )
        )


def listener(target: Path, results: Resumable) -> "Listener":
    """Return a listener that shows progress, prints each remark once, and refuses too much work."""
    from jaxsat.synthesis.execution import Listener

    remarks: set[str] = set()

    def remark(text: str) -> None:
        if text not in remarks and not results.quiet:
            print_stderr(text, "")
        remarks.add(text)

    return Listener(
        show,
        remark,
        print_warning,
        lambda works: require_approval(works, target, yes=results.yes, quiet=results.quiet),
    )


def execution(results: Resumable) -> "Execution":
    """Return the execution of studies by the options; raises `UserMistake`."""
    from jaxsat.cli.study_executors import chosen_executor
    from jaxsat.synthesis.execution import Execution

    return Execution(results.engine, chosen_executor(results.workers), results.elsewhere)


def show(what: str, progress: Any) -> None:
    """Show the current task and the progress of a study or the tuner."""
    from jaxsat.studies.run import StudyProgress

    if isinstance(progress, StudyProgress):
        what = f"{what}: {progress_text(progress)}"
    elif progress is not None:
        what = f"{what}: {tuning_text(progress)}"
    show_progress(what)


def progress_text(progress: "StudyProgress") -> str:
    """Return one line on the progress of a study."""
    remainder = f"{progress.seconds_left:.0f} s left" if progress.seconds_left >= 1 else "finishing"
    return (
        f"{progress.done} of {progress.count} cases, {progress.rate:.1f} per second, "
        f"{remainder}, {progress.fraction_settled:.1%} settled"
    )


def tuning_text(progress: "DescentProgress") -> str:
    """Return one line on the progress of a tuning."""
    several = f", {progress.starts} starts" if progress.starts > 1 else ""
    slope = progress.gradient_norm
    gradient = f"gradient {slope:.3g}, " if slope == slope else ""
    return (
        f"step {progress.step} of {progress.steps}{several}: loss {progress.loss:.4g}, {gradient}"
        f"{progress.settled:.0%} settled; best on validation "
        f"{progress.best_loss:.4g}"
    )


@contextmanager
def resumed_later(target: Path, what: str = "the results so far are in {}") -> Iterator[None]:
    """Make an interruption report that the content of `target`, if any, is resumed."""
    try:
        yield
    except KeyboardInterrupt as stop:
        lines = [f"{what.format(target)}; the same command resumes"] if target.exists() else []
        raise type(stop)(*lines) from None
