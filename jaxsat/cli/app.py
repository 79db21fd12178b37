"""The commands, and the handling of every exception that they raise.

An unexpected exception is reported as one line and a file with its traceback.
"""

import os
import platform
import re
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from cyclopts import App, CycloptsError

import jaxsat
from jaxsat.cli.bound import bound
from jaxsat.cli.compare import compare
from jaxsat.cli.computing import import_interruptibly
from jaxsat.cli.controllability import controllability
from jaxsat.cli.convert import convert
from jaxsat.cli.design import design
from jaxsat.cli.export import export
from jaxsat.cli.front import front
from jaxsat.cli.mistakes import parser_message
from jaxsat.cli.montecarlo import montecarlo
from jaxsat.cli.options import Printed
from jaxsat.cli.progress import stop_progress
from jaxsat.cli.rare import rare
from jaxsat.cli.report import report
from jaxsat.cli.reproduce import reproduce
from jaxsat.cli.scenarios import scenarios
from jaxsat.cli.simulate import simulate
from jaxsat.cli.terminal import (
    FAILED_RUN,
    OUTPUT_CUT,
    SUCCESS,
    USER_MISTAKE,
    FailedRun,
    UserMistake,
    print_problems,
    print_stderr,
    print_text,
    print_warning,
)
from jaxsat.cli.tune import tune
from jaxsat.cli.verify import verify
from jaxsat.cli.worst import worst
from jaxsat.core.errors import JaxsatError
from jaxsat.core.text import at_least_digits, clean

MAX_MESSAGE_LENGTH = 300
"""Number of reported characters of an exception's message; the file has all of it."""

OUT_OF_MEMORY_TEXTS = ("RESOURCE_EXHAUSTED", "can't start new thread", "Cannot allocate memory")
"""Texts of library errors for a lack of memory or threads, where no exception class exists."""

PLATFORMS = ("JAX_PLATFORMS", "JAX_PLATFORM_NAME")
"""Variables that choose JAX's platform; JAX raises at its first use where it is missing."""

