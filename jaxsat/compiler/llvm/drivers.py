"""Functions in LLVM: loops around entry points, over blocks of cases or lanes that finish by
themselves, and moves of numbers between arrays of cases and the lanes of vectors."""

import ctypes
from collections.abc import Sequence

from jaxsat.compiler.llvm.emitter import ALIGNMENT

RUN = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 4)
"""The type of the drivers `run`."""

HISTORY = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 7, *[ctypes.c_int64] * 3)
"""The type of the driver `history`."""


def run_blocks(lanes: int, entries: Sequence[str]) -> str:
    """`run(pointers, state, begin, end, a, b)`: the entry points, vector after vector of cases.

    The last vector's spare lanes compute its last case again and write nothing.
    """
    numbers = ", ".join(f"i64 {lane}" for lane in range(lanes))
    arguments = "ptr %pointers, ptr %state, ptr %cases, ptr %wanted, i64 %a, i64 %b"
    calls = "\n".join(f"  call void @{entry}({arguments})" for entry in entries)
    spread = f"<{lanes} x i64> poison, <{lanes} x i32> zeroinitializer"
    return f"""
define void @run(ptr %pointers, ptr %state, i64 %begin, i64 %end, i64 %a, i64 %b) #0 {{
entry:
  %cases = alloca <{lanes} x i64>, align 128
  %wanted = alloca <{lanes} x i8>, align 128
  %last = sub i64 %end, 1
  %one = insertelement <{lanes} x i64> poison, i64 %last, i64 0
  %top = shufflevector <{lanes} x i64> %one, {spread}
  br label %head
head:
  %first = phi i64 [ %begin, %entry ], [ %next, %work ]
  %more = icmp slt i64 %first, %end
  br i1 %more, label %work, label %out
work:
  %f = insertelement <{lanes} x i64> poison, i64 %first, i64 0
  %all = shufflevector <{lanes} x i64> %f, {spread}
  %number = add <{lanes} x i64> %all, <{numbers}>
  %there = icmp sle <{lanes} x i64> %number, %top
  %safe = select <{lanes} x i1> %there, <{lanes} x i64> %number, <{lanes} x i64> %top
  %bytes = zext <{lanes} x i1> %there to <{lanes} x i8>
  store <{lanes} x i64> %safe, ptr %cases
  store <{lanes} x i8> %bytes, ptr %wanted
{calls}
  %next = add i64 %first, {lanes}
  br label %head
out:
  ret void
}}"""


_WHERE = "ptr %pointers, ptr %state, ptr %cases"


def advance_lanes(lanes: int, going: int) -> str:
    """`advance` of trajectories that have a pace each: `attempt` while any is `going`."""
    flags = f"<{lanes} x i8>"
    return f"""
define void @advance({_WHERE}, ptr %wanted, i64 %a, i64 %b) noinline #0 {{
entry:
  %mask = alloca {flags}, align 128
  %flags = getelementptr i8, ptr %state, i64 {going}
  %lane = load {flags}, ptr %wanted, align 1
  br label %head
head:
  call void @going({_WHERE}, ptr %wanted, i64 %a, i64 %b)
  %on = load {flags}, ptr %flags
  %active = and {flags} %lane, %on
  store {flags} %active, ptr %mask
  %bits = bitcast {flags} %active to i{8 * lanes}
  %any = icmp ne i{8 * lanes} %bits, 0
  br i1 %any, label %work, label %out
work:
  call void @attempt({_WHERE}, ptr %mask, i64 %a, i64 %b)
  br label %head
out:
  ret void
}}"""


