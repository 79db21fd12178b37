#ifndef CONTROLLER_PLAN_H
#define CONTROLLER_PLAN_H

#include "controller.h"

@STRUCTURE@

/* What controller_load_plan found of a plan. */
#define CONTROLLER_PLAN_LOADED INT32_C(0)
#define CONTROLLER_PLAN_OUT_OF_RANGE INT32_C(1)
#define CONTROLLER_PLAN_NOT_UNIT INT32_C(2)
#define CONTROLLER_PLAN_CHANGED INT32_C(3)

/* The number of the first field, counted from 1 in the order of the structure, that has an element
   out of range or not a number; 0 if there is none. controller_plan.c has the ranges. */
int32_t controller_check_plan(const controller_plan *p);

/* CRC-32/ISO-HDLC of all elements in order, as controller_parameter_checksum. */
uint32_t controller_plan_checksum(const controller_plan *p);

/* Puts a plan in the place of that in the parameters, if its numbers are in range, its quaternions
   unit quaternions, and its checksum the one given; otherwise the parameters keep theirs. Call it
   between two steps, the last of which is before the begin of the plan. */
int32_t controller_load_plan(const controller_plan *plan, uint32_t checksum,
                             controller_parameters *p);

#endif /* CONTROLLER_PLAN_H */
