/* For every sample, how many blocks of code its step runs, and whether any ran in none before. */
#include "controller_records.h"

#include <stdio.h>

#define GIVEN (CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE)
#define EXPECTED (CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE)
#define PLACES (1u << 20)

void __sanitizer_cov_trace_pc(void);

static uintptr_t seen[PLACES];
static unsigned long blocks;
static int is_new;

/* The compiler calls it at the beginning of every block of controller.c. */
void __sanitizer_cov_trace_pc(void)
{
  const uintptr_t here = (uintptr_t)__builtin_return_address(0);
  uintptr_t place = here % PLACES;
  while ((seen[place] != 0u) && (seen[place] != here)) {
    place = (place + 1u) % PLACES;
  }
  is_new |= (seen[place] == 0u);
  seen[place] = here;
  blocks++;
}

int main(void)
{
  static controller_input in;
  static controller_state state;
  static controller_output out;
  static double row[GIVEN + EXPECTED];
  double head[4];
  FILE *file = fopen("test_vectors.bin", "rb");
  if ((file == NULL) || (fread(head, sizeof(double), 4, file) != 4)) {
    return 2;
  }
  for (long sample = 0; sample < (long)head[1]; sample++) {
    if (fread(row, sizeof(double), GIVEN + EXPECTED, file) != GIVEN + EXPECTED) {
      return 2;
    }
    read_controller_input(row, &in);
    read_controller_state(row + CONTROLLER_INPUT_SIZE, &state);
    blocks = 0;
    is_new = 0;
    controller_step(&controller_default_parameters, &in, &state, &out);
    printf("%lu %d\n", blocks, is_new);
  }
  return 0;
}
