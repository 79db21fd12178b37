"""Functions in LLVM around entry points: loops over cases, and moves of numbers to lanes."""

import ctypes
from collections.abc import Sequence

from jaxsat.compiler.llvm.emitter import ALIGNMENT, extract, insert, vector_of
from jaxsat.core.package_files import template

RUN = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 4)
"""Type of the drivers `run`."""

HISTORY = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 7, *[ctypes.c_int64] * 3)
"""Type of the driver `history`."""


def _text(name: str, **values: object) -> str:
    return "\n" + template("jaxsat.compiler.llvm", f"assets/{name}", **values).removesuffix("\n")


def run_blocks(lanes: int, entries: Sequence[str]) -> str:
    """Return `run(pointers, state, begin, end, a, b)`: the entry points, vector by vector of cases.

    Spare lanes of the last vector compute its last case again and write nothing.
    """
    numbers = ", ".join(f"i64 {lane}" for lane in range(lanes))
    arguments = "ptr %pointers, ptr %state, ptr %cases, ptr %wanted, i64 %a, i64 %b"
    calls = "\n".join(f"  call void @{entry}({arguments})" for entry in entries)
    return _text("run_blocks.ll", LANES=lanes, NUMBERS=numbers, CALLS=calls)


def advance_lanes(lanes: int, going: int) -> str:
    """Return `advance` of trajectories with individual paces: `attempt` while any is `going`."""
    return _text("advance_lanes.ll", LANES=lanes, GOING=going, BITS=8 * lanes)


def run_lanes(lanes: int, going: int) -> str:
    """Return `run(pointers, state, begin, end, a, b)`: a lane whose case has ended takes the next.

    The entry points are those of `advance_lanes`, so a case has the same bits.
    """
    assign = "\n".join(_text("assigned.ll", LANE=lane, NEXT=lane + 1) for lane in range(lanes))
    return _text("run_lanes.ll", LANES=lanes, GOING=going, BITS=8 * lanes, ASSIGN=assign)


def history(lanes: int) -> str:
    """Return the driver `history`, which observes a vector of cases at given instants.

    `history(pointers, state, cases, wanted, places, instants, advance, count, stride, before)` goes
    by the entry point `advance` from the instant `before` to each of `count` instants, of which the
    first may be the same. The observation of a case goes to its place, `stride` further each time.
    """
    return _text("history.ll", LANES=lanes)


def gather_text(name: str, kind: str, lanes: int) -> str:
    """Return `gather(base, index)`: every lane's own element of an array."""
    cells, indices = vector_of(kind, lanes), vector_of("i64", lanes)
    lines = [f"define internal {cells} {name}(ptr %base, {indices} %index) noinline #0 {{"]
    whole = "poison"
    for lane in range(lanes):
        lines += [
            f"%i{lane} = {extract('i64', lanes, '%index', lane)}",
            f"%p{lane} = getelementptr {kind}, ptr %base, i64 %i{lane}",
            f"%x{lane} = load {kind}, ptr %p{lane}",
            f"%w{lane} = {insert(kind, lanes, whole, f'%x{lane}', lane)}",
        ]
        whole = f"%w{lane}"
    return "\n".join([*lines, f"ret {cells} {whole}", "}"])


def scatter_text(name: str, kind: str, lanes: int) -> str:
    """Return `scatter(base, index, value, lane)`: stores of the selected lanes into an array."""
    cells, indices, mask = (vector_of(one, lanes) for one in (kind, "i64", "i1"))
    lines = [
        f"define internal void {name}(ptr %base, {indices} %index, {cells} %value, "
        f"{mask} %lane) noinline #0 {{"
    ]
    for lane in range(lanes):
        lines += [
            f"%b{lane} = {extract('i1', lanes, '%lane', lane)}",
            f"br i1 %b{lane}, label %put{lane}, label %next{lane}",
            f"put{lane}:",
            f"%i{lane} = {extract('i64', lanes, '%index', lane)}",
            f"%p{lane} = getelementptr {kind}, ptr %base, i64 %i{lane}",
            f"%x{lane} = {extract(kind, lanes, '%value', lane)}",
            f"store {kind} %x{lane}, ptr %p{lane}",
            f"br label %next{lane}",
            f"next{lane}:",
        ]
    return "\n".join([*lines, "ret void", "}"])


def copy_text(name: str, kind: str, lanes: int) -> str:
    """Return `copy(base, index, place, count, lane)`: elements of an array, vector by vector.

    It calls `gather`; vectors are `ALIGNMENT` bytes apart, and lanes not selected keep theirs.
    """
    cells, indices, mask = (vector_of(one, lanes) for one in (kind, "i64", "i1"))
    types = {"KIND": kind, "CELLS": cells, "INDICES": indices, "CHOSEN": mask}
    return _text("copy.ll", NAME=name, ALIGNMENT=ALIGNMENT, **types)
