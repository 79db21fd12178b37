"""A tuning run that is cheap to compile and to run: the rate law from a slow tumble."""

RATE = """
title = "A slow tumble, stopped"

[spacecraft]
inertia_kg_m2 = [449.5, 264.6, 312.5]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
failed_thrusters = [3]
third_rate = "free"

[orbit]
rate_rad_s = 0.0011

[initial]
w = [0, 0]
z_rad = 0
omega_rad_s = [0.0, 0.0, 0.05]

[control]
law = "rate"
k1 = 0.5
k2 = 0.3
omega3_width_rad_s = 1e-3

[simulation]
duration_s = 8
save_every_s = 1.0
attitude = "wz"
seed = 5

[simulation.solver]
name = "midpoint"
steps = "fixed"
step_s = 0.1

[dispersion.omega_rad_s]
distribution = "uniform"
low = [-0.02, -0.02, 0.03]
high = [0.02, 0.02, 0.07]

[tuning]
steps = 4
cases = 4
starts = 3
screened = 5
halve_at = [2]
validate_every = 3
validation_cases = 4
receipt_cases = 3
held_out_cases = 8
alarm_cost = 100

[tuning.cost]
w = 0
z = 0
torque = 1e-6
limit = 50

[tuning.smoothing]
omega3_width_rad_s = 1e-2

[tuning.parameters.k1]
low = 0.1
high = 3

[tuning.parameters.k2]
low = 0.05
high = 3
scale = "logit"
"""
