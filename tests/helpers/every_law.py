"""A scenario of every law that a scenario can name, with all its defaults.

The required keys of a new law are to be added to `KEYS`, and to `BODIES` what it flies if that is
no plain body with ideal thrusters.
"""

import tomllib
from importlib import resources

from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.schema import Scenario

IN_WZ = {"k3": 0.05, "mu": 0.5, "a": 0.2, "k4": 60.0, "internal_model_frequency_rad_s": [0.7, 0.8]}
RATES = {"k1": 0.5, "k2": 0.3}
THRESHOLDS = {"upper_threshold_rad_s": 8e-3, "lower_threshold_rad_s": 1.4e-3, "period_s": 0.1}
KEYS = {
    "rate": RATES,
    "three-axis": IN_WZ,
    "quaternion-feedback": {"natural_frequency_rad_s": 0.1},
    "fault-tolerant": {"natural_frequency_rad_s": 0.06},
    "switching": {**RATES, **IN_WZ, **THRESHOLDS},
}
"""Of `[control]`: those without a default."""

BODIES = {"fault-tolerant": "hybrid-wheels", "magnetic": "rods-only"}
"""Scenarios of the library that have the actuators that a law needs."""

ACTUATORS = ("thruster", "wheel", "magnetorquer")

LEFT = {
    0: ([1.0, 0.0, 0.0], [3]),
    1: ([0.8, 0.5, 0.331662479], [2, 3]),
    2: ([1.0, 0.0, 0.0], [3]),
    3: ([1.0, 0.0, 0.0], []),
}
"""The first thruster's axis and which have failed, by how many torques a law commands."""

PLANNED = "planned"
"""Searches in flight: a minute to compile. Its parts are those of three-slew."""

UPSIDE_DOWN = ("half a turn about x", "half a turn about y")
PLACES = {
    "a start": [0.7, 0.1, -0.5, 0.5],
    "the target": [1.0, 0.0, 0.0, 0.0],
    "half a turn about x": [0.0, 1.0, 0.0, 0.0],
    "half a turn about y": [0.0, 0.0, 1.0, 0.0],
    "half a turn about z": [0.0, 0.0, 0.0, 1.0],
}


def library(name):
    """A scenario of the library as data."""
    folder = resources.files("jaxsat.scenario") / "library"
    return tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))


def scenario_of(law, **changes):
    """A scenario of a law with all its defaults."""
    control = {"law": law, **KEYS.get(law, {})}
    if law in BODIES:
        data = library(BODIES[law])
        kept = ("title", "spacecraft", "orbit", *ACTUATORS, "modulation", "initial")
        data = {key: data[key] for key in (*kept, "simulation") if key in data}
    else:
        first, failed = LEFT[LAWS[law].declaration.torques]
        data = {
            "title": law,
            "spacecraft": {
                "inertia_kg_m2": [449.5, 264.6, 312.5],
                "thruster_torque_axes": [first, [0, 1, 0], [0, 0, 1]],
                "failed_thrusters": failed,
                "torque_limit_N_m": 5.0,
            },
            "orbit": {"rate_rad_s": 0.0011},
            "initial": {"quaternion": [0.8, 0.6, 0, 0], "omega_rad_s": [0.01, -0.02, 0.03]},
            "simulation": {"duration_s": 20},
        }
    data["control"] = control
    return Scenario.model_validate(data | changes, context={"law": True})
