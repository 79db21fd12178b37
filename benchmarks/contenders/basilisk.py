"""Basilisk (`bsk`), where it is installed: the nearest that its own modules come to the work."""

import numpy as np

from contenders.contender import Contender, Run
from contenders.work import J1, J2
from jaxsat.studies.ensemble import Study

J3 = 312.5
NOTE = (
    "a rigid hub of the same inertia under its C modules simpleNav, inertial3D, attTrackingError "
    "and mrpFeedback on three axes, the torque held over each step of its RK4: neither the same "
    "law nor a disturbance nor an internal model nor a cost, so its answers are not compared; one "
    "simulation after the other on one processor, set up in Python as its Monte-Carlo tool does"
)


def one(duration: float, step: float, start: np.ndarray) -> np.ndarray:
    """Attitude (MRP) and rates at the end of one run."""
    from Basilisk.architecture import messaging
    from Basilisk.fswAlgorithms import attTrackingError, inertial3D, mrpFeedback
    from Basilisk.simulation import extForceTorque, simpleNav, spacecraft
    from Basilisk.utilities import SimulationBaseClass, macros

    inertia = [J1, 0.0, 0.0, 0.0, J2, 0.0, 0.0, 0.0, J3]
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(step)))

    hub = spacecraft.Spacecraft()
    hub.hub.mHub = 750.0
    hub.hub.IHubPntBc_B = np.reshape(inertia, (3, 3)).tolist()
    hub.hub.sigma_BNInit = start[:3, None].tolist()
    hub.hub.omega_BN_BInit = start[3:, None].tolist()
    torque = extForceTorque.ExtForceTorque()
    hub.addDynamicEffector(torque)
    navigation, reference = simpleNav.SimpleNav(), inertial3D.inertial3D()
    navigation.scStateInMsg.subscribeTo(hub.scStateOutMsg)
    reference.sigma_R0N = [0.0, 0.0, 0.0]
    error = attTrackingError.attTrackingError()
    error.attNavInMsg.subscribeTo(navigation.attOutMsg)
    error.attRefInMsg.subscribeTo(reference.attRefOutMsg)
    control = mrpFeedback.mrpFeedback()
    control.K, control.Ki, control.P = 3.5, -1.0, 30.0
    control.guidInMsg.subscribeTo(error.attGuidOutMsg)
    vehicle = messaging.VehicleConfigMsg().write(
        messaging.VehicleConfigMsgPayload(ISCPntB_B=inertia)
    )
    control.vehConfigInMsg.subscribeTo(vehicle)
    torque.cmdTorqueInMsg.subscribeTo(control.cmdTorqueOutMsg)
    for module in (hub, torque, navigation, reference, error, control):
        simulation.AddModelToTask("task", module)

    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(duration))
    simulation.ExecuteSimulation()
    state = hub.scStateOutMsg.read()
    return np.concatenate([state.sigma_BN, state.omega_BN_B])


def attitude_control(study: Study, count: int, step: float) -> Run:
    """Runs from starts of about the same size."""
    duration = float(study.program.duration)
    starts = np.random.default_rng(1).uniform(-0.3, 0.3, (count, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]

    def run() -> None:
        for start in starts:
            end = one(duration, step, start)
            if not np.linalg.norm(end) < np.linalg.norm(start):
                raise RuntimeError("Basilisk's run did not come to rest.")

    return run


def contenders() -> list[Contender]:
    """Basilisk."""
    return [Contender("Basilisk, RK4, another law", (0.1,), attitude_control, most=32, note=NOTE)]
