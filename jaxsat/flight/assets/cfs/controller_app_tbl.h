#ifndef CONTROLLER_APP_TBL_H
#define CONTROLLER_APP_TBL_H

#include "controller_guard.h"
#include "controller_parameters.h"

#define CONTROLLER_APP_TABLE_NAME "Parameters" /* CONTROLLER.Parameters for cFE's commands */

/* The parameter table, @TABLE_BYTES@ bytes where each number is aligned to its own size. It must not
   exceed CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE, by default 16384 bytes. */
typedef struct {
  controller_parameters Parameters;
  controller_guard_parameters Limits;
  uint32_t Checksum; /* controller_parameter_checksum of Parameters; another one is refused */
} CONTROLLER_APP_Table_t;

#endif /* CONTROLLER_APP_TBL_H */
