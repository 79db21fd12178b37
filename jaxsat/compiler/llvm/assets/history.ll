define void @history(ptr %pointers, ptr %state, ptr %cases, ptr %wanted, ptr %places, ptr %instants, ptr %advance, i64 %count, i64 %stride, i64 %before) #0 {
entry:
  %one = insertelement <@LANES@ x i64> poison, i64 %stride, i64 0
  %further = shufflevector <@LANES@ x i64> %one, <@LANES@ x i64> poison, <@LANES@ x i32> zeroinitializer
  br label %work
work:
  %i = phi i64 [ 0, %entry ], [ %next, %work ]
  %from = phi i64 [ %before, %entry ], [ %number, %work ]
  %here = getelementptr i64, ptr %instants, i64 %i
  %number = load i64, ptr %here
  %by = sub i64 %number, %from
  call void %advance(ptr %pointers, ptr %state, ptr %cases, ptr %wanted, i64 %from, i64 %by)
  call void @observe(ptr %pointers, ptr %state, ptr %places, ptr %wanted, i64 %number, i64 0)
  %place = load <@LANES@ x i64>, ptr %places
  %moved = add <@LANES@ x i64> %place, %further
  store <@LANES@ x i64> %moved, ptr %places
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %work, label %out
out:
  ret void
}
