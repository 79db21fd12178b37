"""README.md of an export, and trace.csv: the Python origin of each function of controller.c."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import jaxsat
from jaxsat.compiler.c.naming import line_of
from jaxsat.core.text import csv_text
from jaxsat.flight.guard import RATE_LIMIT, groups, status_bits
from jaxsat.flight.interface import is_of_plan
from jaxsat.flight.measure import DEAREST, ProcessorUse
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.request import Request
from jaxsat.flight.templates import DEVIATIONS, template
from jaxsat.flight.vectors import EDGES, Vectors

SHOWN = 12
"""Numbers of an array that the table of parameters shows; controller.c has all."""


def readme(
    request: Request,
    program: FlightProgram,
    vectors: Vectors,
    calls: Vectors,
    uses: Mapping[str, ProcessorUse],
    lines: int,
    unsearched: str,
) -> str:
    """Return the text: content and provenance of an export, building, testing and calling."""
    versions = request.provenance["versions"]
    version_rows = "\n".join(f"| {name} | {version} |" for name, version in versions.items())
    functions = "the C library's" if request.libm else "in controller.c, those of the native engine"
    return template(
        "README.md",
        TITLE=request.title,
        PARTS="estimator, " * program.estimates + "law, allocation and modulation",
        PROGRAM=program.hash,
        PRECISION="single" if program.single else "double",
        FUNCTIONS=functions,
        LINES=lines,
        VERSIONS=version_rows,
        CREATED=request.provenance["created"],
        PLATFORM=request.provenance["platform"],
        SAMPLES=len(vectors.given),
        EDGES=EDGES,
        CALLS=len(calls.given),
        SEARCH=_search(unsearched),
        AGREEMENT=_agreement(request),
        ATTITUDE="first_attitude, " * program.estimates,
        PERIOD=f"{float(np.asarray(program.period)):.9g}",
        FLAGS=", ".join(f".{group.name} = true" for group in groups(program)),
        RATE_LIMIT=f"{RATE_LIMIT:g}",
        HOLD_SAMPLES=request.hold_samples,
        STATUS=_status(program),
        MEASUREMENTS="\n\n".join(
            f"{name}:\n\n{_measurement(use, vectors)}" for name, use in uses.items()
        ),
        ESTIMATOR=" and the estimator" * program.estimates,
        SINGLE=_precision(program),
        PARAMETERS=_parameters(program),
        PLAN=_plan(program),
        DEVIATIONS="\n".join(f"- {rule}: {why}" for rule, why in DEVIATIONS.items()),
    )


def _precision(program: FlightProgram) -> str:
    if not program.single:
        return ""
    return (
        "\nSingle precision costs the difference between the settled fraction of that study and\n"
        "of the same one without `--controller`, or with a library exported without `--float`:\n"
        "same cases, same seed.\n"
    )


def _plan(program: FlightProgram) -> str:
    if not any(map(is_of_plan, program.structs["parameters"].fields)):
        return ""
    return (
        "\nThe law follows the plan in the parameters. `controller_load_plan` (controller_plan.h)\n"
        "puts another one in its place, if it is in range and has the checksum that is given.\n"
        "`plan.h` and `plan.csv` have the first plan; `jaxsat export scenario.toml --plan-begin`\n"
        "makes further ones.\n"
    )


def _status(program: FlightProgram) -> str:
    bits = status_bits(program).items()
    return "\n".join(f"- `{name}` ({number}): {words}" for name, (number, words) in bits)


def _agreement(request: Request) -> str:
    if request.libm:
        return (
            "The C library's elementary functions differ in their last bits, and differences of "
            "their results by more (hundreds of units in the last place), so `make test` reports "
            "the largest difference and allows it."
        )
    return "All bits must agree."


def _search(unsearched: str) -> str:
    if unsearched:
        return f"No calls were searched for that run other branches: {unsearched}."
    return (
        "They include calls that were searched for until they run branches which no other call ran."
    )


def _emulated_vectors(numbers: ProcessorUse, vectors: Vectors) -> str:
    """Describe the test vectors over which instructions were counted."""
    if numbers.samples == len(vectors.given):
        return "the test vectors"
    return (
        f"{numbers.samples} test vectors: all that run a block of code which none before ran, "
        f"and the {DEAREST} that run most blocks"
    )


def _measurement(numbers: ProcessorUse, vectors: Vectors) -> str:
    samples = _emulated_vectors(numbers, vectors)
    rows = {
        f"instructions of a step, the most over {samples}": numbers.instructions,
        "instructions of a step behind the guard": numbers.guarded,
        "instructions of the longest path through a step, whatever the input": numbers.bound,
        "instructions of the longest path behind the guard": numbers.guarded_bound,
        "bytes of stack at most": numbers.stack,
        "bytes of stack behind the guard at most": numbers.guarded_stack,
        "bytes of code and constants": numbers.code,
    }
    measurements = [f"- {name}: {number}" for name, number in rows.items() if number is not None]
    return "\n".join([*measurements, *([f"- not measured: {numbers.why}"] if numbers.why else [])])


def _parameters(program: FlightProgram) -> str:
    lines = ["| field | value |", "|---|---|"]
    for field in program.structs["parameters"].fields:
        value = np.asarray(program.parameters[field.number])
        text = str(value.tolist()) if value.size <= SHOWN else f"{value.size} numbers"
        lines.append(f"| `{field.path}` | {text} |")
    return "\n".join(lines)


COLUMNS = ("function", "line", "part_of", "python_function", "python_file", "python_line")

_HEAD = re.compile(r"^(?!typedef|struct)\w[^;{}=#/]*?\b(\w+)\([^;{}]*?\)\s*\{$", re.M)


def trace_table(program: FlightProgram, code: str) -> str:
    """Return a row for each function of a program's C text, in the order of that text.

    A function made of several equal Python functions has a row for each. A part has the Python
    function of the whole. The interface, elementary functions and operations on numbers and arrays
    have none.
    """
    rows: list[Sequence[object]] = [COLUMNS]
    for match in _HEAD.finditer(code):
        name, line = match[1], code.count("\n", 0, match.start()) + 1
        whole = program.wholes.get(name, "")
        places = {
            (one.name, _short(one.file), line_of(one.file, one.name))
            for one in program.origins.get(whole or name, ())
        }
        here = sorted(places, key=str) or [("", "", None)]
        rows += [(name, line, whole, *place) for place in here]
    return csv_text(rows)


def _short(file: str) -> str:
    """Return a file from its package on, or its name alone."""
    path, root = Path(file), Path(jaxsat.__file__).parent.parent
    if path.is_relative_to(root):
        return path.relative_to(root).as_posix()
    above, packages, inside = path.as_posix().rpartition("/site-packages/")
    return inside if above and packages else path.name
