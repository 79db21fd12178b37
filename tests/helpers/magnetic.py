"""A small spacecraft with magnetorquers, with wheels or without, healthy or failing."""

from jaxsat.scenario import Scenario

FAILURES = ((14.3, 0, "stuck-at", -0.4), (31.0, 2, "degraded", 0.5), (47.77, 1, "reversed", 0.0))
"""Instant (s), magnetorquer from 0, kind and fraction."""

TORQUERS = ([1.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.2, 0.0, 1.0])
WHEELS = ([1.0, 0.2, 0.0], [0.0, 1.0, 0.0], [0.0, 0.3, 1.0])


def document(wheels: int = 0, failing: bool = False, tolerant: bool = False) -> dict:
    """A scenario as data: magnetorquers with so many wheels, under the fault-tolerant law if it
    is asked for."""
    found = {
        "title": "magnetorquers",
        "spacecraft": {
            "inertia_kg_m2": [[0.05, 0.002, -0.001], [0.002, 0.04, 0.003], [-0.001, 0.003, 0.03]]
        },
        "orbit": {
            "altitude_km": 500.0,
            "inclination_rad": 1.1,
            "ascending_node_rad": 0.4,
            "argument_of_latitude_rad": 0.7,
            "sidereal_angle_rad": 2.0,
        },
        "magnetorquer": [{"axis": axis, "dipole_limit_A_m2": 2.0} for axis in TORQUERS],
        "wheel": [
            {"axis": axis, "momentum_N_m_s": momentum}
            for axis, momentum in zip(WHEELS[:wheels], (0.02, -0.03, 0.01), strict=False)
        ],
        "initial": {"quaternion": [0.8, 0.6, 0.0, 0.0], "omega_rad_s": [0.01, -0.02, 0.008]},
        "control": {
            "law": "quaternion-feedback",
            "natural_frequency_rad_s": 0.03,
            "damping": 0.8,
            "period_s": 0.5,
        },
        "simulation": {"duration_s": 60.0, "save_every_s": 0.5, "attitude": "quaternion"},
    }
    if wheels:
        found["unloading"] = {"time_constant_s": 500.0}
    if tolerant:
        found["control"]["law"] = "fault-tolerant"
        for one in found["wheel"]:
            one["torque_limit_N_m"] = 0.1
    if failing:
        found["failure"] = [
            {"of": f"magnetorquer {which + 1}", "at_s": at, "kind": kind}
            | ({"fraction": amount} if kind in ("stuck-at", "degraded") else {})
            for at, which, kind, amount in FAILURES
        ]
    return found


def scenario(wheels: int = 0, failing: bool = False, tolerant: bool = False) -> Scenario:
    """The same, checked."""
    return Scenario.model_validate(document(wheels, failing, tolerant))
