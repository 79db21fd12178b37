define internal void @NAME@(ptr %base, <@LANES@ x i64> %index, ptr %place, i64 %count, <@LANES@ x i1> %lane) noinline #0 {
entry:
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %next, %head ]
  %one = insertelement <@LANES@ x i64> poison, i64 %i, i64 0
  %further = shufflevector <@LANES@ x i64> %one, <@LANES@ x i64> poison, <@LANES@ x i32> zeroinitializer
  %here = add <@LANES@ x i64> %index, %further
  %new = call <@LANES@ x @KIND@> @gather.@KIND@(ptr %base, <@LANES@ x i64> %here)
  %offset = mul i64 %i, @ALIGNMENT@
  %where = getelementptr i8, ptr %place, i64 %offset
  %old = load <@LANES@ x @KIND@>, ptr %where
  %kept = select <@LANES@ x i1> %lane, <@LANES@ x @KIND@> %new, <@LANES@ x @KIND@> %old
  store <@LANES@ x @KIND@> %kept, ptr %where
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %head, label %out
out:
  ret void
}
