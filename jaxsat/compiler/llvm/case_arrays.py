"""Functions in LLVM that move numbers between arrays of cases and the lanes of vectors."""

from jaxsat.compiler.llvm.emitter import ALIGNMENT


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
