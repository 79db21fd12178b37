"""A small spacecraft with four control moment gyros in a pyramid."""

import math

SKEW = math.radians(54.73)


def document(failures=(), dispersion=None) -> dict:
    """A scenario as data: gyros turn the body, which is told its attitude and rates."""
    up, out = math.cos(SKEW), math.sin(SKEW)
    axes = ([out, 0, up], [0, out, up], [-out, 0, up], [0, -out, up])
    spins = ([0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0])
    found = {
        "title": "gyros",
        "spacecraft": {"inertia_kg_m2": [[5, 0.2, -0.1], [0.2, 4, 0.3], [-0.1, 0.3, 3]]},
        "orbit": {"altitude_km": 500.0},
        "gimbal": [
            {
                "axis": list(axis),
                "spin_axis": list(spin),
                "rotor_momentum_N_m_s": 0.8,
                "rate_limit_rad_s": 0.5,
            }
            for axis, spin in zip(axes, spins, strict=True)
        ],
        "initial": {
            "quaternion": [0.9, 0.3, -0.2, 0.24494897427831783],
            "omega_rad_s": [0.01, -0.02, 0.0],
        },
        "control": {
            "law": "quaternion-feedback",
            "natural_frequency_rad_s": 0.15,
            "damping": 0.9,
            "period_s": 0.25,
        },
        "simulation": {"duration_s": 80.0, "save_every_s": 0.5, "attitude": "quaternion"},
    }
    if failures:
        found["failure"] = list(failures)
    if dispersion:
        found["dispersion"] = dispersion
    return found
