/* Stands for cfe_tbl_filedef.h of cFE 7.0: what the tool elf2cfetbl reads from an object file. */
#ifndef STUB_CFE_TBL_FILEDEF_H
#define STUB_CFE_TBL_FILEDEF_H
#include "cfe_msg_hdr.h"
typedef struct {
  char ObjectName[64];
  char TableName[40];
  char Description[32];
  char TgtFilename[20];
  uint32 ObjectSize;
} CFE_TBL_FileDef_t;
#define CFE_TBL_FILEDEF(ObjName, TblName, Desc, Filename) \
  CFE_TBL_FileDef_t CFE_TBL_FileDef = {#ObjName "\0", #TblName "\0", #Desc "\0", #Filename "\0", \
                                       sizeof(ObjName)};
#endif
