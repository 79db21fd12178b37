#ifndef CONTROLLER_FIRST_PLAN_H
#define CONTROLLER_FIRST_PLAN_H

#include "controller_plan.h"

/* controller_plan_checksum of these numbers. */
#define CONTROLLER_PLAN_CHECKSUM (0x@CHECKSUM@u)

static const controller_plan controller_planned = {
@NUMBERS@
};

#endif /* CONTROLLER_FIRST_PLAN_H */
