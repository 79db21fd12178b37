#ifndef CONTROLLER_APP_TBL_H
#define CONTROLLER_APP_TBL_H

#include "controller_guard.h"
#include "controller_parameters.h"

#define CONTROLLER_APP_TABLE_NAME "Parameters" /* CONTROLLER.Parameters for cFE's commands */

/* The parameter table. Its size must not exceed CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE. */
typedef struct {
  controller_parameters Parameters;
  controller_guard_parameters Limits;
  uint32_t Checksum; /* controller_parameter_checksum of Parameters; another one is refused */
} CONTROLLER_APP_Table_t;

#endif /* CONTROLLER_APP_TBL_H */
