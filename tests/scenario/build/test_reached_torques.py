"""Torques at the start by the reach of every effector, against the analysis of gyros alone."""

import numpy as np
import pytest

from helpers.gyros import document
from jaxsat.core.declaration.gimbals import GIMBAL
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.actuator_set import gyro_cluster
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.reached_torques import reached_torques


@pytest.mark.parametrize("failed", [False, True])
def test_reaches_of_gyros_are_those_of_their_own_analysis(failed):
    data = document()
    data["gimbal"][0] |= {"angle_rad": 0.2, "failed": failed}
    scenario = Scenario.model_validate(data)
    torques, cluster = reached_torques(scenario, (GIMBAL,)), gyro_cluster(scenario)
    assert torques is not None
    assert cluster is not None
    assert torques.reserve == pytest.approx(cluster.reserve, rel=1e-12)
    assert torques.axes == 3
    left = [cluster.locked([place]).reserve for place in range(failed, 4)]
    assert torques.after == {("control moment gyros", "locked"): pytest.approx(left, rel=1e-9)}
    assert torques.verdict().startswith("Controllable: control moment gyros included, actuators")
    three = sum(one > 0 for one in left)
    assert (
        f"one more locked: {three} of {len(left)} cases leave three torques" in torques.lines()[0]
    )


def test_wheels_beside_gyros_count_as_far_as_they_work():
    data = document()
    for one in data["gimbal"][:3]:
        one["failed"] = True
    axes = ([1, 0, 0], [0, 1, 0], [0, 0, 1])
    wheels = [{"axis": axis, "torque_limit_N_m": 0.1} for axis in axes]
    whole = reached_torques(Scenario.model_validate(data | {"wheel": wheels}), (GIMBAL,))
    assert whole is not None
    assert whole.reserve >= 0.1
    lost = [*wheels[:2], wheels[2] | {"failed": True}]
    broken = reached_torques(
        Scenario.model_validate(data | {"wheel": lost[:1] + lost[2:]}), (GIMBAL,)
    )
    assert broken is not None
    assert (broken.reserve, broken.axes) == (0.0, 2)
    assert broken.verdict() == (
        "Not decided: control moment gyros included, actuators make two torques at the start."
    )


def test_only_actuators_that_no_other_verdict_counts_are_judged_by_their_reach():
    assert reached_torques(load("wheels-fail")) is None
    assert reached_torques(Scenario.model_validate(document())) is None


def test_thrusters_beside_gyros_push_their_own_way_with_their_own_thrust():
    data = document()
    for one in data["gimbal"]:
        one["failed"] = True
    axes = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1]])
    thrusters = [
        {"name": f"t{n}", "torque_axis": axis.tolist(), "torque_N_m": 0.05}
        for n, axis in enumerate(axes)
    ]
    torques = reached_torques(Scenario.model_validate(data | {"thruster": thrusters}), (GIMBAL,))
    assert torques is not None
    assert torques.axes == 3
    directions = np.random.default_rng(1).standard_normal((100_000, 3))
    pushes = 0.05 * axes / np.linalg.norm(axes, axis=1)[:, None]
    most = np.maximum(directions @ pushes.T, 0).sum(axis=1) / np.linalg.norm(directions, axis=1)
    assert most.min() * 0.98 < torques.reserve < most.min()
