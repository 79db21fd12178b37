"""Options of the commands and their ranges, checked before anything else.

docs/scenarios.md lists the ranges.
"""

import decimal
import math
import os
import re
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from jaxsat.cli.terminal import UserMistake
from jaxsat.core.errors import ArgumentError
from jaxsat.core.text import MOST_DIGITS, clean

MAX_CASES = 2**32
"""Number of case numbers, 32-bit words of the noise's key."""

MAX_BATCH_SIZE = 2**20
"""Largest number of cases of a chunk or of a batch, which are all in memory at once."""

MAX_INSTANTS = 100_000
MAX_SEED = 2**64 - 1
MAX_WORKERS = 4096
MAX_STARTS = 10_000
MIN_LIMIT, MAX_LIMIT = 0.01, 1000.0
"""Range of torque limits, N m; the time that a study covers scales with the limit's root."""

MAX_NAME_LENGTH, MAX_PATH_LENGTH = 255, 4095
"""Largest numbers of bytes of one name, and of a path, on Linux and macOS."""

MAX_VALUE_LENGTH = 60
"""Number of characters of a wrong value that a message shows."""

_WHOLE = re.compile(r"[+-]?\d{1,40}(\.\d{1,40})?([eE][+-]?\d{1,2})?", re.ASCII)


def mistake(option: str, must: str, got: object) -> UserMistake:
    """Return the mistake of an option in the form of every message."""
    return UserMistake(
        f"{option}: must be {must}, got {clean(str(got), MAX_VALUE_LENGTH) or 'nothing'}"
    )


def option_mistake(
    error: BaseException, options: Container[str], otherwise: str = ""
) -> UserMistake:
    """Return a library error as a mistake, under the option of the wrong argument if in `options`.

    For an error caused by an `ArgumentError`, the cause counts; `otherwise` begins the text of any
    other error.
    """
    cause = error if isinstance(error, ArgumentError) else error.__cause__
    if isinstance(cause, ArgumentError) and cause.argument in options:
        got = "" if cause.got is None else f", got {cause.got}"
        return UserMistake(f"--{cause.argument}: {cause.rule}{got}")
    return UserMistake(f"{otherwise}{error}")


def _converter(convert: Callable[[str, str], Any]) -> Callable:
    def converter(kind: Any, tokens: Sequence[Any]) -> Any:
        (token,) = tokens
        return convert(token.keyword or "", token.value)

    return converter


def whole(least: int, most: int) -> Callable:
    """Return a converter to whole numbers, which may be written like 1e6 but not like 1.5."""

    def convert(option: str, text: str) -> int:
        if _WHOLE.fullmatch(text):
            value = decimal.Decimal(text)
            if least <= value <= most and value == value.to_integral_value():
                return int(value)
        raise mistake(option, f"a whole number from {least} to {most}", text)

    return _converter(convert)


