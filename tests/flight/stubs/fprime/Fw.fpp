# Stands for the ports and types of F´ 4 that a component with commands, events, telemetry and
# parameters needs: types alone, without what they have.

type FwSizeStoreType = U16 @< of strings, for FPP 3.4 and later

module Fw {

  type CmdArgBuffer
  type LogBuffer
  type ParamBuffer
  type Time
  type TlmBuffer

  enum CmdResponse { OK }
  enum LogSeverity { FATAL }
  enum ParamValid { UNINIT, VALID, INVALID, DEFAULT }

  port Cmd(opCode: U32, cmdSeq: U32, ref args: CmdArgBuffer)
  port CmdReg(opCode: U32)
  port CmdResponse(opCode: U32, cmdSeq: U32, response: CmdResponse)
  port Log($id: U32, ref timeTag: Time, $severity: LogSeverity, ref args: LogBuffer)
  port LogText($id: U32, ref timeTag: Time, $severity: LogSeverity, ref $text: string size 256)
  port PrmGet($id: U32, ref val: ParamBuffer) -> ParamValid
  port PrmSet($id: U32, ref val: ParamBuffer)
  port Time(ref $time: Time)
  port Tlm($id: U32, ref timeTag: Time, ref val: TlmBuffer)

}

module Svc {

  port Sched(context: U32)

}
