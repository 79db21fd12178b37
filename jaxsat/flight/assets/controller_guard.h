#ifndef CONTROLLER_GUARD_H
#define CONTROLLER_GUARD_H

#include "controller.h"

/* Bits of a status; a sample without any is 0. */
@STATUS@

/* Which measurements the caller takes for valid. */
typedef struct {
@VALIDITY@
} controller_validity;

typedef struct {
  /* calls in a row without a step for which commands are held, before they are zero; 0: they
     are zero at once */
  int32_t hold_samples;
  /* largest valid rate about an axis (rad/s) */
  @REAL@ rate_limit;
  /* how far the square of a unit quaternion's norm may be from 1 */
  @REAL@ norm_tolerance;
} controller_guard_parameters;

extern const controller_guard_parameters controller_default_guard_parameters;

typedef struct {
  controller_state state;
  controller_output last; /* the commands of the last call */
@SEEN@  int32_t sample; /* number of the last sample */
  int32_t missed; /* calls in a row without a step */
  uint32_t without_step; /* calls without a step since controller_guard_init */
  bool called; /* whether there was a call */
  bool begun; /* whether the controller has begun */
} controller_guard;

/* Begins anew. The controller itself begins at the first sample whose measurements are valid,
   from which time and samples count; commands are zero until then. */
@ATTITUDE@@INIT@;

/* One sample in the place of controller_step: returns its status, and always writes finite
   commands. in->sample must count the periods. */
@STEP@

#endif /* CONTROLLER_GUARD_H */
