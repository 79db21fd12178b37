"""Reports of a library function to the command line: progress, remarks, and the work ahead."""

import contextlib
import os
import shutil
from collections.abc import Callable, Container, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.options import Resumable, option_mistake
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import planned_report, present
from jaxsat.cli.terminal import UserMistake, print_stderr, print_warning

if TYPE_CHECKING:
    from jaxsat.studies.run import StudyProgress
    from jaxsat.studies.work import Work
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


@contextlib.contextmanager
def resumed_later(target: Path, what: str = "the results so far are in {}") -> Iterator[None]:
    """Make an interruption report that the content of `target`, if any, is resumed."""
    try:
        yield
    except KeyboardInterrupt as stop:
        lines = [f"{what.format(target)}; the same command resumes"] if target.exists() else []
        raise type(stop)(*lines) from None


MAX_STEPS = 10**12
"""About a day of ten processors with the native engine; docs/scenarios.md lists all limits."""

MAX_MEMORY = 8 * 10**9
MAX_DISK = 20 * 10**9
MAX_FILES = 10**6
REPORT_FACTOR = 100
"""Ratio of limit to work below which the work is printed on a line of its own."""


def require_approval(parts: "Iterable[Work]", target: Path, *, yes: bool, quiet: bool) -> None:
    """Show the total work of consecutive parts; raises `UserMistake` for too much of it."""
    parts = list(parts)
    trajectories, steps, disk, files = (
        sum(getattr(part, name) for part in parts)
        for name in ("trajectories", "steps", "disk", "files")
    )
    memory = max(part.memory for part in parts)
    free = _room(target, lambda place: shutil.disk_usage(place).free)
    text = (
        f"{trajectories:,} trajectories, {steps:,} steps, "
        f"about {_bytes(memory)} of memory and {_bytes(disk)} of disk in {files:,} files"
    )
    show_progress(f"compiling; work: {text}")
    excesses = [
        f"{name} above {limit}"
        for name, value, most, limit in (
            ("steps", steps, MAX_STEPS, f"{MAX_STEPS:,}"),
            ("memory", memory, MAX_MEMORY, _bytes(MAX_MEMORY)),
            ("disk", disk, MAX_DISK, _bytes(MAX_DISK)),
            ("disk", disk, free, "the free disk space"),
            ("files", files, MAX_FILES, f"{MAX_FILES:,} (larger chunks make fewer)"),
            ("files", files, _room(target, _files_at), "what the disk has room for"),
        )
        if value > most
    ]
    if excesses and not yes:
        raise UserMistake(f"too much work ({text}; {', '.join(excesses)}); give --yes to do it")
    near = (steps / MAX_STEPS, memory / MAX_MEMORY, disk / MAX_DISK, files / MAX_FILES)
    if not quiet and max(near) * REPORT_FACTOR > 1:
        print_stderr(f"work: {text}")


def _room(target: Path, room_at: Callable[[Path], int | float]) -> int | float:
    """Return the room at a target's place; infinite where unknown."""
    for place in (target, *target.absolute().parents):
        with contextlib.suppress(OSError, AttributeError):  # a missing place; not on Windows
            return room_at(place)
    return float("inf")


def _files_at(place: Path) -> int | float:
    status = os.statvfs(place)
    return status.f_favail if status.f_files else float("inf")


def _bytes(number: int) -> str:
    for unit, size in (("TB", 10**12), ("GB", 10**9), ("MB", 10**6)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{-(-number // 1000)} kB"
