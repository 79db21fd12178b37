"""The loops around stages, in LLVM: over blocks of cases, or lanes that finish by themselves."""

from collections.abc import Sequence


def run_blocks(lanes: int, stages: Sequence[str]) -> str:
    """`run(pointers, state, begin, end, a, b)`: the stages, vector after vector of cases.

    The last vector's spare lanes compute its last case again and write nothing.
    """
    numbers = ", ".join(f"i64 {lane}" for lane in range(lanes))
    arguments = "ptr %pointers, ptr %state, ptr %cases, ptr %wanted, i64 %a, i64 %b"
    calls = "\n".join(f"  call void @{stage}({arguments})" for stage in stages)
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
