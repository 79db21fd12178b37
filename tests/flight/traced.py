"""What the trace table of an export must tell of its C text."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import jaxsat
from tests.flight.sizes import sizes

ROOT = Path(jaxsat.__file__).parent.parent


def check_trace(table: str, code: str, others: Sequence[Path] = ()) -> list[dict[str, str]]:
    """The rows, each of which is that of a function of the C and of a definition in Python.

    `others` are files outside of jaxsat's package, which the table has by their names alone.
    """
    rows = list(csv.DictReader(io.StringIO(table)))
    lines = code.splitlines()
    functions = {row["function"] for row in rows}
    assert functions == set(sizes(code))
    for row in rows:
        assert f"{row['function']}(" in "".join(lines[int(row["line"]) - 1 :][:2])
        assert not row["part_of"] or row["part_of"] in functions
        if row["python_function"]:
            names = {file.name: file for file in others}
            file = names.get(row["python_file"], ROOT / row["python_file"])
            definition = file.read_text().splitlines()[int(row["python_line"]) - 1]
            word = row["python_function"].split(".")[-1]
            assert definition.strip().startswith(f"def {word}("), row
    return rows
