"""What the commands write to: plain where there is no terminal, never an encoding error."""

import io
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from jaxsat.results import OutputError

SUCCESS = 0
FAILED_RUN = 1
USER_MISTAKE = 2
INTERRUPTED = 130
TERMINATED = 143
"""What every command exits with; docs/scenarios.md tells users."""


class FailedRun(Exception):
    """Something that failed although it was rightly asked for: a full disk, workers that died."""


class Terminated(BaseException):
    """SIGTERM, turned into an exception so that temporary files are removed."""


class UserMistake(Exception):
    """Something the user can put right; the message says what, one line for each mistake.

    A `located` message begins with the place of the mistake, as editors like it, and is shown
    as it is.
    """

    located: bool

    def __init__(self, message: str, *, located: bool = False):
        super().__init__(message)
        self.located = located


def output_problem(error: "OutputError", hint: str = "") -> UserMistake | FailedRun:
    """What to raise for results that could not be written."""
    return (FailedRun if error.failure else UserMistake)(f"{error}{hint}")


def make_streams_safe() -> None:
    """Let characters that a stream cannot encode appear as question marks."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def console(*, error: bool = False) -> Console:
    """A console on standard output or standard error that takes text as it is."""
    return Console(stderr=error, markup=False, highlight=False, soft_wrap=True)


def report(message: str, prefix: str = "jaxsat: ") -> None:
    """Write to standard error, each line marked as jaxsat's."""
    output = console(error=True)
    for line in message.splitlines():
        output.print(prefix + line)


def report_mistake(mistake: UserMistake) -> None:
    """Write a mistake to standard error."""
    report(str(mistake), "" if mistake.located else "jaxsat: ")


@contextmanager
def warnings_as_lines() -> Iterator[None]:
    """Inside, jaxsat's own warnings are shown as one line each, without the place in its code."""
    with warnings.catch_warnings():
        show = warnings.showwarning

        def shown(message, category, filename, lineno, file=None, line=None) -> None:
            if category.__module__.partition(".")[0] == "jaxsat":
                report(str(message), "warning: ")
            else:
                show(message, category, filename, lineno, file, line)

        warnings.showwarning = shown
        yield
