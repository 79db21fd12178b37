/* Start-up code for an emulated Cortex-M4F (mps2-an386) or Cortex-M7 (mps2-an500), and how many
   instructions a step takes, and one behind the guard. */
#include "controller_guard.h"
#include "controller_records.h"

#include <stdio.h>
#include <string.h>

extern void _start(void);

/* Access to coprocessors: 10 and 11 are the floating-point unit, off after a reset. */
#define COPROCESSOR_ACCESS (*(volatile uint32_t *)0xE000ED88u)

static void reset(void)
{
  COPROCESSOR_ACCESS |= 0xFu << 20;
  __asm__ volatile("dsb\n\tisb");
  _start();
}

/* Address of the end of the stack, then of the first function. */
__attribute__((section(".vectors"), used)) static void (*const vectors[2])(void) = {
  (void (*)(void))0x20400000, reset
};

#ifdef STEPS
#define TIMER_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define TIMER_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define TIMER_VALUE (*(volatile uint32_t *)0xE000E018u)

/* The timer counts at 25 MHz; with -icount shift=0 an instruction takes one nanosecond. */
#define INSTRUCTIONS_PER_TICK (40u)
#define GIVEN (CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE)
#define EXPECTED (CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE)

static controller_input in;
static controller_state state;
static controller_output out;
static controller_validity valid;
static controller_guard guard;
static double head[4];
static double row[GIVEN + EXPECTED];

/* The larger one of a number and the ticks between two values of the timer, which counts down. */
static uint32_t larger(uint32_t most, uint32_t before, uint32_t after)
{
  const uint32_t ticks = (before - after) & 0xFFFFFFu;
  return (ticks > most) ? ticks : most;
}

/* Runs every sample of the test vectors. */
int main(void)
{
  uint32_t most = 0u;
  uint32_t most_guarded = 0u;
  FILE *file = fopen("test_vectors.bin", "rb");
  if ((file == NULL) || (fread(head, sizeof(double), 4, file) != 4)) {
    return 2;
  }
  (void)memset(&valid, 1, sizeof(valid)); /* each flag is true */
  TIMER_RELOAD = 0xFFFFFFu;
  TIMER_VALUE = 0u;
  TIMER_CONTROL = 5u;
  for (long sample = 0; sample < (long)head[1]; sample++) {
    if (fread(row, sizeof(double), GIVEN + EXPECTED, file) != GIVEN + EXPECTED) {
      return 2;
    }
    read_controller_input(row, &in);
    read_controller_state(row + CONTROLLER_INPUT_SIZE, &state);
    guard.state = state;
    guard.sample = (int32_t)((uint32_t)in.sample - 1u);
    guard.called = true;
    guard.begun = true;
    const uint32_t before = TIMER_VALUE;
    controller_step(&controller_default_parameters, &in, &state, &out);
    const uint32_t between = TIMER_VALUE;
    (void)controller_guard_step(&controller_default_parameters,
                                &controller_default_guard_parameters, &in, &valid, &guard, &out);
    const uint32_t after = TIMER_VALUE;
    most = larger(most, before, between);
    most_guarded = larger(most_guarded, between, after);
  }
  fclose(file);
  printf("%lu instructions a step at most, %lu behind the guard\n",
         (unsigned long)(most * INSTRUCTIONS_PER_TICK),
         (unsigned long)(most_guarded * INSTRUCTIONS_PER_TICK));
  return 0;
}
#endif
