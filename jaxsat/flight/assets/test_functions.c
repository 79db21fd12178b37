#ifndef CONTROLLER
#define CONTROLLER "controller.c"
#endif
#include CONTROLLER

@TABLES@static bool same(@REAL@ x, @REAL@ y)
{
  return (memcmp(&x, &y, sizeof(x)) == 0) || ((x != x) && (y != y));
}

/* How many results differ. */
int test_functions(void);
int test_functions(void)
{
  @REAL@ found[@MOST@] = {0};
  int wrong = same(found[0], found[0]) ? 0 : 1;
@CALLS@  return wrong;
}
