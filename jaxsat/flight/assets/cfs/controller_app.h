#ifndef CONTROLLER_APP_H
#define CONTROLLER_APP_H

#include "controller_app_msg.h"
#include "controller_app_tbl.h"

#include "cfe.h"

#define CONTROLLER_APP_PIPE_DEPTH (16)
#define CONTROLLER_APP_PIPE_NAME "CONTROLLER_PIPE"

/* What the validation function of the table returns for parameters that it refuses */
#define CONTROLLER_APP_TBL_ERR ((CFE_Status_t)-1)

/* Event messages */
#define CONTROLLER_APP_INIT_INF_EID (1)
#define CONTROLLER_APP_INIT_ERR_EID (2)
#define CONTROLLER_APP_NOOP_INF_EID (3)
#define CONTROLLER_APP_RESET_INF_EID (4)
#define CONTROLLER_APP_RESTART_INF_EID (5)
#define CONTROLLER_APP_MID_ERR_EID (6)
#define CONTROLLER_APP_CC_ERR_EID (7)
#define CONTROLLER_APP_LEN_ERR_EID (8)
#define CONTROLLER_APP_PIPE_ERR_EID (9)
#define CONTROLLER_APP_STATUS_INF_EID (10) /* the status is 0 again */
#define CONTROLLER_APP_STATUS_ERR_EID (11) /* the status has changed to another number */
#define CONTROLLER_APP_MODE_INF_EID (12)   /* the mode has changed */
#define CONTROLLER_APP_TBL_INF_EID (13)    /* new parameters are in use */
#define CONTROLLER_APP_TBL_ERR_EID (14)    /* parameters were refused */
#define CONTROLLER_APP_TBL_ADDRESS_ERR_EID (15)

typedef struct {
  controller_guard Guard;
  controller_input Input; /* the newest measurements */
  controller_validity Valid;
  CONTROLLER_APP_Table_t Defaults;
  CONTROLLER_APP_OutputTlm_t OutputTlm;
  CONTROLLER_APP_HkTlm_t HkTlm;
  CONTROLLER_APP_StateTlm_t StateTlm;
  CFE_SB_PipeId_t Pipe;
  CFE_TBL_Handle_t Table;
  uint32 RunStatus;
  uint32_t Number;  /* of the next sample; may wrap around */
  bool HasMeasured; /* whether measurements have come since the last step */
} CONTROLLER_APP_Data_t;

extern CONTROLLER_APP_Data_t CONTROLLER_APP_Data;

/* The entry point, as it stands in cfe_es_startup.scr. */
void CONTROLLER_APP_Main(void);

#endif /* CONTROLLER_APP_H */
