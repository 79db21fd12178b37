/* Runs the app on stubs of cFE: samples of a file through the bus, then what the ground may send.
   A sample is an input and a state, then the output and the next state that are expected. */
#include "controller_app.h"
#include "controller_records.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STEPS (sizeof(script) / sizeof(script[0]))
#define GIVEN (CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE)
#define EXPECTED (CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE)

extern CONTROLLER_APP_Table_t ControllerTable;

/* The size that the header tells: else this is no array. */
typedef char told_size[(sizeof(CONTROLLER_APP_Table_t) == @TABLE_BYTES@u) ? 1 : -1];

typedef struct {
  CFE_SB_MsgId_Atom_t id;
  uint8 code;
  size_t size;
  double gain; /* of a table that is uploaded first, if it is not 0 */
} scripted;

static const scripted script[] = {
  {CONTROLLER_APP_WAKEUP_MID, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_CMD_MID, CONTROLLER_APP_NOOP_CC, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_CMD_MID, 99, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_CMD_MID, CONTROLLER_APP_NOOP_CC, sizeof(CONTROLLER_APP_NoArgsCmd_t) + 2, 0},
  {CONTROLLER_APP_MEASUREMENT_MID, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {0x1999, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_SEND_HK_MID, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), -1.0},
  {CONTROLLER_APP_SEND_HK_MID, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), 2.5},
  {CONTROLLER_APP_CMD_MID, CONTROLLER_APP_SEND_STATE_CC, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_CMD_MID, CONTROLLER_APP_RESTART_CC, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_WAKEUP_MID, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_CMD_MID, CONTROLLER_APP_RESET_COUNTERS_CC, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
  {CONTROLLER_APP_SEND_HK_MID, 0, sizeof(CONTROLLER_APP_NoArgsCmd_t), 0},
};

static union {
  CFE_SB_Buffer_t buffer;
  CONTROLLER_APP_MeasurementCmd_t measurement;
  CONTROLLER_APP_NoArgsCmd_t command;
} message;
static scripted now;
static FILE *file;
static double row[GIVEN + EXPECTED];
static controller_guard guard; /* as the app's own, and stepped beside it */
static long samples;
static long judged;
static long differing;
static long changes; /* of the mode, and events that tell of one */
static long told_changes;
static int32_t mode;
static size_t place;
static bool telling;

static CONTROLLER_APP_Table_t table;
static CONTROLLER_APP_Table_t uploaded;
static bool pending;
static CFE_TBL_CallbackFuncPtr_t validate;

/* The next sample, in the app and beside it; false after the last one. */
static bool next_sample(void)
{
  controller_input in;
  controller_guard *own = &CONTROLLER_APP_Data.Guard;

  if (fread(row, sizeof(double), GIVEN + EXPECTED, file) != GIVEN + EXPECTED) {
    return false;
  }
  read_controller_input(row, &in);
  read_controller_state(row + CONTROLLER_INPUT_SIZE, &own->state);
  own->called = true;
  own->begun = true;
  own->missed = 0;
  own->sample = (int32_t)((uint32_t)in.sample - 1u);
  guard = *own;
  CONTROLLER_APP_Data.Number = (uint32_t)in.sample;
  (void)memset(&message, 0, sizeof(message));
  CONTROLLER_APP_Measurement_Payload_t *to = &message.measurement.Payload;
@SEND@
  now = (scripted){CONTROLLER_APP_MEASUREMENT_MID, 0, sizeof(CONTROLLER_APP_MeasurementCmd_t), 0};
  samples++;
  return true;
}

