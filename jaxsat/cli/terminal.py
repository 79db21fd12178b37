"""Output of the commands: plain without a terminal, never an encoding error."""

import contextlib
import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

from jaxsat.cli.progress import between_drawings
from jaxsat.core.text import clean

if TYPE_CHECKING:
    from jaxsat.report.document import Document
    from jaxsat.scenario import ScenarioError

SUCCESS = 0
FAILED_RUN = 1
USER_MISTAKE = 2
OUTPUT_CUT = 141
"""What every command exits with, or 128 and the number of a signal; docs/scenarios.md tells.

The last is 128 and the number of SIGPIPE: the reader of the output went before the end of it.
"""


class FailedRun(Exception):
    """Something that failed although it was rightly asked for: a full disk, workers that died."""


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP, turned into an exception so that temporary files are removed."""


class UserMistake(Exception):
    """Something the user can put right; the message says what, one line for each mistake."""


_cut = False
"""Whether the reader of the output has gone."""


def make_streams_safe() -> None:
    """Let characters that a stream cannot encode appear as question marks.

    A stream that is closed from the start becomes one that leads nowhere, or the next file that
    is opened would take its place. One without a buffer (PYTHONUNBUFFERED) gets a buffer, as it
    drops without an error what a pipe takes only in part.
    """
    global _cut
    _cut = False
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        stream = getattr(sys, name)
        if stream is None:
            mode = "r" if name == "stdin" else "w"
            with contextlib.suppress(OSError):
                os.fstat(number)
                continue
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper) and name != "stdin":
            stream.reconfigure(errors="replace")
            if isinstance(stream.buffer, io.RawIOBase):
                buffered = open(  # noqa: SIM115
                    stream.fileno(), "w", 1, stream.encoding, stream.errors, closefd=False
                )
                setattr(sys, name, buffered)


def print_stdout(line: str) -> None:
    """Write one line to standard output, whatever is in it; raises `FailedRun` if that fails."""
    _print(clean(line) + "\n")


def print_text(text: str) -> None:
    """Write lines to standard output."""
    _print("".join(clean(line) + "\n" for line in text.removesuffix("\n").split("\n")))


def print_document(document: "Document") -> None:
    """Write a document to standard output."""
    from jaxsat.report.printers import terminal_text

    _print(terminal_text(document))


def print_stderr(message: str, prefix: str = "jaxsat: ") -> None:
    """Write to standard error, each line marked as jaxsat's; where nobody listens, to nobody."""
    text = "".join(prefix + clean(line) + "\n" for line in message.split("\n"))
    with between_drawings(), contextlib.suppress(AttributeError):
        try:
            sys.stderr.write(text)
            sys.stderr.flush()
        except (OSError, ValueError):
            _silence(sys.stderr)


def print_warning(message: str) -> None:
    """Write to standard error what is likely a mistake and stops nothing."""
    print_stderr(message, "warning: ")


def print_problems(error: "ScenarioError") -> None:
    """Write what is wrong with a scenario: lines that begin with the place, as editors like it."""
    print_stderr(str(error), "")


def finish(status: int) -> int:
    """The exit status once all output is out: `status`, unless some of it cannot be written.

    What standard error did not take is dropped: Python would end with another status for it.
    """
    try:
        _print("")
    except FailedRun as failure:
        if status == SUCCESS:  # what failed before has been told
            print_stderr(str(failure))
            status = FAILED_RUN
    if sys.stderr is not None:
        try:
            sys.stderr.flush()
        except (OSError, ValueError):
            _silence(sys.stderr)
    return OUTPUT_CUT if _cut and status == SUCCESS else status


def _print(text: str) -> None:
    global _cut
    if sys.stdout is None:
        return
    with between_drawings():
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except BrokenPipeError:  # the command goes on, as it may have more to do than to print
            _cut = True
            _silence(sys.stdout)
        except (OSError, ValueError) as error:
            _silence(sys.stdout)
            reason = getattr(error, "strerror", None) or error
            raise FailedRun(f"standard output cannot be written: {reason}") from None


def _silence(stream: TextIO) -> None:
    """What is left of the output goes nowhere, without complaint."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
