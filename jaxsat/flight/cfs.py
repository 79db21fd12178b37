"""Wrapper of a controller: an app for NASA's Core Flight System (cFS)."""

from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.c.naming import comment
from jaxsat.flight.guard import first_attitude, real_type
from jaxsat.flight.guard_source import default_limits
from jaxsat.flight.interface import Row
from jaxsat.flight.messages import Item, commanded, measured, words_of_modes
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import default_parameters
from jaxsat.flight.templates import template

CFS = "wrappers/cfs/controller_app"
"""Folder of the app in an export."""

FILES = (
    "CMakeLists.txt",
    "controller_app.c",
    "controller_app.h",
    "controller_app_msg.h",
    "controller_app_tbl.h",
    "controller_app_topicids.h",
    "controller_tbl.c",
)

TABLE_LIMIT = 16384
"""Default of CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE, bytes."""

PLACES = {"input": "Input->", "valid": "Valid->", "output": "Output."}


def cfs_app(
    program: FlightProgram, rows: Sequence[Row], intro: Sequence[str], hold_samples: int
) -> dict[str, str]:
    """Return the files of the app by their names, which begin with `CFS`.

    `rows` are those of the interface control document, `hold_samples` the guard's default.
    """
    inputs, outputs = measured(rows), commanded(rows)
    numbers, words = first_attitude(program)
    begin = f"  static const {real_type(program)} attitude[4] = {numbers}; /* {words} */\n\n"
    values = {
        "PERIOD": f"{float(np.asarray(program.period)):.9g}",
        "PROGRAM": program.hash[:12],
        "MODES": words_of_modes(program),
        "MEASUREMENT": _members(inputs),
        "OUTPUT": _members(outputs),
        "READ": "\n".join(
            _copy(item.place_in(PLACES), f"Payload->{item.name}", item) for item in inputs
        ),
        "WRITE": "\n".join(
            _copy(f"Payload->{item.name}", item.place_in(PLACES), item)
            for item in outputs
            if item.place[0]
        ),
        "BEGIN": begin * program.estimates,
        "ATTITUDE": "attitude, " * program.estimates,
        "TABLE_BYTES": table_bytes(program),
        "PARAMETERS": "\n".join(default_parameters(program)),
        "LIMITS": "\n".join(default_limits(program, hold_samples)),
    }
    head = "\n".join(intro)
    return {
        f"{CFS}/{name}": (head if name.endswith((".c", ".h")) else "")
        + template(f"cfs/{name}", **values)
        for name in FILES
    }


def table_bytes(program: FlightProgram) -> int:
    """Return the size of the parameter table (bytes) with each number aligned to its own size."""
    fields = program.structs["parameters"].fields
    parameters = [(field.name, field.dtype, field.shape) for field in fields]
    real = np.float32 if program.single else np.float64
    limits = [("hold_samples", np.int32), ("rate_limit", real), ("norm_tolerance", real)]
    members = (np.dtype(one, align=True) for one in (parameters, limits))
    table = [(f"member{n}", one) for n, one in enumerate(members)]
    return np.dtype([*table, ("Checksum", np.uint32)], align=True).itemsize


def table_cautions(program: FlightProgram) -> tuple[str, ...]:
    """Return the required setting of a mission whose parameter table exceeds cFE's default."""
    size = table_bytes(program)
    if size <= TABLE_LIMIT:
        return ()
    return (
        f"cFS's parameter table has {size} bytes: set CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE, by "
        f"default {TABLE_LIMIT}, to at least that in your mission",
    )


def _members(items: Sequence[Item]) -> str:
    """Return the members of a structure without padding; truth values are bytes."""
    lines = []
    for item in items:
        kind = "uint8_t" if item.type == "bool" else item.type
        sizes = "".join(f"[{size}]" for size in item.shape)
        first, *rest = comment(item.about)
        lines += [f"  {kind} {item.name}{sizes}; {first}", *rest]
    spare = -sum(item.count * item.size for item in items) % max(item.size for item in items)
    return "\n".join([*lines, *[f"  uint8_t spare[{spare}];"] * bool(spare)])


def _copy(to: str, source: str, item: Item) -> str:
    """Return a statement that copies an item; a byte of a message is read as a truth value."""
    if item.shape:
        return f"  (void)memcpy({to}, {source}, sizeof({to}));"
    truth = " != 0u" if item.type == "bool" else ""
    return f"  {to} = {source}{truth};"