/* Compares what the app sends with the guard's own call, and with what is expected of a sample. */
static void judge(const CONTROLLER_APP_OutputTlm_Payload_t *told)
{
  controller_input in;
  const controller_validity valid = {@VALID@};
  controller_output out;
  controller_output sent;
  double found[EXPECTED];
  uint32_t status;

  read_controller_input(row, &in);
  status = controller_guard_step(&controller_default_parameters,
                                 &controller_default_guard_parameters, &in, &valid, &guard, &out);
  (void)memset(&sent, 0, sizeof(sent));
@TOLD@
  write_controller_output(&sent, found);
  write_controller_state(&CONTROLLER_APP_Data.Guard.state, found + CONTROLLER_OUTPUT_SIZE);
  if (status == 0u) {
    judged++;
  } else {
    write_controller_output(&out, row + GIVEN);
    write_controller_state(&guard.state, row + GIVEN + CONTROLLER_OUTPUT_SIZE);
  }
  changes += told->mode != mode;
  mode = told->mode;
  differing += (told->status != status) || (told->sample != in.sample) ||
               (memcmp(found, row + GIVEN, sizeof(found)) != 0);
}

bool CFE_ES_RunLoop(uint32 *RunStatus)
{
  return (*RunStatus == CFE_ES_RunStatus_APP_RUN) && (place <= STEPS);
}

void CFE_ES_ExitApp(uint32 ExitStatus) { printf("exit %u\n", (unsigned)ExitStatus); }

void CFE_ES_PerfLogAdd(uint32 Marker, uint32 EntryExit)
{
  (void)Marker;
  (void)EntryExit;
}

CFE_Status_t CFE_EVS_Register(const void *Filters, uint16 NumEventFilters, uint16 FilterScheme)
{
  (void)Filters;
  return ((NumEventFilters == 0) && (FilterScheme == CFE_EVS_EventFilter_BINARY)) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_EVS_SendEvent(uint16 EventID, CFE_EVS_EventType_Enum_t EventType, const char *Spec,
                               ...)
{
  va_list rest;

  told_changes += EventID == CONTROLLER_APP_MODE_INF_EID;
  if (telling && (EventID != CONTROLLER_APP_MODE_INF_EID)) {
    va_start(rest, Spec);
    printf("event %u %u ", (unsigned)EventID, (unsigned)EventType);
    vprintf(Spec, rest);
    printf("\n");
    va_end(rest);
  }
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t MsgId, CFE_MSG_Size_t Size)
{
  (void)memset(MsgPtr, 0, Size);
  MsgPtr->StreamId[0] = (uint8)(MsgId.Value >> 8);
  MsgPtr->StreamId[1] = (uint8)MsgId.Value;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_Size_t *Size)
{
  (void)MsgPtr;
  *Size = now.size;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t *MsgId)
{
  (void)MsgPtr;
  *MsgId = CFE_SB_ValueToMsgId(now.id);
  return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_FcnCode_t *FcnCode)
{
  (void)MsgPtr;
  *FcnCode = now.code;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *PipeIdPtr, uint16 Depth, const char *PipeName)
{
  PipeIdPtr->Id = 7;
  telling = true;
  return ((Depth > 0) && (strlen(PipeName) < 20)) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId)
{
  printf("subscribed 0x%X\n", (unsigned)MsgId.Value);
  return (PipeId.Id == 7) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **BufPtr, CFE_SB_PipeId_t PipeId, int32 TimeOut)
{
  *BufPtr = &message.buffer;
  if ((PipeId.Id != 7) || (TimeOut != CFE_SB_PEND_FOREVER)) {
    return -1;
  }
  if ((place == 0) && (now.id == CONTROLLER_APP_MEASUREMENT_MID)) {
    now = script[0]; /* wakes up once it has measured */
    return CFE_SUCCESS;
  }
  telling = false;
  if ((place == 0) && next_sample()) {
    return CFE_SUCCESS;
  }
  if (place == 0) {
    printf("samples %ld, judged %ld, differing %ld, modes %ld, told %ld\n", samples, judged,
           differing, changes, told_changes);
  }
  telling = true;
  if (place == STEPS) {
    place++;
    return -1;
  }
  now = script[place++];
  if (now.gain != 0) {
    uploaded = ControllerTable;
    uploaded.Parameters.@GAIN@ = (@REAL@)now.gain;
    uploaded.Checksum = controller_parameter_checksum(&uploaded.Parameters);
    pending = true;
  }
  return CFE_SUCCESS;
}

CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *MsgPtr, bool IsOrigination)
{
  const int id = (MsgPtr->StreamId[0] << 8) | MsgPtr->StreamId[1];

  if (!IsOrigination) {
    return -1;
  }
  if (id == CONTROLLER_APP_OUTPUT_TLM_MID) {
    const CONTROLLER_APP_OutputTlm_t *told = (const CONTROLLER_APP_OutputTlm_t *)MsgPtr;
    if (place == 0) {
      judge(&told->Payload);
    } else {
      printf("output %d 0x%X\n", (int)told->Payload.sample, (unsigned)told->Payload.status);
    }
  } else if (id == CONTROLLER_APP_HK_TLM_MID) {
    const CONTROLLER_APP_HkTlm_Payload_t *told = &((const CONTROLLER_APP_HkTlm_t *)MsgPtr)->Payload;
    printf("housekeeping %u %u steps %u missing %u updates %u parameters %d\n",
           told->CommandCounter, told->CommandErrorCounter, (unsigned)told->Steps,
           (unsigned)told->MissingMeasurements, (unsigned)told->TableUpdates,
           told->Checksum == table.Checksum);
  } else if (id == CONTROLLER_APP_STATE_TLM_MID) {
    printf("state %d\n", memcmp(&((const CONTROLLER_APP_StateTlm_t *)MsgPtr)->Payload,
                                &CONTROLLER_APP_Data.Guard.state, sizeof(controller_state)));
  }
  return CFE_SUCCESS;
}

