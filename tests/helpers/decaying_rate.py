"""A scenario whose rates have a closed form: those of the rate law (39) decay from what is drawn.

While ω3 = 0, ω1 and ω2 are η exp(-k2 t) with the drawn errors η of the rates.
"""

from collections.abc import Sequence

DECAY = 0.5
"""k2 of (39), 1/s."""

SCENARIO = f"""
title = "One rate decays"
[spacecraft]
inertia_kg_m2 = [449.5, 264.6, 312.5]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
failed_thrusters = [3]
third_rate = "held"
[orbit]
rate_rad_s = 0.0011
relation = "small-angle"
[initial]
w = [0, 0]
z_rad = 0
omega_rad_s = [0, 0, 0]
[control]
law = "rate"
k1 = 5
k2 = {DECAY}
[simulation]
duration_s = 8
save_every_s = 0.5
seed = 5
[dispersion.rate_error_rad_s]
distribution = "normal"
"""


def decaying_rate(mean: float | Sequence[float], sigma: float, requirements: str) -> str:
    """Return the scenario with errors (rad/s) of this mean and deviation, and with requirements."""
    return f"{SCENARIO}mean = {mean}\nsigma = {sigma}\n{requirements}"
