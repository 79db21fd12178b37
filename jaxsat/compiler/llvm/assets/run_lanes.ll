define void @run(ptr %pointers, ptr %state, i64 %begin, i64 %end, i64 %a, i64 %b) #0 {
entry:
  %cases = alloca <@LANES@ x i64>, align 128
  %fresh = alloca <@LANES@ x i8>, align 128
  %running = alloca <@LANES@ x i8>, align 128
  %ended = alloca <@LANES@ x i8>, align 128
  %flags = getelementptr i8, ptr %state, i64 @GOING@
  %one = insertelement <@LANES@ x i64> poison, i64 %begin, i64 0
  %first = shufflevector <@LANES@ x i64> %one, <@LANES@ x i64> poison, <@LANES@ x i32> zeroinitializer
  store <@LANES@ x i64> %first, ptr %cases
  store <@LANES@ x i8> zeroinitializer, ptr %running
  store <@LANES@ x i8> splat (i8 1), ptr %ended
  br label %assign
assign:
  %next0 = phi i64 [ %begin, %entry ], [ %next@LANES@, %finish ]
@ASSIGN@
  %before = load <@LANES@ x i8>, ptr %running
  %gone = load <@LANES@ x i8>, ptr %ended
  %stay = xor <@LANES@ x i8> %gone, splat (i8 1)
  %kept = and <@LANES@ x i8> %before, %stay
  %new = load <@LANES@ x i8>, ptr %fresh
  %now = or <@LANES@ x i8> %kept, %new
  store <@LANES@ x i8> %now, ptr %running
  call void @begin(ptr %pointers, ptr %state, ptr %cases, ptr %fresh, i64 %a, i64 %b)
  br label %head
head:
  call void @going(ptr %pointers, ptr %state, ptr %cases, ptr %running, i64 %a, i64 %b)
  %lane = load <@LANES@ x i8>, ptr %running
  %on = load <@LANES@ x i8>, ptr %flags
  %off = xor <@LANES@ x i8> %on, splat (i8 1)
  %over = and <@LANES@ x i8> %lane, %off
  %overbits = bitcast <@LANES@ x i8> %over to i@BITS@
  %anyover = icmp ne i@BITS@ %overbits, 0
  br i1 %anyover, label %finish, label %check
finish:
  store <@LANES@ x i8> %over, ptr %ended
  call void @finish(ptr %pointers, ptr %state, ptr %cases, ptr %ended, i64 %a, i64 %b)
  br label %assign
check:
  %lanebits = bitcast <@LANES@ x i8> %lane to i@BITS@
  %any = icmp ne i@BITS@ %lanebits, 0
  br i1 %any, label %work, label %out
work:
  call void @attempt(ptr %pointers, ptr %state, ptr %cases, ptr %running, i64 %a, i64 %b)
  br label %head
out:
  ret void
}
