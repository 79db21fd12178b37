define internal void @NAME@(ptr %base, @INDICES@ %index, ptr %place, i64 %count, @CHOSEN@ %lane) noinline #0 {
entry:
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %next, %head ]
  %here = getelementptr @KIND@, ptr %base, i64 %i
  %new = call @CELLS@ @gather.@KIND@(ptr %here, @INDICES@ %index)
  %offset = mul i64 %i, @ALIGNMENT@
  %where = getelementptr i8, ptr %place, i64 %offset
  %old = load @CELLS@, ptr %where
  %kept = select @CHOSEN@ %lane, @CELLS@ %new, @CELLS@ %old
  store @CELLS@ %kept, ptr %where
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %head, label %out
out:
  ret void
}
