/* Stands for cfe_msg_hdr.h of cFE 7.0: headers of messages with a CCSDS primary header alone. The
   sizes are those of cFE. */
#ifndef STUB_CFE_MSG_HDR_H
#define STUB_CFE_MSG_HDR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int16_t int16;
typedef int32_t int32;
typedef uint8_t uint8;
typedef uint16_t uint16;
typedef uint32_t uint32;

typedef struct {
  uint8 StreamId[2];
  uint8 Sequence[2];
  uint8 Length[2];
} CFE_MSG_Message_t;
typedef struct {
  CFE_MSG_Message_t Msg;
  uint8 FunctionCode;
  uint8 Checksum;
} CFE_MSG_CommandHeader_t;
typedef struct {
  CFE_MSG_Message_t Msg;
  uint8 Time[6];
  uint8 Spare[4];
} CFE_MSG_TelemetryHeader_t;
#define CFE_MSG_PTR(shdr) (&((shdr).Msg))

#endif
