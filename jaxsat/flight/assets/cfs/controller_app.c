/* An app for NASA's Core Flight System (cFE 7) that runs the controller behind its guard. Once a
   period another app sends measurements, and a scheduler the wake-up that makes a step. */
#include "controller_app.h"

#include <string.h>

CONTROLLER_APP_Data_t CONTROLLER_APP_Data;

static CFE_Status_t CONTROLLER_APP_ValidateTable(void *Address)
{
  const CONTROLLER_APP_Table_t *Table = (const CONTROLLER_APP_Table_t *)Address;
  const controller_guard_parameters *Limits = &Table->Limits;
  int32_t Wrong;

  if (controller_parameter_checksum(&Table->Parameters) != Table->Checksum) {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_TBL_ERR_EID, CFE_EVS_EventType_ERROR,
                            "CONTROLLER: parameters refused: checksum is not 0x%08lX",
                            (unsigned long)Table->Checksum);
    return CONTROLLER_APP_TBL_ERR;
  }
  Wrong = controller_check_parameters(&Table->Parameters);
  if (Wrong != 0) {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_TBL_ERR_EID, CFE_EVS_EventType_ERROR,
                            "CONTROLLER: parameters refused: number %ld is out of range",
                            (long)Wrong);
    return CONTROLLER_APP_TBL_ERR;
  }
  if (!((Limits->hold_samples >= 0) && (Limits->rate_limit >= 0) && (Limits->norm_tolerance >= 0))) {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_TBL_ERR_EID, CFE_EVS_EventType_ERROR,
                            "CONTROLLER: parameters refused: a limit of the guard is negative");
    return CONTROLLER_APP_TBL_ERR;
  }
  return CFE_SUCCESS;
}

/* The controller begins at the next step whose measurements are valid. */
static void CONTROLLER_APP_Begin(void)
{
@BEGIN@  controller_guard_init(@ATTITUDE@&CONTROLLER_APP_Data.Guard);
  CONTROLLER_APP_Data.Number = 0u;
  CONTROLLER_APP_Data.HkTlm.Payload.Steps = 0u;
  CONTROLLER_APP_Data.HasMeasured = false;
}

static CFE_Status_t CONTROLLER_APP_RegisterTable(void)
{
  CONTROLLER_APP_Table_t *Defaults = &CONTROLLER_APP_Data.Defaults;
  CFE_Status_t Status;

  Defaults->Parameters = controller_default_parameters;
  Defaults->Limits = controller_default_guard_parameters;
  Defaults->Checksum = CONTROLLER_DEFAULT_CHECKSUM;
  Status = CFE_TBL_Register(&CONTROLLER_APP_Data.Table, CONTROLLER_APP_TABLE_NAME,
                            sizeof(CONTROLLER_APP_Table_t), CFE_TBL_OPT_DEFAULT,
                            CONTROLLER_APP_ValidateTable);
  if (Status == CFE_SUCCESS) {
    Status = CFE_TBL_Load(CONTROLLER_APP_Data.Table, CFE_TBL_SRC_ADDRESS, Defaults);
  }
  CONTROLLER_APP_Data.HkTlm.Payload.Checksum = Defaults->Checksum;
  return Status;
}

static CFE_Status_t CONTROLLER_APP_Subscribe(void)
{
  static const CFE_SB_MsgId_Atom_t Received[] = {
    CONTROLLER_APP_CMD_MID,
    CONTROLLER_APP_SEND_HK_MID,
    CONTROLLER_APP_WAKEUP_MID,
    CONTROLLER_APP_MEASUREMENT_MID,
  };
  CFE_Status_t Status = CFE_SB_CreatePipe(&CONTROLLER_APP_Data.Pipe, CONTROLLER_APP_PIPE_DEPTH,
                                          CONTROLLER_APP_PIPE_NAME);

  for (size_t i = 0; (Status == CFE_SUCCESS) && (i < (sizeof(Received) / sizeof(Received[0]))); i++) {
    Status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId(Received[i]), CONTROLLER_APP_Data.Pipe);
  }
  return Status;
}

