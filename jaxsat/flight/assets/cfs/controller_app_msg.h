#ifndef CONTROLLER_APP_MSG_H
#define CONTROLLER_APP_MSG_H

#include "controller.h"
#include "controller_app_topicids.h"

#include "cfe_core_api_base_msgids.h"
#include "cfe_msg_hdr.h"

/* What the app receives: commands from the ground, a request for housekeeping, and once a period
   (@PERIOD@ s) first the measurements and then the wake-up, which makes a step. */
#define CONTROLLER_APP_CMD_MID \
  CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_CMD_TOPICID)
#define CONTROLLER_APP_SEND_HK_MID \
  CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_SEND_HK_TOPICID)
#define CONTROLLER_APP_WAKEUP_MID \
  CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_WAKEUP_TOPICID)
#define CONTROLLER_APP_MEASUREMENT_MID \
  CFE_PLATFORM_CMD_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_MEASUREMENT_TOPICID)

/* What it sends: housekeeping, the output of each step, and the state on command. */
#define CONTROLLER_APP_HK_TLM_MID \
  CFE_PLATFORM_TLM_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_HK_TLM_TOPICID)
#define CONTROLLER_APP_OUTPUT_TLM_MID \
  CFE_PLATFORM_TLM_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_OUTPUT_TLM_TOPICID)
#define CONTROLLER_APP_STATE_TLM_MID \
  CFE_PLATFORM_TLM_TOPICID_TO_MIDV(CFE_MISSION_CONTROLLER_APP_STATE_TLM_TOPICID)

/* Function codes of CONTROLLER_APP_CMD_MID */
#define CONTROLLER_APP_NOOP_CC (0)
#define CONTROLLER_APP_RESET_COUNTERS_CC (1)
#define CONTROLLER_APP_RESTART_CC (2)    /* the controller begins anew with the next step */
#define CONTROLLER_APP_SEND_STATE_CC (3) /* one CONTROLLER_APP_StateTlm_t */

/* Commands, the request for housekeeping and the wake-up have no arguments. */
typedef struct {
  CFE_MSG_CommandHeader_t CommandHeader;
} CONTROLLER_APP_NoArgsCmd_t;

/* Payloads are in the byte order of the processor, largest numbers first, without padding. */
typedef struct {
@MEASUREMENT@
} CONTROLLER_APP_Measurement_Payload_t;

typedef struct {
  CFE_MSG_CommandHeader_t CommandHeader;
  CONTROLLER_APP_Measurement_Payload_t Payload;
} CONTROLLER_APP_MeasurementCmd_t;

typedef struct {
@OUTPUT@
} CONTROLLER_APP_OutputTlm_Payload_t;

typedef struct {
  CFE_MSG_TelemetryHeader_t TelemetryHeader;
  CONTROLLER_APP_OutputTlm_Payload_t Payload;
} CONTROLLER_APP_OutputTlm_t;

typedef struct {
  uint32_t Checksum;            /* controller_parameter_checksum of the parameters in use */
  uint32_t Steps;               /* wake-ups since the start or the last restart */
  uint32_t Status;              /* of the last step: a sum of CONTROLLER_STATUS_... */
  uint32_t StatusSeen;          /* all bits of it since the counters were reset */
  uint32_t MissingMeasurements; /* wake-ups without new measurements since then */
  uint32_t WithoutStep;         /* calls of the guard without a step since the last restart */
  int32_t Missed;               /* those in a row until now */
  int32_t Mode;                 /* @MODES@ */
  uint32_t TableUpdates;        /* new tables of parameters since the counters were reset */
  uint8_t CommandCounter;
  uint8_t CommandErrorCounter;
  uint8_t Spare[2];
} CONTROLLER_APP_HkTlm_Payload_t;

typedef struct {
  CFE_MSG_TelemetryHeader_t TelemetryHeader;
  CONTROLLER_APP_HkTlm_Payload_t Payload;
} CONTROLLER_APP_HkTlm_t;

/* All numbers that the controller remembers, as icd.md lists them: alarms and residuals, too. */
typedef struct {
  CFE_MSG_TelemetryHeader_t TelemetryHeader;
  controller_state Payload;
} CONTROLLER_APP_StateTlm_t;

#endif /* CONTROLLER_APP_MSG_H */
