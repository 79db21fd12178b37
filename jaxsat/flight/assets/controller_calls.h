#ifndef CONTROLLER_CALLS_H
#define CONTROLLER_CALLS_H

#include "controller_records.h"

#include <string.h>

#define CALL_SIZE (@SIZE@)
#define CALL_REAL @REAL@
#define CALL_PARAMETERS (@PARAMETERS@)

@READER@
/* Calls what the first number of the row tells: 0 controller_step, 1 controller_init, 2
   controller_coast. found gets the outputs (zero where there are none), then the state. */
static inline void make_call(const double *row, double *found)
{
  controller_parameters p;
  controller_input in;
  controller_state state;
  controller_output out;
@VARIABLE@
  (void)memset(&out, 0, sizeof(out));
  read_controller_parameters(row + @AT_PARAMETERS@, &p);
@READ_ATTITUDE@  read_controller_input(row + @AT_INPUT@, &in);
  read_controller_state(row + @AT_STATE@, &state);
  if (row[0] == 0.0) {
    controller_step(&p, &in, &state, &out);
  } else @WHETHER@{
    controller_init(&p, @ATTITUDE@&in, &state);
@COAST@  }
  write_controller_output(&out, found);
  write_controller_state(&state, found + CONTROLLER_OUTPUT_SIZE);
}

#endif /* CONTROLLER_CALLS_H */
