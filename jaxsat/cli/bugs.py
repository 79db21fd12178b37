"""The last resort: an exception that no command expected becomes one line and a file."""

import os
import platform
import re
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import jaxsat
from jaxsat.cli.terminal import FailedRun, print_stderr
from jaxsat.core.text import clean

MAX_MESSAGE_LENGTH = 300
"""Characters of an exception's message that are told; the file has all of it."""

OUT_OF_MEMORY_TEXTS = ("RESOURCE_EXHAUSTED", "can't start new thread", "Cannot allocate memory")
"""How libraries call a lack of memory or threads where they have no exception for it."""


def failure_of(error: BaseException) -> FailedRun | None:
    """What to tell of an exception that means a lack of memory or a failing disk, else None."""
    from jaxsat.store.files import FAILURES

    if isinstance(error, BrokenPipeError):
        return FailedRun("a process that was to take part in this has gone")
    if isinstance(error, OSError) and error.errno in FAILURES:
        where = "" if error.filename is None else f"{error.filename}: "
        return FailedRun(f"{where}{error.strerror}")
    if isinstance(error, MemoryError) or any(sign in str(error) for sign in OUT_OF_MEMORY_TEXTS):
        return FailedRun("not enough memory; ask for fewer cases at once")
    return None


def ending_of(error: SystemExit) -> str:
    """What ended Python, and where: "sys.exit(3) (law.py:12)"."""
    code = "" if error.code is None else clean(repr(error.code), MAX_MESSAGE_LENGTH)
    frames = traceback.extract_tb(error.__traceback__)
    places = [f'"{one.filename}", line {one.lineno}' for one in frames]
    places += [line for note in getattr(error, "__notes__", ()) for line in note.split("\n")]
    matches = [match for place in places if (match := re.search(r'"(.+)", line (\d+)', place))]
    where = f" ({matches[-1][1]}:{matches[-1][2]})" if matches else ""
    return f"sys.exit({code}){where}"


def report_error(error: Exception) -> None:
    """One line for an exception that no command expected; a file too if jaxsat is at fault."""
    failure = failure_of(error)
    if failure is None:
        report_bug(error)
    else:
        print_stderr(str(failure))


def report_bug(error: BaseException) -> None:
    """One line on standard error, and the traceback in a file that only its owner can read."""
    kind, text = type(error).__name__, str(error).strip()
    first = clean(text.split("\n")[0], MAX_MESSAGE_LENGTH)
    what = f"{kind}: {first}" if first else kind
    try:
        place = f"its traceback is in {_written(error)}, please report it with that file"
    except OSError as reason:
        place = f"its traceback cannot be written ({reason.strerror or reason})"
    print_stderr(f"{what}; this is a bug in jaxsat, {place}")


@contextmanager
def thread_errors_reported() -> Iterator[None]:
    """Have exceptions that end a thread, or that Python cannot raise, told in the same way."""
    messages: set[str] = set()

    def tell(error: BaseException | None) -> None:
        if not isinstance(error, Exception) or repr(error) in messages:
            return
        messages.add(repr(error))
        report_error(error)

    before = threading.excepthook, sys.unraisablehook
    threading.excepthook = sys.unraisablehook = lambda raised: tell(raised.exc_value)
    try:
        yield
    finally:
        threading.excepthook, sys.unraisablehook = before


def _written(error: BaseException) -> Path:
    from jaxsat.store import command_line

    try:
        lines = traceback.format_exception(error)
    except Exception as other:  # such as a __str__ or __repr__ that fails
        lines = [f"{type(error).__name__}, of which {type(other).__name__} keeps the traceback\n"]
    versions = [
        f"jaxsat {jaxsat.__version__}, Python {platform.python_version()}, {platform.platform()}\n",
        f"{command_line()}\n\n",
    ]
    number, name = tempfile.mkstemp(prefix="jaxsat-traceback-", suffix=".txt")  # O_EXCL, 0600
    with os.fdopen(number, "w", encoding="utf-8", errors="backslashreplace") as file:
        file.writelines([*versions, *lines])
    return Path(name)
