"""The paper's spacecraft and laws as package objects and as keyword arguments of the oracle."""

import jax.numpy as jnp
import numpy as np

from helpers.references import DISTURBANCE, RATE, THREE_AXIS
from jaxsat.control.rate import RateLaw
from jaxsat.control.three_axis import InternalModel, ThreeAxisLaw
from jaxsat.core.attitude import WZ
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit, SmallAngleOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters

PAPER_DISTURBANCE = {**DISTURBANCE, "phase": (0.0, 0.0, 0.0)}
PAPER_THREE_AXIS = {
    **THREE_AXIS,
    "relation": "small-angle",
    "third_rate": "held",
    **PAPER_DISTURBANCE,
}
PAPER_RATE = {**RATE, **PAPER_DISTURBANCE}

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
    return ContinuousLoop(
        plant.with_effectors((actuators(limit),)), RateLaw(model, case["k1"], case["k2"], width)
    )


def rate_start(case):
    return PlantState(WZ([0.0, 0.0], 0.0), list(case["omega0"]))


def size(case):
    """Length of the state at the start, to which errors are relative."""
    return np.linalg.norm([*case.get("w0", ()), case.get("z0", 0.0), *case["omega0"]])
