"""The sampled switching loop of the paper's spacecraft."""

import numpy as np

from helpers.paper import PAPER_DISTURBANCE, actuators, bodies
from jaxsat.control.rate import RateLaw
from jaxsat.control.switching import SwitchingLaw
from jaxsat.control.three_axis import ThreeAxisLaw
from jaxsat.core.attitude import WZ
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState

J = np.array([449.5, 264.6])
CASE = {"inertia": (449.5, 264.6, 312.5), "orbit_rate": 0.0011, **PAPER_DISTURBANCE}
GAINS = {"k1": 0.457, "k2": 0.201, "k3": 0.187, "mu": 0.791, "a": 0.0514}
START = {"w0": (-1.0, 1.0), "z0": 1.27, "omega0": (0.1, -0.11, 0.0)}


def switching_loop(case, *, limit=5.0, period=0.1, upper=7.9e-3, lower=1.4e-3, internal=None):
    plant, model = bodies(case)
    law = SwitchingLaw(
        RateLaw(model, GAINS["k1"], GAINS["k2"]),
        ThreeAxisLaw(model, GAINS["k3"], GAINS["mu"], GAINS["a"], list(0.363 * J), internal, 0.914),
        upper,
        lower,
        period,
        list(limit / J),
        list(5 * limit / J),
    )
    return SampledLoop(plant.with_effectors((actuators(limit),)), law)


def start(attitude="as_quaternion"):
    wz = WZ(list(START["w0"]), START["z0"])
    return PlantState(getattr(wz, attitude)(), list(START["omega0"]))
