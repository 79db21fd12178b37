"""Basilisk's maps of torques to wheels and thrusters, and its momentum dumping.

In a process of its own, as `basilisk_runs.py`: cases as JSON on the standard input.
"""

import json
import sys

from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import (
    rwMotorTorque,
    thrForceMapping,
    thrMomentumDumping,
    thrMomentumManagement,
)
from Basilisk.utilities import SimulationBaseClass, fswSetupRW, fswSetupThrusters, macros

AXES = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
"""Rows of the identity: all three axes are controlled."""


def flown(modules, periods=1, period=1.0):
    """Update modules in their order once a period (s), and yield after each."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(period)))
    for place, module in enumerate(modules):
        simulation.AddModelToTask("task", module, 100 - place)
    simulation.InitializeSimulation()
    for number in range(periods):
        simulation.ConfigureStopTime(macros.sec2nano(number * period))
        simulation.ExecuteSimulation()
        yield number


def torque_message(torque):
    payload = messaging.CmdTorqueBodyMsgPayload()
    payload.torqueRequestBody = torque
    return messaging.CmdTorqueBodyMsg().write(payload)


def wheel_message(given):
    fswSetupRW.clearSetup()
    for axis in given["axes"]:
        fswSetupRW.create(axis, given.get("rotor", 1.0))
    return fswSetupRW.writeConfigMessage()


def thruster_message(given):
    fswSetupThrusters.clearSetup()
    for place, force in zip(given["positions"], given["forces"], strict=True):
        size = sum(x * x for x in force) ** 0.5
        fswSetupThrusters.create(place, [x / size for x in force], size)
    return fswSetupThrusters.writeConfigMessage()


def force_mapping(config, torque):
    """The module that shares a torque message among thrusters that push."""
    module = thrForceMapping.thrForceMapping()
    module.thrForceSign, module.controlAxes_B = 1, AXES
    module.angErrThresh = 4.0  # above π: no scaling to the largest force, as impulses have none
    module.thrConfigInMsg.subscribeTo(config)
    module.cmdTorqueInMsg.subscribeTo(torque)
    body = messaging.VehicleConfigMsg().write(messaging.VehicleConfigMsgPayload())
    module.vehConfigInMsg.subscribeTo(body)
    return module, body


def motor_torques(given):
    """Torque of each motor on its wheel (N m) for a torque on the body."""
    module = rwMotorTorque.rwMotorTorque()
    module.controlAxes_B = AXES
    config, torque = wheel_message(given), torque_message(given["torque"])
    module.rwParamsInMsg.subscribeTo(config)
    module.vehControlInMsg.subscribeTo(torque)
    list(flown([module]))
    return list(module.rwMotorTorqueOutMsg.read().motorTorque)[: len(given["axes"])]


def thruster_forces(given):
    """Force of each thruster (N) for a torque on the body."""
    config, torque = thruster_message(given), torque_message(given["torque"])
    module, _body = force_mapping(config, torque)
    list(flown([module]))
    return list(module.thrForceCmdOutMsg.read().thrForce)[: len(given["forces"])]


def dumping(given):
    """Seconds for which each thruster fires until wheels hold `least` N m s together."""
    config, wheels = thruster_message(given), wheel_message(given)
    manager = thrMomentumManagement.thrMomentumManagement()
    manager.hs_min = given["least"]
    speeds = messaging.RWSpeedMsgPayload()
    speeds.wheelSpeeds = [one / given["rotor"] for one in given["momenta"]]
    speed_message = messaging.RWSpeedMsg().write(speeds)
    manager.rwSpeedsInMsg.subscribeTo(speed_message)
    manager.rwConfigDataInMsg.subscribeTo(wheels)
    mapping, _body = force_mapping(config, manager.deltaHOutMsg)
    dumper = thrMomentumDumping.thrMomentumDumping()
    dumper.thrMinFireTime, dumper.maxCounterValue = 0.0, 1
    dumper.thrusterConfInMsg.subscribeTo(config)
    dumper.deltaHInMsg.subscribeTo(manager.deltaHOutMsg)
    dumper.thrusterImpulseInMsg.subscribeTo(mapping.thrForceCmdOutMsg)
    count = len(given["forces"])
    seconds = [0.0] * count
    for number in flown([manager, mapping, dumper], given["periods"]):
        if number == 0:  # a request at time 0 counts as none
            manager.Reset(0)
        on_times = dumper.thrusterOnTimeOutMsg.read().OnTimeRequest
        seconds = [all_of + one for all_of, one in zip(seconds, on_times, strict=False)]
    return seconds


if __name__ == "__main__":
    task = {"wheels": motor_torques, "thrusters": thruster_forces, "dumping": dumping}[sys.argv[1]]
    print("FOUND" + json.dumps([task(given) for given in json.load(sys.stdin)]))