def run_lanes(lanes: int, going: int) -> str:
    """`run(pointers, state, begin, end, a, b)` where a lane whose case has ended takes the next.

    The entry points are those of `advance_lanes`, so a case has the same bits.
    """
    flags, numbers = f"<{lanes} x i8>", f"<{lanes} x i64>"
    bits = f"i{8 * lanes}"
    assign = "\n".join(_assigned(lane) for lane in range(lanes))
    return f"""
define void @run(ptr %pointers, ptr %state, i64 %begin, i64 %end, i64 %a, i64 %b) #0 {{
entry:
  %cases = alloca {numbers}, align 128
  %fresh = alloca {flags}, align 128
  %running = alloca {flags}, align 128
  %ended = alloca {flags}, align 128
  %flags = getelementptr i8, ptr %state, i64 {going}
  %one = insertelement {numbers} poison, i64 %begin, i64 0
  %first = shufflevector {numbers} %one, {numbers} poison, <{lanes} x i32> zeroinitializer
  store {numbers} %first, ptr %cases
  store {flags} zeroinitializer, ptr %running
  store {flags} splat (i8 1), ptr %ended
  br label %assign
assign:
  %next0 = phi i64 [ %begin, %entry ], [ %next{lanes}, %finish ]
{assign}
  %before = load {flags}, ptr %running
  %gone = load {flags}, ptr %ended
  %stay = xor {flags} %gone, splat (i8 1)
  %kept = and {flags} %before, %stay
  %new = load {flags}, ptr %fresh
  %now = or {flags} %kept, %new
  store {flags} %now, ptr %running
  call void @begin({_WHERE}, ptr %fresh, i64 %a, i64 %b)
  br label %head
head:
  call void @going({_WHERE}, ptr %running, i64 %a, i64 %b)
  %lane = load {flags}, ptr %running
  %on = load {flags}, ptr %flags
  %off = xor {flags} %on, splat (i8 1)
  %over = and {flags} %lane, %off
  %overbits = bitcast {flags} %over to {bits}
  %anyover = icmp ne {bits} %overbits, 0
  br i1 %anyover, label %finish, label %check
finish:
  store {flags} %over, ptr %ended
  call void @finish({_WHERE}, ptr %ended, i64 %a, i64 %b)
  br label %assign
check:
  %lanebits = bitcast {flags} %lane to {bits}
  %any = icmp ne {bits} %lanebits, 0
  br i1 %any, label %work, label %out
work:
  call void @attempt({_WHERE}, ptr %running, i64 %a, i64 %b)
  br label %head
out:
  ret void
}}"""


def history(lanes: int) -> str:
    """`history(pointers, state, cases, wanted, places, instants, advance, count, stride, before)`.

    From the instant `before` on it goes by the entry point `advance` to each of so many instants,
    of which the first may be the same, and observes a vector of cases there. What is seen of a case
    goes to its place, `stride` further each time.
    """
    spread = f"<{lanes} x i64> poison, <{lanes} x i32> zeroinitializer"
    parameters = "ptr %places, ptr %instants, ptr %advance"
    numbers = "i64 %count, i64 %stride, i64 %before"
    return f"""
define void @history({_WHERE}, ptr %wanted, {parameters}, {numbers}) #0 {{
entry:
  %one = insertelement <{lanes} x i64> poison, i64 %stride, i64 0
  %further = shufflevector <{lanes} x i64> %one, {spread}
  br label %work
work:
  %i = phi i64 [ 0, %entry ], [ %next, %work ]
  %from = phi i64 [ %before, %entry ], [ %number, %work ]
  %here = getelementptr i64, ptr %instants, i64 %i
  %number = load i64, ptr %here
  %by = sub i64 %number, %from
  call void %advance({_WHERE}, ptr %wanted, i64 %from, i64 %by)
  call void @observe(ptr %pointers, ptr %state, ptr %places, ptr %wanted, i64 %number, i64 0)
  %place = load <{lanes} x i64>, ptr %places
  %moved = add <{lanes} x i64> %place, %further
  store <{lanes} x i64> %moved, ptr %places
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %work, label %out
out:
  ret void
}}"""


