"""Text about the progress of studies."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jaxsat.studies import StudyProgress


def progress_text(progress: "StudyProgress") -> str:
    """One line on how far a study is."""
    left = f"{progress.seconds_left:.0f} s left" if progress.seconds_left >= 1 else "finishing"
    return (
        f"{progress.done} of {progress.count} cases, {progress.rate:.1f} per second, "
        f"{left}, {progress.fraction_settled:.1%} settled"
    )
