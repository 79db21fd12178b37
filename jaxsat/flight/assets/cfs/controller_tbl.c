/* An image of the parameter table with the scenario's numbers, to be edited and uploaded. The app
   itself begins with the same numbers, without this file. Change the checksum with the numbers. */
#include "controller_app_tbl.h"

#include <math.h>

#include "cfe_tbl_filedef.h"

CONTROLLER_APP_Table_t ControllerTable = {
.Parameters = {
@PARAMETERS@
},
.Limits = {
@LIMITS@
},
.Checksum = CONTROLLER_DEFAULT_CHECKSUM,
};

CFE_TBL_FILEDEF(ControllerTable, CONTROLLER.Parameters, Controller parameters, controller_tbl.tbl)