def _assigned(lane: int) -> str:
    """The next case, if there is one, for a lane whose last one has ended."""
    return f"""
  %e{lane} = getelementptr i8, ptr %ended, i64 {lane}
  %f{lane} = getelementptr i8, ptr %fresh, i64 {lane}
  %c{lane} = getelementptr i64, ptr %cases, i64 {lane}
  %byte{lane} = load i8, ptr %e{lane}
  %free{lane} = icmp ne i8 %byte{lane}, 0
  %left{lane} = icmp slt i64 %next{lane}, %end
  %takes{lane} = and i1 %free{lane}, %left{lane}
  %old{lane} = load i64, ptr %c{lane}
  %case{lane} = select i1 %takes{lane}, i64 %next{lane}, i64 %old{lane}
  store i64 %case{lane}, ptr %c{lane}
  %is{lane} = zext i1 %takes{lane} to i8
  store i8 %is{lane}, ptr %f{lane}
  %more{lane} = zext i1 %takes{lane} to i64
  %next{lane + 1} = add i64 %next{lane}, %more{lane}"""


def gather_text(name: str, kind: str, lanes: int) -> str:
    """`gather(base, index)`: every lane's own element of an array."""
    cells = f"<{lanes} x {kind}>"
    lines = [f"define internal {cells} {name}(ptr %base, <{lanes} x i64> %index) noinline #0 {{"]
    whole = "poison"
    for lane in range(lanes):
        lines += [
            f"%i{lane} = extractelement <{lanes} x i64> %index, i64 {lane}",
            f"%p{lane} = getelementptr {kind}, ptr %base, i64 %i{lane}",
            f"%x{lane} = load {kind}, ptr %p{lane}",
            f"%w{lane} = insertelement {cells} {whole}, {kind} %x{lane}, i64 {lane}",
        ]
        whole = f"%w{lane}"
    return "\n".join([*lines, f"ret {cells} {whole}", "}"])


def scatter_text(name: str, kind: str, lanes: int) -> str:
    """`scatter(base, index, value, lane)`: what the lanes chosen put into an array."""
    cells = f"<{lanes} x {kind}>"
    lines = [
        f"define internal void {name}(ptr %base, <{lanes} x i64> %index, {cells} %value, "
        f"<{lanes} x i1> %lane) noinline #0 {{"
    ]
    for lane in range(lanes):
        lines += [
            f"%b{lane} = extractelement <{lanes} x i1> %lane, i64 {lane}",
            f"br i1 %b{lane}, label %put{lane}, label %next{lane}",
            f"put{lane}:",
            f"%i{lane} = extractelement <{lanes} x i64> %index, i64 {lane}",
            f"%p{lane} = getelementptr {kind}, ptr %base, i64 %i{lane}",
            f"%x{lane} = extractelement {cells} %value, i64 {lane}",
            f"store {kind} %x{lane}, ptr %p{lane}",
            f"br label %next{lane}",
            f"next{lane}:",
        ]
    return "\n".join([*lines, "ret void", "}"])


def copy_text(name: str, kind: str, lanes: int) -> str:
    """`copy(base, index, place, count, lane)`: elements of an array, one vector after the other.

    It calls `gather`; vectors are `ALIGNMENT` bytes apart, and lanes not chosen keep theirs.
    """
    cells, numbers = f"<{lanes} x {kind}>", f"<{lanes} x i64>"
    spread = f"{numbers} poison, <{lanes} x i32> zeroinitializer"
    params = f"ptr %base, {numbers} %index, ptr %place, i64 %count, <{lanes} x i1> %lane"
    return f"""
define internal void {name}({params}) noinline #0 {{
entry:
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %next, %head ]
  %one = insertelement {numbers} poison, i64 %i, i64 0
  %further = shufflevector {numbers} %one, {spread}
  %here = add {numbers} %index, %further
  %new = call {cells} @gather.{kind}(ptr %base, {numbers} %here)
  %offset = mul i64 %i, {ALIGNMENT}
  %where = getelementptr i8, ptr %place, i64 %offset
  %old = load {cells}, ptr %where
  %kept = select <{lanes} x i1> %lane, {cells} %new, {cells} %old
  store {cells} %kept, ptr %where
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %head, label %out
out:
  ret void
}}"""