static CFE_Status_t CONTROLLER_APP_Init(void)
{
  CONTROLLER_APP_Data_t *Data = &CONTROLLER_APP_Data;
  CFE_Status_t Status;

  (void)memset(Data, 0, sizeof(*Data));
  Data->RunStatus = CFE_ES_RunStatus_APP_RUN;
  CONTROLLER_APP_Begin();
  (void)CFE_MSG_Init(CFE_MSG_PTR(Data->HkTlm.TelemetryHeader),
                     CFE_SB_ValueToMsgId(CONTROLLER_APP_HK_TLM_MID), sizeof(Data->HkTlm));
  (void)CFE_MSG_Init(CFE_MSG_PTR(Data->OutputTlm.TelemetryHeader),
                     CFE_SB_ValueToMsgId(CONTROLLER_APP_OUTPUT_TLM_MID), sizeof(Data->OutputTlm));
  (void)CFE_MSG_Init(CFE_MSG_PTR(Data->StateTlm.TelemetryHeader),
                     CFE_SB_ValueToMsgId(CONTROLLER_APP_STATE_TLM_MID), sizeof(Data->StateTlm));
  Status = CFE_EVS_Register(NULL, 0, CFE_EVS_EventFilter_BINARY);
  if (Status == CFE_SUCCESS) {
    Status = CONTROLLER_APP_RegisterTable();
  }
  if (Status == CFE_SUCCESS) {
    Status = CONTROLLER_APP_Subscribe();
  }
  if (Status == CFE_SUCCESS) {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_INIT_INF_EID, CFE_EVS_EventType_INFORMATION,
                            "CONTROLLER: initialized, program %s", "@PROGRAM@");
  } else {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_INIT_ERR_EID, CFE_EVS_EventType_ERROR,
                            "CONTROLLER: not initialized, RC = 0x%08lX", (unsigned long)(uint32_t)Status);
  }
  return Status;
}

static void CONTROLLER_APP_Measure(const CONTROLLER_APP_Measurement_Payload_t *Payload)
{
  controller_input *Input = &CONTROLLER_APP_Data.Input;
  controller_validity *Valid = &CONTROLLER_APP_Data.Valid;

@READ@
  CONTROLLER_APP_Data.HasMeasured = true;
}

/* Tells what has changed since the last step, in event messages and housekeeping. */
static void CONTROLLER_APP_Tell(uint32_t Status, int32_t Mode)
{
  CONTROLLER_APP_HkTlm_Payload_t *Told = &CONTROLLER_APP_Data.HkTlm.Payload;

  if (Status != Told->Status) {
    (void)CFE_EVS_SendEvent(
      (Status == 0u) ? CONTROLLER_APP_STATUS_INF_EID : CONTROLLER_APP_STATUS_ERR_EID,
      (Status == 0u) ? CFE_EVS_EventType_INFORMATION : CFE_EVS_EventType_ERROR,
      "CONTROLLER: status 0x%lX after 0x%lX at step %lu", (unsigned long)Status,
      (unsigned long)Told->Status, (unsigned long)Told->Steps);
  }
  if (Mode != Told->Mode) {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_MODE_INF_EID, CFE_EVS_EventType_INFORMATION,
                            "CONTROLLER: mode %ld after %ld at step %lu", (long)Mode,
                            (long)Told->Mode, (unsigned long)Told->Steps);
  }
  Told->Status = Status;
  Told->StatusSeen |= Status;
  Told->Mode = Mode;
}

/* One step with the parameters of the table; with those compiled in, if cFE has no table. */
static uint32_t CONTROLLER_APP_Step(const controller_validity *Valid, controller_output *Output)
{
  CONTROLLER_APP_Data_t *Data = &CONTROLLER_APP_Data;
  const CONTROLLER_APP_Table_t *Table = &Data->Defaults;
  void *Address = NULL;
  CFE_Status_t Found = CFE_TBL_GetAddress(&Address, Data->Table);
  uint32_t Status;

  if (Found >= CFE_SUCCESS) {
    Table = (const CONTROLLER_APP_Table_t *)Address;
  } else {
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_TBL_ADDRESS_ERR_EID, CFE_EVS_EventType_ERROR,
                            "CONTROLLER: no table, compiled parameters are used, RC = 0x%08lX",
                            (unsigned long)(uint32_t)Found);
  }
  Status = controller_guard_step(&Table->Parameters, &Table->Limits, &Data->Input, Valid,
                                 &Data->Guard, Output);
  (void)CFE_TBL_ReleaseAddress(Data->Table);
  return Status;
}

