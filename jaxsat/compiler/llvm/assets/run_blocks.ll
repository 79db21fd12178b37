define void @run(ptr %pointers, ptr %state, i64 %begin, i64 %end, i64 %a, i64 %b) #0 {
entry:
  %cases = alloca <@LANES@ x i64>, align 128
  %wanted = alloca <@LANES@ x i8>, align 128
  %last = sub i64 %end, 1
  %one = insertelement <@LANES@ x i64> poison, i64 %last, i64 0
  %top = shufflevector <@LANES@ x i64> %one, <@LANES@ x i64> poison, <@LANES@ x i32> zeroinitializer
  br label %head
head:
  %first = phi i64 [ %begin, %entry ], [ %next, %work ]
  %more = icmp slt i64 %first, %end
  br i1 %more, label %work, label %out
work:
  %f = insertelement <@LANES@ x i64> poison, i64 %first, i64 0
  %all = shufflevector <@LANES@ x i64> %f, <@LANES@ x i64> poison, <@LANES@ x i32> zeroinitializer
  %number = add <@LANES@ x i64> %all, <@NUMBERS@>
  %there = icmp sle <@LANES@ x i64> %number, %top
  %safe = select <@LANES@ x i1> %there, <@LANES@ x i64> %number, <@LANES@ x i64> %top
  %bytes = zext <@LANES@ x i1> %there to <@LANES@ x i8>
  store <@LANES@ x i64> %safe, ptr %cases
  store <@LANES@ x i8> %bytes, ptr %wanted
@CALLS@
  %next = add i64 %first, @LANES@
  br label %head
out:
  ret void
}