void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *MsgPtr) { (void)MsgPtr; }

CFE_Status_t CFE_TBL_Register(CFE_TBL_Handle_t *TblHandlePtr, const char *Name, size_t Size,
                              uint16 TblOptionFlags, CFE_TBL_CallbackFuncPtr_t TblValidationFuncPtr)
{
  *TblHandlePtr = 3;
  validate = TblValidationFuncPtr;
  return ((Size == sizeof(table)) && (TblOptionFlags == 0) && (strlen(Name) < 16)) ? CFE_SUCCESS : -1;
}

/* cFE validates and copies; at CFE_TBL_Manage it does so with what was uploaded. */
CFE_Status_t CFE_TBL_Load(CFE_TBL_Handle_t TblHandle, CFE_TBL_SrcEnum_t SrcType,
                          const void *SrcDataPtr)
{
  CONTROLLER_APP_Table_t copy = *(const CONTROLLER_APP_Table_t *)SrcDataPtr;

  if ((TblHandle != 3) || (SrcType != CFE_TBL_SRC_ADDRESS) || (validate(&copy) != CFE_SUCCESS)) {
    return -1;
  }
  table = copy;
  return CFE_SUCCESS;
}

CFE_Status_t CFE_TBL_Manage(CFE_TBL_Handle_t TblHandle)
{
  const bool found = pending && (CFE_TBL_Load(TblHandle, CFE_TBL_SRC_ADDRESS, &uploaded) == 0);

  pending = false;
  return found ? CFE_TBL_INFO_UPDATED : CFE_SUCCESS;
}

CFE_Status_t CFE_TBL_GetAddress(void **TblPtr, CFE_TBL_Handle_t TblHandle)
{
  *TblPtr = &table;
  return (TblHandle == 3) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_TBL_ReleaseAddress(CFE_TBL_Handle_t TblHandle)
{
  return (TblHandle == 3) ? CFE_SUCCESS : -1;
}

int main(int count, char **words)
{
  file = (count == 2) ? fopen(words[1], "rb") : NULL;
  if (file == NULL) {
    return 2;
  }
  CONTROLLER_APP_Main();
  return fclose(file);
}
