define void @advance(ptr %pointers, ptr %state, ptr %cases, ptr %wanted, i64 %a, i64 %b) noinline #0 {
entry:
  %mask = alloca <@LANES@ x i8>, align 128
  %flags = getelementptr i8, ptr %state, i64 @GOING@
  %lane = load <@LANES@ x i8>, ptr %wanted, align 1
  br label %head
head:
  call void @going(ptr %pointers, ptr %state, ptr %cases, ptr %wanted, i64 %a, i64 %b)
  %on = load <@LANES@ x i8>, ptr %flags
  %active = and <@LANES@ x i8> %lane, %on
  store <@LANES@ x i8> %active, ptr %mask
  %bits = bitcast <@LANES@ x i8> %active to i@BITS@
  %any = icmp ne i@BITS@ %bits, 0
  br i1 %any, label %work, label %out
work:
  call void @attempt(ptr %pointers, ptr %state, ptr %cases, ptr %mask, i64 %a, i64 %b)
  br label %head
out:
  ret void
}