/* Makes a step. Without new measurements they are flagged as invalid, and the guard goes on. */
static void CONTROLLER_APP_Wakeup(void)
{
  static const controller_validity None = {0};
  CONTROLLER_APP_Data_t *Data = &CONTROLLER_APP_Data;
  CONTROLLER_APP_OutputTlm_Payload_t *Payload = &Data->OutputTlm.Payload;
  controller_output Output;
  uint32_t Status;

  if (!Data->HasMeasured) {
    Data->HkTlm.Payload.MissingMeasurements++;
  }
  Data->Input.sample = (int32_t)Data->Number;
  Status = CONTROLLER_APP_Step(Data->HasMeasured ? &Data->Valid : &None, &Output);
  Data->HasMeasured = false;
  Data->Number++;
  Data->HkTlm.Payload.Steps++;

@WRITE@
  Payload->status = Status;
  Payload->sample = Data->Input.sample;
  CFE_SB_TimeStampMsg(CFE_MSG_PTR(Data->OutputTlm.TelemetryHeader));
  (void)CFE_SB_TransmitMsg(CFE_MSG_PTR(Data->OutputTlm.TelemetryHeader), true);
  CONTROLLER_APP_Tell(Status, (int32_t)Output.mode);
}

/* Takes over a table that was uploaded, and sends housekeeping. */
static void CONTROLLER_APP_SendHk(void)
{
  CONTROLLER_APP_Data_t *Data = &CONTROLLER_APP_Data;
  CONTROLLER_APP_HkTlm_Payload_t *Payload = &Data->HkTlm.Payload;

  if (CFE_TBL_Manage(Data->Table) == CFE_TBL_INFO_UPDATED) {
    void *Address = NULL;
    if (CFE_TBL_GetAddress(&Address, Data->Table) >= CFE_SUCCESS) {
      Payload->Checksum = ((const CONTROLLER_APP_Table_t *)Address)->Checksum;
    }
    (void)CFE_TBL_ReleaseAddress(Data->Table);
    Payload->TableUpdates++;
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_TBL_INF_EID, CFE_EVS_EventType_INFORMATION,
                            "CONTROLLER: parameters with checksum 0x%08lX in use",
                            (unsigned long)Payload->Checksum);
  }
  Payload->WithoutStep = Data->Guard.without_step;
  Payload->Missed = Data->Guard.missed;
  CFE_SB_TimeStampMsg(CFE_MSG_PTR(Data->HkTlm.TelemetryHeader));
  (void)CFE_SB_TransmitMsg(CFE_MSG_PTR(Data->HkTlm.TelemetryHeader), true);
}

static void CONTROLLER_APP_SendState(void)
{
  CONTROLLER_APP_StateTlm_t *Told = &CONTROLLER_APP_Data.StateTlm;

  Told->Payload = CONTROLLER_APP_Data.Guard.state;
  CFE_SB_TimeStampMsg(CFE_MSG_PTR(Told->TelemetryHeader));
  (void)CFE_SB_TransmitMsg(CFE_MSG_PTR(Told->TelemetryHeader), true);
}

static void CONTROLLER_APP_ResetCounters(void)
{
  CONTROLLER_APP_HkTlm_Payload_t *Payload = &CONTROLLER_APP_Data.HkTlm.Payload;

  Payload->StatusSeen = 0u;
  Payload->MissingMeasurements = 0u;
  Payload->TableUpdates = 0u;
  Payload->CommandCounter = 0u;
  Payload->CommandErrorCounter = 0u;
  (void)CFE_EVS_SendEvent(CONTROLLER_APP_RESET_INF_EID, CFE_EVS_EventType_INFORMATION,
                          "CONTROLLER: counters reset");
}

/* Whether a message has the length of its type; another one is told and counted. */
static bool CONTROLLER_APP_HasLength(const CFE_SB_Buffer_t *Buffer, size_t Expected)
{
  CFE_MSG_Size_t Length = 0;

  (void)CFE_MSG_GetSize(&Buffer->Msg, &Length);
  if (Length != Expected) {
    CONTROLLER_APP_Data.HkTlm.Payload.CommandErrorCounter++;
    (void)CFE_EVS_SendEvent(CONTROLLER_APP_LEN_ERR_EID, CFE_EVS_EventType_ERROR,
                            "CONTROLLER: message of %lu bytes, expected %lu", (unsigned long)Length,
                            (unsigned long)Expected);
  }
  return Length == Expected;
}

