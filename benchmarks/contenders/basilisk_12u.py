"""Basilisk flies a 12U CubeSat for 900 s to rest, written out: a whole process to be measured.

A rigid hub with the inertia of the scenario `cubesat-12u` under its C modules simpleNav,
inertial3D, attTrackingError and mrpFeedback, sampled every 0.2 s; no pulses, no figures.
"""

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import attTrackingError, inertial3D, mrpFeedback
from Basilisk.simulation import extForceTorque, simpleNav, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros

INERTIA = [0.30, 0.0, 0.0, 0.0, 0.55, 0.0, 0.0, 0.0, 0.62]


def main() -> None:
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(0.2)))
    hub = spacecraft.Spacecraft()
    hub.hub.mHub = 12.0
    hub.hub.IHubPntBc_B = np.reshape(INERTIA, (3, 3)).tolist()
    hub.hub.sigma_BNInit = [[0.5], [-0.35], [0.6]]
    hub.hub.omega_BN_BInit = [[0.0], [0.0], [0.0]]
    torque = extForceTorque.ExtForceTorque()
    hub.addDynamicEffector(torque)
    navigation, reference = simpleNav.SimpleNav(), inertial3D.inertial3D()
    navigation.scStateInMsg.subscribeTo(hub.scStateOutMsg)
    reference.sigma_R0N = [0.0, 0.0, 0.0]
    error = attTrackingError.attTrackingError()
    error.attNavInMsg.subscribeTo(navigation.attOutMsg)
    error.attRefInMsg.subscribeTo(reference.attRefOutMsg)
    control = mrpFeedback.mrpFeedback()
    control.K, control.Ki, control.P = 0.007, -1.0, 0.06
    control.guidInMsg.subscribeTo(error.attGuidOutMsg)
    vehicle = messaging.VehicleConfigMsgPayload(ISCPntB_B=INERTIA)
    message = messaging.VehicleConfigMsg().write(vehicle)
    control.vehConfigInMsg.subscribeTo(message)
    torque.cmdTorqueInMsg.subscribeTo(control.cmdTorqueOutMsg)
    record = hub.scStateOutMsg.recorder()
    for module in (hub, torque, navigation, reference, error, control, record):
        simulation.AddModelToTask("task", module)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(900.0))
    simulation.ExecuteSimulation()
    if not np.linalg.norm(record.sigma_BN[-1]) < 1e-2:
        raise RuntimeError("Basilisk's run did not come to rest.")


if __name__ == "__main__":
    main()