app = App(
    name="jaxsat",
    version=jaxsat.__version__,
    help="Simulate and tune spacecraft that have lost thrusters or wheels.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
for command in (
    *(simulate, montecarlo, compare, bound, front, tune, verify, rare),
    *(worst, design, controllability, export, reproduce, report, convert, scenarios),
):
    app.command(command)


@app.command
def completion(shell: Literal["bash", "zsh", "fish"], /, *, printed: Printed = Printed()) -> int:
    """Print what makes the Tab key of a shell complete commands and options.

    For bash, in ~/.bashrc: source <(jaxsat completion bash)

    Parameters
    ----------
    shell
        Which shell; zsh reads it from a file _jaxsat in its fpath, fish by
        jaxsat completion fish | source.
    """
    del printed  # `run` reads it

    print_text(app.generate_completion(shell=shell))
    return SUCCESS


def run(tokens: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status, for every exception but signals."""
    try:
        with thread_errors_reported(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
            return _command(tokens)
    except CycloptsError as mistake:
        print_stderr(parser_message(mistake, app))
        return USER_MISTAKE
    except UserMistake as mistake:
        print_stderr(str(mistake))
        return USER_MISTAKE
    except FailedRun as failure:
        print_stderr(str(failure))
        return FAILED_RUN
    except SystemExit as ended:  # of foreign code; its status means nothing
        print_stderr(
            "control.law, a disturbance, actuators or an estimator: must be such that its code "
            f"returns, got {ending_of(ended)}"
        )
        return USER_MISTAKE
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # also classes outside Exception, such as panics of Rust
        return report_error(error)


def _command(tokens: Sequence[str] | None) -> int:
    tokens = sys.argv[1:] if tokens is None else list(tokens)
    command, bound, _ = app.parse_args(tokens, exit_on_error=False, print_error=False)
    if any(getattr(options, "quiet", False) for options in bound.arguments.values()):
        stop_progress()
    if not command.__module__.startswith("jaxsat."):
        try:
            command(*bound.args, **bound.kwargs)
        except (BrokenPipeError, SystemExit):  # Rich raises SystemExit for it
            return OUTPUT_CUT
        return SUCCESS
    computes = command.__module__ not in ("jaxsat.cli.scenarios", "jaxsat.cli.app")
    import_interruptibly("jaxsat.scenario", *(["jaxsat.store.resumable"] if computes else []))
    digits = (getattr(options, "digits", None) for options in bound.arguments.values())
    with at_least_digits(next(filter(None, digits), None)):
        result = command(*bound.args, **bound.kwargs)
    return result if isinstance(result, int) else SUCCESS


def _show_warning(message: Warning | str, *place: object) -> None:
    del place  # in the source, of no use to a user
    print_warning(str(message))


def failure_of(error: BaseException) -> str | None:
    """Return a message for a lack of memory or a failing disk, else None."""
    from jaxsat.store.files import FAILURES

    if isinstance(error, BrokenPipeError):
        return "a process that takes part in the run has exited"
    if isinstance(error, OSError) and error.errno in FAILURES:
        where = "" if error.filename is None else f"{error.filename}: "
        return f"{where}{error.strerror}"
    platform = next((one for one in PLATFORMS if os.environ.get(one)), None)
    frames = traceback.extract_tb(error.__traceback__)
    if platform and frames and Path(frames[-1].filename).name == "xla_bridge.py":
        got = clean(os.environ[platform], MAX_MESSAGE_LENGTH)
        return f"{platform}: must be what JAX finds on this machine, such as cpu, got {got}"
    if isinstance(error, MemoryError) or any(sign in str(error) for sign in OUT_OF_MEMORY_TEXTS):
        return "not enough memory; use fewer cases at once"
    return None


def ending_of(error: SystemExit) -> str:
    """Return the cause and place of Python's end: "sys.exit(3) (law.py:12)"."""
    code = "" if error.code is None else clean(repr(error.code), MAX_MESSAGE_LENGTH)
    frames = traceback.extract_tb(error.__traceback__)
    places = [f'"{one.filename}", line {one.lineno}' for one in frames]
    places += [line for note in getattr(error, "__notes__", ()) for line in note.split("\n")]
    matches = [match for place in places if (match := re.search(r'"(.+)", line (\d+)', place))]
    where = f" ({matches[-1][1]}:{matches[-1][2]})" if matches else ""
    return f"sys.exit({code}){where}"


def report_error(error: BaseException) -> int:
    """Report an exception and return the exit status.

    One line for an unusable scenario or unusable results, a failure of a valid request, or a lack
    of memory or disk. All other exceptions are bugs of jaxsat, with the traceback in a file.
    """
    if isinstance(error, JaxsatError):
        if error.failure:
            print_stderr(str(error))
            return FAILED_RUN
        from jaxsat.scenario import ScenarioError

        if isinstance(error, ScenarioError):
            print_problems(error)
            return USER_MISTAKE
        from jaxsat.store.files import OutputError  # slow to import

        if isinstance(error, OutputError):
            print_stderr(f"{error}{' (--elsewhere)' if error.elsewhere else ''}")
            return USER_MISTAKE
    failure = failure_of(error)
    if failure is None:
        report_bug(error)
    else:
        print_stderr(failure)
    return FAILED_RUN


def report_bug(error: BaseException) -> None:
    """Write a line to standard error, and the traceback to a file that only its owner can read."""
    kind, text = type(error).__name__, str(error).strip()
    first = clean(text.split("\n")[0], MAX_MESSAGE_LENGTH)
    what = f"{kind}: {first}" if first else kind
    try:
        place = f"its traceback is in {_write_traceback(error)}, please report it with that file"
    except OSError as reason:
        place = f"its traceback cannot be written ({reason.strerror or reason})"
    print_stderr(f"{what}; this is a bug in jaxsat, {place}")


@contextmanager
def thread_errors_reported() -> Iterator[None]:
    """Report exceptions that end a thread, or that Python cannot raise, in the same way."""
    messages: set[str] = set()

    def tell(error: BaseException | None) -> None:
        if not isinstance(error, Exception) or repr(error) in messages:
            return
        messages.add(repr(error))
        report_error(error)

    before = threading.excepthook, sys.unraisablehook
    threading.excepthook = sys.unraisablehook = lambda arguments: tell(arguments.exc_value)
    try:
        yield
    finally:
        threading.excepthook, sys.unraisablehook = before


def _write_traceback(error: BaseException) -> Path:
    from jaxsat.store.provenance import command_line

    try:
        lines = traceback.format_exception(error)
    except Exception as other:  # such as a failing __str__ or __repr__
        lines = [f"{type(error).__name__}, of which {type(other).__name__} keeps the traceback\n"]
    versions = [
        f"jaxsat {jaxsat.__version__}, Python {platform.python_version()}, {platform.platform()}\n",
        f"{command_line()}\n\n",
    ]
    number, name = tempfile.mkstemp(prefix="jaxsat-traceback-", suffix=".txt")  # O_EXCL, 0600
    with os.fdopen(number, "w", encoding="utf-8", errors="backslashreplace") as file:
        file.writelines([*versions, *lines])
    return Path(name)
