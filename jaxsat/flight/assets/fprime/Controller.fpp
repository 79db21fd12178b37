module Control {

@ARRAYS@

  @ The measurements of a period, and what the sensors say of them
  port Measurements(
@MEASUREMENT@
  )

  @ Commands and status of a step
  port Output(
@OUTPUT@
  )

  @ Runs the controller behind its guard
  passive component Controller {

    @ The measurements of a period: before schedIn
    guarded input port measurementIn: Control.Measurements

    @ Makes a step: once a period (@PERIOD@ s)
    guarded input port schedIn: Svc.Sched

    output port outputOut: Control.Output

    command recv port cmdIn
    command reg port cmdRegOut
    command resp port cmdResponseOut
    event port logOut
    text event port logTextOut
    param get port prmGetOut
    param set port prmSetOut
    telemetry port tlmOut
    time get port timeCaller

    @ The controller begins anew with the next step
    guarded command Restart opcode 0

    guarded command ResetCounters opcode 1

@PARAMETERS@

    @ A sum of CONTROLLER_STATUS_... of the last step
    telemetry Status: U32 id 0 update on change format "{x}"

    @ All bits of it since the counters were reset
    telemetry StatusSeen: U32 id 1 update on change format "{x}"

    @ @MODES@
    telemetry Mode: I32 id 2 update on change

    @ Steps since the start or the last restart
    telemetry Steps: U32 id 3

    @ Steps without new measurements since the counters were reset
    telemetry MissingMeasurements: U32 id 4 update on change

    @ Calls of the guard without a step since the last restart
    telemetry WithoutStep: U32 id 5 update on change

    @ Those in a row until now
    telemetry Missed: I32 id 6 update on change

    @ controller_parameter_checksum of the parameters in use
    telemetry ParameterChecksum: U32 id 7 update on change format "{x}"

    @ The status is 0 again
    event StatusCleared(before: U32) severity activity high id 0 \
      format "Status 0 after 0x{x}"

    @ The status has changed to another number
    event StatusChanged(status: U32, before: U32) severity warning low id 1 \
      format "Status 0x{x} after 0x{x}"

    event ModeChanged(mode: I32, before: I32) severity activity high id 2 \
      format "Mode {} after {}"

    event ParametersInUse(checksum: U32) severity activity high id 3 \
      format "Parameters with checksum 0x{x} in use"

    @ Those before stay in use
    event ParametersRefused(number: I32) severity warning high id 4 \
      format "Parameters refused: number {} is out of range (0: a limit of the guard)"

    event Restarted severity activity high id 5 format "Controller begins anew"

  }

}
