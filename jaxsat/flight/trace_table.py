"""trace.csv: the Python origin of each function of controller.c."""

import re
from collections.abc import Sequence
from pathlib import Path

import jaxsat
from jaxsat.compiler.c.naming import line_of
from jaxsat.core.text import csv_text
from jaxsat.flight.program import FlightProgram

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
