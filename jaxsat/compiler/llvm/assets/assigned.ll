  %e@LANE@ = getelementptr i8, ptr %ended, i64 @LANE@
  %f@LANE@ = getelementptr i8, ptr %fresh, i64 @LANE@
  %c@LANE@ = getelementptr i64, ptr %cases, i64 @LANE@
  %byte@LANE@ = load i8, ptr %e@LANE@
  %free@LANE@ = icmp ne i8 %byte@LANE@, 0
  %left@LANE@ = icmp slt i64 %next@LANE@, %end
  %takes@LANE@ = and i1 %free@LANE@, %left@LANE@
  %old@LANE@ = load i64, ptr %c@LANE@
  %case@LANE@ = select i1 %takes@LANE@, i64 %next@LANE@, i64 %old@LANE@
  store i64 %case@LANE@, ptr %c@LANE@
  %is@LANE@ = zext i1 %takes@LANE@ to i8
  store i8 %is@LANE@, ptr %f@LANE@
  %more@LANE@ = zext i1 %takes@LANE@ to i64
  %next@NEXT@ = add i64 %next@LANE@, %more@LANE@