def number(least: float, most: float, *, open_ends: bool = False) -> Callable:
    """Return a converter to numbers in a range, with or without its ends."""

    def convert(option: str, text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if (least < value < most) if open_ends else (least <= value <= most):
            return value
        form = "between {:g} and {:g}" if open_ends else "from {:g} to {:g}"
        raise mistake(option, f"a number {form.format(least, most)}", text)

    return _converter(convert)


def place(option: str, text: str) -> Path:
    """Return a path that a file system accepts."""
    names = [os.fsencode(name) for name in Path(text).parts]
    if not text or "\0" in text:
        raise mistake(option, "a path", text)
    too_long = len(os.fsencode(text)) > MAX_PATH_LENGTH
    if too_long or any(len(name) > MAX_NAME_LENGTH for name in names):
        must = f"a path of at most {MAX_PATH_LENGTH} bytes, each name of at most {MAX_NAME_LENGTH}"
        raise mistake(option, must, text)
    return Path(text)


def something(option: str, text: str) -> str:
    """Return a text that is not empty."""
    if not text.strip():
        raise mistake(option, "given with a value", text)
    return text


Digits = Annotated[int | None, Parameter(converter=whole(1, MOST_DIGITS))]

Cases = Annotated[int, Parameter(name=["--count", "-n"], converter=whole(1, MAX_CASES))]
Case = Annotated[int | None, Parameter(converter=whole(0, MAX_CASES - 1))]
Seed = Annotated[int, Parameter(converter=whole(0, MAX_SEED))]
OptionalSeed = Annotated[int | None, Parameter(converter=whole(0, MAX_SEED))]
BatchSize = Annotated[int, Parameter(converter=whole(1, MAX_BATCH_SIZE))]
OptionalBatchSize = Annotated[int | None, Parameter(converter=whole(1, MAX_BATCH_SIZE))]
Instants = Annotated[int | None, Parameter(converter=whole(2, MAX_INSTANTS))]
Workers = Annotated[int | None, Parameter(converter=whole(1, MAX_WORKERS))]
TorqueLimits = Annotated[tuple[str, ...], Parameter(negative="")]
End = Literal["settled", "rest"]
"""End of a manoeuvre: within the settling tolerances, or exactly at rest."""

Starts = Annotated[int, Parameter(converter=whole(1, MAX_STARTS))]
StartsOrNone = Annotated[int, Parameter(converter=whole(0, MAX_STARTS))]
OptionalPath = Annotated[Path | None, Parameter(converter=_converter(place))]
Text = Annotated[str | None, Parameter(converter=_converter(something))]
Flag = Annotated[bool, Parameter(negative="")]
Overrides = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative="",
        help="KEY=VALUE that replaces a value of the scenario, such as simulation.duration_s=600; "
        "may be given several times.",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Printed:
    """Option of every command that only prints.

    Parameters
    ----------
    quiet
        Print nothing but the result, warnings and errors.
    """

    quiet: Flag = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """Options of every command that writes files.

    The docstring of a command overrides the text of an option with another meaning in it.

    Parameters
    ----------
    out
        Output folder; by default jaxsat-NAME in the current folder.
    overwrite
        Replace the folder if jaxsat wrote it.
    quiet
        Print only warnings and errors.
    """

    out: OptionalPath = None
    overwrite: Flag = False
    quiet: Flag = False


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Results(Output):
    """Options of every command that writes results with reports.

    Parameters
    ----------
    report
        Also write a report, as `jaxsat report` does: report.html in the output folder, or the given
        file.
    overwrite
        Replace the folder, or the file of --report, if jaxsat wrote it.
    digits
        Significant digits of the numbers that are printed, at least; by default about four.
    """

    report: Annotated[bool | Path, Parameter(negative="")] = False
    digits: Digits = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Resumable(Results):
    """Options of every command that runs many cases and resumes after an interruption.

    Parameters
    ----------
    engine
        As for `jaxsat montecarlo`.
    workers
        Threads, each of which computes one chunk; by default the number of processors.
    overwrite
        Replace the file of --report; results in the folder are resumed.
    yes
        Start even if the work exceeds the limits of steps, memory or disk.
    elsewhere
        Resume what was started with other versions or on another processor, if the programs are the
        same.
    """

    engine: Literal["auto", "native", "scan", "diffrax"] = "auto"
    workers: Workers = None
    yes: Flag = False
    elsewhere: Flag = False


def torque_limits(texts: Sequence[str]) -> list[float]:
    """Return the requested torque limits (N m), each once."""
    from jaxsat.synthesis.comparison.acceptance import LIMITS

    limits: list[float] = []
    for text in texts:
        try:
            values = LIMITS if text == "all" else (float(text),)
        except ValueError:
            values = (math.nan,)
        if not all(MIN_LIMIT <= one <= MAX_LIMIT for one in values):
            must = f"a number of N m from {MIN_LIMIT:g} to {MAX_LIMIT:g}, or all"
            raise mistake("--torque-limit", must, text)
        limits += values
    return list(dict.fromkeys(limits))
