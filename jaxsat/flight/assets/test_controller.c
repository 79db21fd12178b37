#include "controller_calls.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAGIC (@MAGIC@.0)
#define MAGIC_OF_CALLS (@MAGIC_OF_CALLS@.0)
#define GIVEN (CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE)
#define EXPECTED (CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE)

/* Numbers of the controller's type in order: neighbours differ by one, and so do both zeros. */
static int64_t ordered(double x)
{
  const @REAL@ number = (@REAL@)x;
  @WORD@ bits;
  memcpy(&bits, &number, sizeof(bits));
  return (bits < 0) ? ((int64_t)@LEAST@ - (int64_t)bits - 1) : (int64_t)bits;
}

/* How many numbers lie between two; not a number is the same as another one. */
static double distance(double x, double y)
{
  if (isnan(x) || isnan(y)) {
    return (isnan(x) && isnan(y)) ? 0.0 : HUGE_VAL;
  }
  const int64_t first = ordered(x);
  const int64_t second = ordered(y);
  const uint64_t apart = (first > second) ? ((uint64_t)first - (uint64_t)second)
                                          : ((uint64_t)second - (uint64_t)first);
  return (double)apart;
}

static void fail(const char *name)
{
  fprintf(stderr, "%s: cannot be read, or belongs to another controller\n", name);
  exit(2);
}

static double row[CALL_SIZE + EXPECTED];
static double found[EXPECTED];

/* A sample with the default parameters. */
static void step(void)
{
  controller_input in;
  controller_state state;
  controller_output out;

  read_controller_input(row, &in);
  read_controller_state(row + CONTROLLER_INPUT_SIZE, &state);
  controller_step(&controller_default_parameters, &in, &state, &out);
  write_controller_output(&out, found);
  write_controller_state(&state, found + CONTROLLER_OUTPUT_SIZE);
}

#ifdef TEST_FUNCTIONS
int test_functions(void);
#endif

/* test_controller [FILE [ULP]]: compares every sample or call of the file, allowing so many units in
   the last place. */
int main(int count, char **words)
{
  const char *name = (count > 1) ? words[1] : "test_vectors.bin";
  const double allowed = (count > 2) ? atof(words[2]) : 0.0;
  double head[4];
  bool calls;
  size_t given;
  double largest = 0.0;
  long wrong = 0;
  long rows;
  FILE *file = fopen(name, "rb");

#ifdef TEST_FUNCTIONS
  wrong = test_functions();
  printf("elementary functions: %ld numbers differ\n", wrong);
#endif
  if ((file == NULL) || (fread(head, sizeof(double), 4, file) != 4)) {
    fail(name);
  }
  calls = head[0] == MAGIC_OF_CALLS;
  given = calls ? CALL_SIZE : GIVEN;
  if ((!calls && (head[0] != MAGIC)) || (head[2] != (double)given) || (head[3] != EXPECTED)) {
    fail(name);
  }
  rows = (long)head[1];
  for (long number = 0; number < rows; number++) {
    if (fread(row, sizeof(double), given + EXPECTED, file) != given + EXPECTED) {
      fail(name);
    }
    if (calls) {
      make_call(row, found);
    } else {
      step();
    }
    for (int i = 0; i < EXPECTED; i++) {
      const double off = distance(found[i], row[given + (size_t)i]);
      if (off > largest) {
        largest = off;
      }
      if (off > allowed) {
        if (wrong < 10) {
          printf("%s %ld, number %d: %.17g, expected %.17g\n", calls ? "call" : "sample", number,
                 i, found[i], row[given + (size_t)i]);
        }
        wrong++;
      }
    }
  }
  fclose(file);
  printf("%ld %s, %ld numbers differ, largest difference %g units in the last place\n", rows,
         calls ? "calls" : "samples", wrong, largest);
  return (wrong == 0) ? 0 : 1;
}
