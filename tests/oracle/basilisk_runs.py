"""Runs of Basilisk (Kenneally, Piggott, Schaub, J. Aerospace Information Systems 17(9), 2020).

In a process of its own: a run's numbers as JSON on the standard input, its end on the output.
"""

import json
import sys

from Basilisk.architecture import messaging
from Basilisk.simulation import (
    GravityGradientEffector,
    reactionWheelStateEffector,
    spacecraft,
    svIntegrators,
    thrusterDynamicEffector,
)
from Basilisk.utilities import (
    SimulationBaseClass,
    macros,
    simIncludeGravBody,
    simIncludeRW,
)


class Bench:
    """A rigid hub, integrated by RK4 in equal steps (s)."""

    def __init__(self, given):
        self.simulation = SimulationBaseClass.SimBaseClass()
        process = self.simulation.CreateNewProcess("process")
        process.addTask(self.simulation.CreateNewTask("task", macros.sec2nano(given["step"])))
        self.craft = spacecraft.Spacecraft()
        self.craft.hub.mHub = 20.0
        self.craft.hub.IHubPntBc_B = given["inertia"]
        self.craft.hub.sigma_BNInit = [[x] for x in given["sigma"]]
        self.craft.hub.omega_BN_BInit = [[x] for x in given["omega"]]
        self.integrator = svIntegrators.svIntegratorRK4(self.craft)
        self.craft.setIntegrator(self.integrator)

    def add(self, module, priority=-1):
        self.simulation.AddModelToTask("task", module, priority)

    def states(self, times, before=lambda number: None):
        """Attitude (MRP) and rate (rad/s) at each time (s)."""
        self.simulation.InitializeSimulation()
        found = []
        for number, time in enumerate(times):
            before(number)
            self.simulation.ConfigureStopTime(macros.sec2nano(time))
            self.simulation.ExecuteSimulation()
            state = self.craft.scStateOutMsg.read()
            found.append([list(state.sigma_BN), list(state.omega_BN_B)])
        return found


def thrusters(given):
    """Pulses: a row of on-times (s) for each period."""
    bench = Bench(given)
    effector = thrusterDynamicEffector.ThrusterDynamicEffector()
    for place, force in zip(given["positions"], given["forces"], strict=True):
        size = sum(x * x for x in force) ** 0.5
        one = thrusterDynamicEffector.THRSimConfig()
        one.thrLoc_B = [[x] for x in place]
        one.thrDir_B = [[x / size] for x in force]
        one.MaxThrust, one.steadyIsp, one.MinOnTime = size, 200.0, 0.0
        effector.addThruster(one)
    bench.craft.addDynamicEffector(effector)
    message = messaging.THRArrayOnTimeCmdMsg()
    effector.cmdsInMsg.subscribeTo(message)
    bench.add(effector, 10)
    bench.add(bench.craft, 5)
    period, rows = given["period"], given["on_times"]

    def fire(number):
        payload = messaging.THRArrayOnTimeCmdMsgPayload()
        payload.OnTimeRequest = rows[number]
        now = bench.simulation.TotalSim.CurrentNanos
        message.write(payload, now)

    return bench.states([period * (number + 1) for number in range(len(rows))], fire)


def wheels(given):
    """Balanced wheels, inertia with them locked: a row of motor torques (N m) for each period."""
    bench = Bench(given)
    effector = reactionWheelStateEffector.ReactionWheelStateEffector()
    factory = simIncludeRW.rwFactory()
    for axis, speed in zip(given["axes"], given["speeds"], strict=True):
        factory.create(
            "custom",
            axis,
            Js=given["rotor"],
            Omega=speed / macros.RPM,
            useMaxTorque=False,
            **given["friction"],
        )
    factory.addToSpacecraft("wheels", effector, bench.craft)
    message = messaging.ArrayMotorTorqueMsg()
    effector.rwMotorCmdInMsg.subscribeTo(message)
    bench.add(effector, 10)
    bench.add(bench.craft, 5)
    period, rows = given["period"], given["torques"]

    def turn(number):
        payload = messaging.ArrayMotorTorqueMsgPayload()
        payload.motorTorque = rows[number]
        message.write(payload, bench.simulation.TotalSim.CurrentNanos)

    return bench.states([period * (number + 1) for number in range(len(rows))], turn)


def gravity_gradient(given):
    """A circular orbit around a point mass, from the x axis on towards y."""
    bench = Bench(given)
    bodies = simIncludeGravBody.gravBodyFactory()
    earth = bodies.createEarth()
    earth.isCentralBody = True
    bodies.addBodiesTo(bench.craft)
    radius = (earth.mu / given["rate"] ** 2) ** (1 / 3)
    bench.craft.hub.r_CN_NInit = [[radius], [0.0], [0.0]]
    bench.craft.hub.v_CN_NInit = [[0.0], [radius * given["rate"]], [0.0]]
    effector = GravityGradientEffector.GravityGradientEffector()
    effector.addPlanetName(earth.planetName)
    bench.craft.addDynamicEffector(effector)
    bench.add(bench.craft, 5)
    bench.add(effector, 1)
    return bench.states(given["times"])


if __name__ == "__main__":
    task = {"thrusters": thrusters, "wheels": wheels, "gravity-gradient": gravity_gradient}
    print("FOUND" + json.dumps(task[sys.argv[1]](json.load(sys.stdin))))
