"""What is told of thrusters and wheels beside one that coasts."""

import dataclasses

import numpy as np

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.failures import failure_records, failure_table
from jaxsat.controllability.judging import judge, judge_once_stopped
from jaxsat.controllability.wording import verdict_sentence

INERTIA = np.diag([4.0, 3.0, 2.0])


def vehicle(momentum=0.2, torques=((1, 0), (0, 1), (0, 0)), two_sided=True):
    """Thrusters beside one wheel along (1, 2, 2)/3."""
    return actuator_set(
        np.array(torques, float),
        two_sided=two_sided,
        wheel_axes=np.array([[1.0], [2.0], [2.0]]),
        momentum=np.array([1, 2, 2]) / 3 * momentum,
        stored=[momentum],
    )


def coasting(actuators):
    return judge(INERTIA, actuators.only(range(len(actuators.thrusters))))


def test_both_verdicts_are_told():
    found = coasting(vehicle())
    stopped = judge_once_stopped(found)
    assert (found.verdict, found.laws) == ("by drift", "none")
    assert "0.2 N m s" in verdict_sentence(found)
    assert stopped is not None
    assert (stopped.verdict, stopped.laws) == ("controllable", "two torques")
    (record,) = [
        one for one in failure_records(failure_table(INERTIA, vehicle())) if one["failed"] == "w1"
    ]
    assert (record["verdict"], record["once_stopped"]) == ("by drift", "controllable")
    assert judge_once_stopped(coasting(vehicle(0.0))) is None


def test_three_torques_are_as_good_as_before_and_less_is_not_decided():
    assert coasting(vehicle(torques=np.eye(3))).verdict == "controllable"
    one = coasting(vehicle(torques=[[1.0], [0.0], [0.0]]))
    assert (one.verdict, one.laws) == ("not decided", "none")
    pushing = coasting(vehicle(torques=np.eye(3), two_sided=False))
    assert pushing.verdict == "not decided"


def test_two_wheels_beside_one_that_coasts():
    """At rest with only the failed wheel turning: H = β, which fits where the body is."""
    axes = np.eye(3)
    everything = actuator_set(wheel_axes=axes, stored=[0, 0, 0.3], momentum=[0, 0, 0.3])
    found = judge(INERTIA, everything.only([0, 1]))
    assert found.verdict == "some attitudes"
    assert "0.3 N m s of the wheels that coast" in verdict_sentence(found)
    spun = dataclasses.replace(everything, momentum=np.array([0, 0, 0.1]))
    found = judge(INERTIA, spun.only([0, 1]))
    assert found.verdict == "uncontrollable"
    assert "rest is possible at no attitude" in verdict_sentence(found)


def test_verdicts_are_the_same_for_a_body_of_any_size():
    """Lengths of 1e-3 are inertia and momentum of 1e-15; what cancels leaves no momentum."""
    verdicts = []
    for scale in (1e-15, 1.0, 1e6):
        whole = scale * np.array([0.0, 0.1, 0.3])
        actuators = actuator_set(wheel_axes=np.eye(3), stored=whole, momentum=whole)
        records = failure_records(failure_table(scale * INERTIA, actuators))
        verdicts.append([(one["verdict"], one["laws"], one["rank"]) for one in records])
        opposed = actuator_set(
            wheel_axes=np.array([[1, 1, 0, 0], [1, 1, 0, 1], [0, 0, 1, 0]]),
            stored=scale * np.array([0.1 + 0.2, -0.3, 0, 0]),
        )
        assert judge(scale * INERTIA, opposed.only([2, 3])).laws == "two wheels"
    assert verdicts[0] == verdicts[1] == verdicts[2]
    assert ("some attitudes", "nearest attitude", 5) in verdicts[1]
