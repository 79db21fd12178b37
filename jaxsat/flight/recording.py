"""A recorded flight for a host: inputs of samples in order, and the commands of each."""

import numpy as np
from jaxtyping import Float

from jaxsat.core.text import csv_text
from jaxsat.flight.calls import trees_of
from jaxsat.flight.guard import first_attitude, has_tracker, real_type
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.reference import Reference
from jaxsat.flight.templates import template

Recording = Float[np.ndarray, "samples numbers"]
"""Rows of inputs, then commands."""


def recorded_flight(reference: Reference, inputs: Float[np.ndarray, "samples inputs"]) -> Recording:
    """Return inputs of consecutive samples with the commands of each.

    The controller begins with the first sample, and keeps its own state from then on.
    """
    program = reference.program
    structs = program.structs
    none = np.zeros((1, structs["state"].size))
    first = trees_of(program, inputs[:1], none)[0]
    attitude = np.zeros((1, 0))
    if program.estimates:
        measured = first.measured.attitude if has_tracker(program) else program.attitude
        attitude = np.asarray(measured, float).reshape(1, 4)
    state, rows = reference.begin(attitude, first), []
    for row in inputs:
        now, before = trees_of(program, row[None], state)
        results = reference.step(now, before)[0]
        rows.append([*row, *results[: structs["output"].size]])
        state = results[None, structs["output"].size :]
    return np.array(rows)


def recording_text(program: FlightProgram, recording: Recording) -> str:
    """Return a recording as comma-separated values, with a line of names."""
    names = [text for one in ("input", "output") for text in program.structs[one].elements("")]
    return csv_text([names, *([_text(x) for x in row] for row in recording)])


def _text(x: float) -> str:
    """Return the shortest decimal that is read back to the same bits."""
    return repr(float(x)).removesuffix(".0")


def rounding(program: FlightProgram, recording: Recording) -> float:
    """Return the difference of commands that round-off of another C library may make.

    It is the cube root of the relative precision of the floats, as a part of the largest command;
    of the fields of `controller_output`, each with commands of one unit, the smallest one counts.
    """
    place, sizes = program.structs["input"].size, []
    for field in program.structs["output"].fields:
        commands = np.abs(recording[:, place : place + field.size])
        place += field.size
        if field.dtype.kind == "f":
            sizes.append(np.max(commands, initial=0.0, where=np.isfinite(commands)))
    kind = np.float32 if program.single else np.float64
    least = min((size for size in sizes if size > 0), default=0.0)
    return float(np.cbrt(np.finfo(kind).eps) * least)


def recording_program(program: FlightProgram) -> str:
    """Return run_controller.c, which flies a recording on a host."""
    if not program.estimates:
        return template("run_controller.c", ATTITUDE="")
    attitude = f"(const {real_type(program)}[4]){first_attitude(program)[0]}"
    if has_tracker(program):
        fields = program.structs["input"].fields
        attitude = f"in.{next(one.name for one in fields if one.path == 'attitude')}"
    return template("run_controller.c", ATTITUDE=f"{attitude}, ")
