#include "controller.c"
#include "controller_records.h"

@RECORDS@
#ifndef CONTROLLER_SHA256
#error "build with make or CMake, which define CONTROLLER_SHA256"
#endif

const char *controller_identity(void);
const char *controller_identity(void)
{
  return "@ABI@ @PROGRAM@ @PRECISION@ " CONTROLLER_SHA256;
}

void controller_defaults(double *row);
void controller_defaults(double *row)
{
  write_controller_parameters(&controller_default_parameters, row);
}

@STAGES@