static void CONTROLLER_APP_Command(const CFE_SB_Buffer_t *Buffer)
{
  CFE_MSG_FcnCode_t Code = 0;

  if (!CONTROLLER_APP_HasLength(Buffer, sizeof(CONTROLLER_APP_NoArgsCmd_t))) {
    return;
  }
  (void)CFE_MSG_GetFcnCode(&Buffer->Msg, &Code);
  CONTROLLER_APP_Data.HkTlm.Payload.CommandCounter++;
  switch (Code) {
    case CONTROLLER_APP_NOOP_CC:
      (void)CFE_EVS_SendEvent(CONTROLLER_APP_NOOP_INF_EID, CFE_EVS_EventType_INFORMATION,
                              "CONTROLLER: NOOP, program %s", "@PROGRAM@");
      break;
    case CONTROLLER_APP_RESET_COUNTERS_CC:
      CONTROLLER_APP_ResetCounters();
      break;
    case CONTROLLER_APP_RESTART_CC:
      CONTROLLER_APP_Begin();
      (void)CFE_EVS_SendEvent(CONTROLLER_APP_RESTART_INF_EID, CFE_EVS_EventType_INFORMATION,
                              "CONTROLLER: begins anew");
      break;
    case CONTROLLER_APP_SEND_STATE_CC:
      CONTROLLER_APP_SendState();
      break;
    default:
      CONTROLLER_APP_Data.HkTlm.Payload.CommandCounter--;
      CONTROLLER_APP_Data.HkTlm.Payload.CommandErrorCounter++;
      (void)CFE_EVS_SendEvent(CONTROLLER_APP_CC_ERR_EID, CFE_EVS_EventType_ERROR,
                              "CONTROLLER: no command has the function code %u", (unsigned)Code);
      break;
  }
}

static void CONTROLLER_APP_Receive(const CFE_SB_Buffer_t *Buffer)
{
  CFE_SB_MsgId_t Id = CFE_SB_INVALID_MSG_ID;

  (void)CFE_MSG_GetMsgId(&Buffer->Msg, &Id);
  switch (CFE_SB_MsgIdToValue(Id)) {
    case CONTROLLER_APP_MEASUREMENT_MID:
      if (CONTROLLER_APP_HasLength(Buffer, sizeof(CONTROLLER_APP_MeasurementCmd_t))) {
        CONTROLLER_APP_Measure(&((const CONTROLLER_APP_MeasurementCmd_t *)Buffer)->Payload);
      }
      break;
    case CONTROLLER_APP_WAKEUP_MID:
      CONTROLLER_APP_Wakeup();
      break;
    case CONTROLLER_APP_SEND_HK_MID:
      CONTROLLER_APP_SendHk();
      break;
    case CONTROLLER_APP_CMD_MID:
      CONTROLLER_APP_Command(Buffer);
      break;
    default:
      (void)CFE_EVS_SendEvent(CONTROLLER_APP_MID_ERR_EID, CFE_EVS_EventType_ERROR,
                              "CONTROLLER: message 0x%lX is not expected",
                              (unsigned long)CFE_SB_MsgIdToValue(Id));
      break;
  }
}

void CONTROLLER_APP_Main(void)
{
  CFE_SB_Buffer_t *Buffer;
  CFE_Status_t Status;

  CFE_ES_PerfLogEntry(CONTROLLER_APP_PERF_ID);
  if (CONTROLLER_APP_Init() != CFE_SUCCESS) {
    CONTROLLER_APP_Data.RunStatus = CFE_ES_RunStatus_APP_ERROR;
  }
  while (CFE_ES_RunLoop(&CONTROLLER_APP_Data.RunStatus)) {
    CFE_ES_PerfLogExit(CONTROLLER_APP_PERF_ID);
    Status = CFE_SB_ReceiveBuffer(&Buffer, CONTROLLER_APP_Data.Pipe, CFE_SB_PEND_FOREVER);
    CFE_ES_PerfLogEntry(CONTROLLER_APP_PERF_ID);
    if (Status == CFE_SUCCESS) {
      CONTROLLER_APP_Receive(Buffer);
    } else {
      (void)CFE_EVS_SendEvent(CONTROLLER_APP_PIPE_ERR_EID, CFE_EVS_EventType_ERROR,
                              "CONTROLLER: pipe cannot be read, RC = 0x%08lX",
                              (unsigned long)(uint32_t)Status);
      CONTROLLER_APP_Data.RunStatus = CFE_ES_RunStatus_APP_ERROR;
    }
  }
  CFE_ES_PerfLogExit(CONTROLLER_APP_PERF_ID);
  CFE_ES_ExitApp(CONTROLLER_APP_Data.RunStatus);
}
