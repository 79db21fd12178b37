"""Two sound scenario files to break, and what is told of a broken one."""

import pytest

from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load

THREE_AXIS = """\
title = "Test"
[spacecraft]
inertia_kg_m2 = [449.5, 264.6, 312.5]
thruster_torque_axes = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
]
failed_thrusters = [3]
third_rate = "held"
[orbit]
rate_rad_s = 0.0011
[disturbance]
frequency_rad_s = [0.7, 0.8, 0.1]
[initial]
w = [-1.0, 1.0]
z_rad = 1.27
omega_rad_s = [0.1, -0.11, 0.0]
[control]
law = "three-axis"
k3 = 0.05
mu = 1.0
a = 0.1
k4 = 0.01
[control.model]
orbit_rate_rad_s = 0.0011
[simulation]
duration_s = 500.0
save_every_s = 0.5
[simulation.solver]
steps = "adaptive"
"""

SWITCHING = """\
title = "Test"
[spacecraft]
inertia_kg_m2 = [449.5, 264.6, 312.5]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]
torque_limit_N_m = 5
[orbit]
altitude_km = 400
[initial]
quaternion = [1, 0, 0, 0]
omega_rad_s = [0.1, -0.11, 0.0]
[control]
law = "switching"
k1 = 0.4
k2 = 0.2
k3 = 0.2
mu = 0.8
a = 0.05
k4 = [163, 96]
internal_model = false
upper_threshold_rad_s = 8e-3
lower_threshold_rad_s = 1e-3
period_s = 0.1
[simulation]
duration_s = 100
"""


def problems_of(text, tmp_path, overrides=()):
    path = tmp_path / "broken.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load(path, overrides)
    for problem in caught.value.problems:
        assert str(problem) in str(caught.value).split("\n")
    return caught.value.problems


def check(base, old, new, expected, tmp_path):
    assert base.count(old) == 1
    found = problems_of(base.replace(old, new), tmp_path)
    assert sorted((p.line, p.key) for p in found) == sorted((e[0], e[1]) for e in expected)
    for line, key, message in expected:
        (problem,) = [p for p in found if (p.line, p.key) == (line, key)]
        assert message in problem.message
        assert problem.message.startswith("must ")
        assert str(problem).startswith(f"{tmp_path}/broken.toml:{line}: key {key}: must ")
