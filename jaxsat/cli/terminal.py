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
"""Exit statuses of the commands, besides 128 plus the number of a signal; see docs/scenarios.md.

The last is 128 plus the number of SIGPIPE: the reader of the output closed it early.
"""


class FailedRun(Exception):
    """A failure of a valid request: a full disk, workers that died."""


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP, as an exception so that temporary files are removed."""


class UserMistake(Exception):
    """A mistake that the user can correct; the message has one line for each."""


_cut = False
"""Whether the reader of the output has closed it."""


def make_streams_safe() -> None:
    """Make streams replace unencodable characters by question marks.

    A stream that is closed from the start is replaced by a null one, or the next opened file would
    take its place. One without a buffer (PYTHONUNBUFFERED) gets a buffer, as it silently drops the
    rest of a partial write to a pipe.
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
    """Write one sanitised line to standard output; raises `FailedRun` if that fails."""
    _print(clean(line) + "\n")


def print_text(text: str) -> None:
    """Write lines to standard output."""
    _print("".join(clean(line) + "\n" for line in text.removesuffix("\n").split("\n")))


def print_document(document: "Document") -> None:
    """Write a document to standard output."""
    from jaxsat.report.printers import terminal_text

    _print(terminal_text(document))


def print_stderr(message: str, prefix: str = "jaxsat: ") -> None:
    """Write to standard error, each line with the prefix; a closed stream is ignored."""
    text = "".join(prefix + clean(line) + "\n" for line in message.split("\n"))
    with between_drawings(), contextlib.suppress(AttributeError):
        try:
            sys.stderr.write(text)
            sys.stderr.flush()
        except (OSError, ValueError):
            _silence(sys.stderr)


def print_warning(message: str) -> None:
    """Write a warning, of a likely mistake that stops nothing, to standard error."""
    print_stderr(message, "warning: ")


def print_problems(error: "ScenarioError") -> None:
    """Write the problems of a scenario, with their places at the begin of lines, as for editors."""
    print_stderr(str(error), "")


def finish(status: int) -> int:
    """Return the exit status once all output is out: `status`, unless some cannot be written.

    Output that standard error did not take is dropped: Python would end with another status for it.
    """
    try:
        _print("")
    except FailedRun as failure:
        if status == SUCCESS:  # an earlier failure has been reported
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
        except BrokenPipeError:  # the command continues, as it may do more than print
            _cut = True
            _silence(sys.stdout)
        except (OSError, ValueError) as error:
            _silence(sys.stdout)
            reason = getattr(error, "strerror", None) or error
            raise FailedRun(f"standard output cannot be written: {reason}") from None


def _silence(stream: TextIO) -> None:
    """Discard the rest of a stream's output silently."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
