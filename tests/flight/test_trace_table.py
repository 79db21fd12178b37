"""The trace table leads from each C function to the Python function that it comes from."""

from pathlib import Path

from jaxsat.flight.program import flight_program
from jaxsat.flight.readme import trace_table
from jaxsat.flight.source import source
from tests.flight import laws
from tests.flight.laws import Sliced, loop_of, start
from tests.flight.traced import check_trace


def test_every_function_of_the_c_has_its_line_and_that_of_its_python_function():
    program = flight_program(loop_of(Sliced(gain=[3.0, 2.0])), start())
    code = source(program, [], libm=False)
    rows = check_trace(trace_table(program, code), code, [Path(laws.__file__)])
    assert [row["line"] for row in rows] == sorted((row["line"] for row in rows), key=int)
    of_python = {
        (row["function"], row["python_function"], Path(row["python_file"]).name) for row in rows
    }
    for name in ("_shrunk", "_power"):
        assert (name.removeprefix("_"), name, "laws.py") in of_python, (laws.__file__, of_python)
    assert {row["function"] for row in rows if "FlightController" in row["python_function"]} >= {
        "begin_law", "control", "allocate",
    }  # fmt: skip
