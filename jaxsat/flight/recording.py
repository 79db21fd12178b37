"""A recorded flight for a host: inputs of samples in order, and the commands of each as text."""

import numpy as np
from jaxtyping import Float

from jaxsat.core.text import csv_text
from jaxsat.flight import vectors
from jaxsat.flight.calls import trees_of
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

LENGTH = 200
"""Largest number of samples of a recording."""


def recorded_flight(reference: vectors.Reference, samples: Float[np.ndarray, "n given"]) -> str:
    """Return inputs and commands as comma-separated values, with a line of names.

    The inputs are those of the first run of `samples` (rows of inputs and states), numbered from
    the first. The controller begins with it, and keeps its own state from then on.
    """
    program = reference.program
    structs = program.structs
    inputs = samples[: min(LENGTH, vectors.SAMPLES), : structs["input"].size].copy()
    inputs[:, 0] = np.arange(len(inputs))  # the number of the sample
    none = np.zeros((1, structs["state"].size))
    first = trees_of(program, inputs[:1], none)[0]
    attitude = first.measured.attitude if program.estimates else np.zeros((1, 0))
    state, rows = reference.begin(attitude, first), []
    for row in inputs:
        now, before = trees_of(program, row[None], state)
        results = reference.step(now, before)[0]
        commands = results[: structs["output"].size]
        state = results[None, structs["output"].size :]
        rows.append([_text(x) for x in (*row, *commands)])
    names = [text for one in ("input", "output") for text in structs[one].elements("")]
    return csv_text([names, *rows])


def _text(x: float) -> str:
    """Return the shortest decimal that is read back to the same bits."""
    return repr(float(x)).removesuffix(".0")


def recording_program(program: FlightProgram) -> str:
    """Return run_controller.c, which flies a recording on a host."""
    field = next((x.name for x in program.structs["input"].fields if x.path == "attitude"), "")
    return template("run_controller.c", ATTITUDE=f"in.{field}, " * program.estimates)
