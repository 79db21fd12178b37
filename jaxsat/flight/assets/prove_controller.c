#include "controller_guard.h"
#include "controller_parameters.h"
@INCLUDE@
static controller_parameters p;
static controller_input in;
static controller_state state;
static controller_output out;
@VARIABLE@static controller_guard_parameters limits;
static controller_validity valid;
static controller_guard guard;
static volatile int choice; /* any number whenever it is read */

static void any_input(void);
static void any_input(void)
{
@INPUT@}

int main(void);
int main(void)
{
  any_input();
@ARGUMENTS@  switch (choice) {
  case 0:
    controller_init(&p, @ATTITUDE@&in, &state);
    break;
@COAST@  case 2:
    guard.state = state;
    guard.last = out;
    guard.called = choice != 0;
    guard.begun = choice != 0;
    (void)controller_guard_step(&p, &limits, &in, &valid, &guard, &out);
    break;
  case 3:
    controller_guard_init(@ATTITUDE@&guard);
    break;
  case 4:
    (void)controller_check_parameters(&p);
    (void)controller_parameter_checksum(&p);
    break;
@PLAN@  default:
    controller_step(&p, &in, &state, &out);
    break;
  }
  return 0;
}
