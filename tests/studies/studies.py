"""A study that is cheap to compile and to run: tumbling without control."""

import sys

import jax.numpy as jnp

from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.program import program_of
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.studies.designs import Independent
from jaxsat.studies.dispersions import Dispersed, Dispersions
from jaxsat.studies.distributions import Uniform
from jaxsat.studies.ensemble import Study
from jaxsat.studies.executors import Serial
from jaxsat.studies.run import run_study


def tumbling_loop():
    torque = PeriodicTorque([0.5, 0.2, 0.1], [0.7, 0.8, 0.1])
    plant = RigidBody(Spacecraft([449.5, 264.6, 312.5]), ExactOrbit(0.0011), torque)
    return ContinuousLoop(
        plant.with_effectors((Actuators.of(Thrusters(jnp.eye(3)).without([3])),)), Coast()
    )


def tumbling(count=100, chunk=16, design=None, seed=4, batch_size=8, duration=20.0, **also):
    loop = tumbling_loop()
    begin = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), [0.0, 0.0, 0.0])
    dispersions = Dispersions(
        {
            "inertia": Uniform(-0.1, 0.1),
            "disturbance_phase": Uniform(0.0, 6.28),
            "omega": Uniform([-0.03, -0.01, -0.01], [0.03, 0.01, 0.01]),
            **also,
        }
    )
    copies = Dispersed(loop, begin, dispersions, seed)
    tolerances = Tolerances(0.2, 0.2, 0.1)
    program = program_of(copies, loop, duration, tolerances=tolerances)
    design = Independent(seed) if design is None else design
    engine = ScanEngine(FixedStepper(substeps=2), batch_size)
    return Study(program, design, engine, count, chunk)


if __name__ == "__main__":  # python -m studies.studies STORE: a run to be killed
    import jax

    jax.config.update("jax_enable_x64", True)
    study = tumbling(1200, 8, duration=200.0)
    print("begun", flush=True)
    run_study(study, sys.argv[1], executor=Serial(), report=lambda p: print(p.done, flush=True))
