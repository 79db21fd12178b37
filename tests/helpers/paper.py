"""The paper's spacecraft and laws as package objects and as keyword arguments of the oracle."""

import jax.numpy as jnp
import numpy as np

from jaxsat.attitude import WZ
from jaxsat.control import InternalModel, RateLaw, ThreeAxisLaw
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.environment import ExactOrbit, PeriodicTorque, SmallAngleOrbit
from jaxsat.simulation import ContinuousLoop, ErrorCoordinateLoop
from jaxsat.vehicle import Actuators, Spacecraft, Thrusters

PAPER_DISTURBANCE = {
    "amplitude": (0.01, 0.02, 0.001),
    "frequency": (0.7, 0.8, 0.1),
    "phase": (0.0, 0.0, 0.0),
}

PAPER_THREE_AXIS = {
    "inertia": (449.5, 264.6, 312.5),
    "k3": 0.05,
    "k4": 0.01,
    "mu": 1.0,
    "a": 0.1,
    "w0": (-1.0, 1.0),
    "z0": 1.27,
    "omega0": (0.1, -0.11, 0.0),
    "orbit_rate": 0.0011,
    "relation": "small-angle",
    "third_rate": "held",
    **PAPER_DISTURBANCE,
}

PAPER_RATE = {
    "inertia": (449.5, 264.6, 312.5),
    "k1": 5.0,
    "k2": 10.0,
    "omega0": (0.1, -0.11, 0.1),
    **PAPER_DISTURBANCE,
}

ORBITS = {"exact": ExactOrbit, "small-angle": SmallAngleOrbit}
UNLIMITED = Actuators.of(Thrusters(jnp.eye(3)).without([3]))


def actuators(limit=jnp.inf):
    return Actuators(UNLIMITED.torque_axes, UNLIMITED.thrust_map, limit)


def bodies(case, measured=(False, False, False)):
    """Plant and the law's model of it, which knows the measured components of the disturbance."""
    craft = Spacecraft(list(case["inertia"]))
    orbit = ORBITS[case.get("relation", "small-angle")](case.get("orbit_rate", 0.0011))
    held = case.get("third_rate", "free") == "held"
    shape = (list(case["frequency"]), list(case["phase"]))
    true = PeriodicTorque(list(case["amplitude"]), *shape)
    known = PeriodicTorque(np.where(measured, case["amplitude"], 0.0), *shape)
    return RigidBody(craft, orbit, true, held), RigidBody(craft, orbit, known, held)


def three_axis_law(case, **options):
    model = bodies(case)[1]
    frequency = case.get("internal_model_frequency") or case["frequency"][:2]
    return ThreeAxisLaw(
        model,
        case["k3"],
        case["mu"],
        case["a"],
        case["k4"],
        internal_model=InternalModel(list(frequency)),
        **options,
    )


def three_axis_start(case):
    return PlantState(WZ(list(case["w0"]), case["z0"]), list(case["omega0"]))


def three_axis_loop(case):
    """The printed law in error coordinates."""
    return ErrorCoordinateLoop(bodies(case)[0], three_axis_law(case))


def rate_loop(case, measured=(True, True, False), width=0.0, limit=jnp.inf):
    plant, model = bodies(case, measured)
    return ContinuousLoop(plant, RateLaw(model, case["k1"], case["k2"], width), actuators(limit))


def rate_start(case):
    return PlantState(WZ([0.0, 0.0], 0.0), list(case["omega0"]))


def size(case):
    """Length of the state at the start, to which errors are relative."""
    return np.linalg.norm([*case.get("w0", ()), case.get("z0", 0.0), *case["omega0"]])
