"""What the thrusters and wheels of a scenario can do, from its tables."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.controllability.judging import judge
from jaxsat.controllability.wording import verdict_sentence
from jaxsat.scenario import dump
from jaxsat.scenario.build.actuator_set import all_actuators, fitting_laws, judge_scenario
from jaxsat.scenario.build.load import load

PAPER = "paper-three-axis"


def of_thrusters(tmp_path, *tables):
    """The paper's spacecraft with tables [[thruster]] in place of its ideal torques."""
    text = dump(load(PAPER, (), purpose="motion"))
    given = ("thruster_torque_axes", "failed_thrusters", "third_rate")
    lines = [line for line in text.splitlines() if not line.startswith(given)]
    for table in tables:
        lines += ["[[thruster]]", *(f"{key} = {value}" for key, value in table.items())]
    path = tmp_path / "pushing.toml"
    path.write_text("\n".join(lines) + "\n")
    return load(str(path), (), purpose="motion")


def about(torque, **keys):
    return {"torque_axis": list(torque), "torque_N_m": 1.0, **keys}


def test_ideal_torques_have_both_signs_and_fail_by_number():
    actuators, working = all_actuators(load(PAPER, (), purpose="motion"))
    assert actuators.two_sided.all()
    assert (actuators.thrusters, working) == (("g1", "g2", "g3"), [0, 1])
    assert actuators.forces is None


def test_thrusters_push_one_way_by_place_or_by_torque(tmp_path):
    placed = {"position_m": [0.0, 2.0, 0.0], "direction": [0, 0, 5.0], "force_N": 3.0}
    scenario = of_thrusters(tmp_path, placed, {**placed, "two_sided": "true", "failed": "true"})
    actuators, working = all_actuators(scenario)
    np.testing.assert_allclose(actuators.torques.T, [[6, 0, 0]] * 2)
    np.testing.assert_allclose(actuators.forces.T, [[0, 0, 3]] * 2)
    assert (actuators.two_sided.tolist(), working) == ([False, True], [0])
    scenario = of_thrusters(tmp_path, placed, about([0, 0, 2], name='"+z pair"'))
    actuators, _ = all_actuators(scenario)
    assert actuators.forces is None
    assert actuators.thrusters == ("g1", "+z-pair")
    np.testing.assert_allclose(actuators.torques[:, 1], [0, 0, 1])


def test_thrusters_that_no_law_can_use_are_judged(tmp_path):
    axes = [(1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, -1, 1)]
    scenario = of_thrusters(tmp_path, *(about(axis) for axis in axes))
    actuators, working = all_actuators(scenario)
    found = judge(scenario.spacecraft.inertia_kg_m2, actuators.only(working))
    assert (found.rank, found.verdict, found.cone.kind) == (6, "by drift", "pointed cone")


def test_wheels_carry_the_momentum_of_body_and_wheels():
    scenario = load(PAPER, ("initial.omega_rad_s=[0.0, 0.0, 0.0]",), purpose="motion")
    wheel = {"name": None, "failed": False, "momentum_N_m_s": 0.5, "rotor_inertia_kg_m2": None}
    wheels = (
        SimpleNamespace(**wheel, axis=(0.0, 0.0, 2.0)),
        SimpleNamespace(**{**wheel, "failed": True, "name": "g1"}, axis=(0.0, 3.0, 4.0)),
    )
    actuators, working = all_actuators(scenario.model_copy(update={"wheel": wheels}))
    np.testing.assert_allclose(actuators.momentum, [0, 0.3, 0.9])
    assert actuators.names == ("g1-g1", "g2-g2", "g3-g3", "w1-w1", "g1-w2")
    assert working == [0, 1, 3]
    moving = load(PAPER, ("initial.omega_rad_s=[0.01, 0.0, 0.0]",), purpose="motion")
    assert all_actuators(moving)[0].momentum == pytest.approx([4.495, 0, 0])


def test_a_run_says_what_controllability_says_of_torques_of_nearly_one_direction():
    """With the words of its verdict; the verified domain of the law has cautions of its own."""
    told = []

    def words(axes):
        told.clear()
        overrides = [f"spacecraft.thruster_torque_axes={axes}", "spacecraft.failed_thrusters=[]"]
        scenario = load("two-torque-free", overrides, caution=told.append)
        actuators, working = all_actuators(scenario)
        verdict = verdict_sentence(judge(scenario.spacecraft.inertia_kg_m2, actuators))
        assert working == [0, 1]
        return verdict, [text for text in told if "apart by more than their last digits" in text]

    verdict, cautions = words("[[1, 0, 0], [1, 1.745e-6, 0]]")
    assert verdict.startswith("Borderline")
    assert len(cautions) == 1
    assert "spacecraft.thruster_torque_axes" in cautions[0]
    assert verdict in cautions[0]
    verdict, cautions = words("[[1, 0, 0], [1, 0.1, 0]]")
    assert verdict.startswith("Controllable")
    assert cautions == []


@pytest.mark.parametrize("laws", FLYABLE)
def test_the_law_that_finds_failures_is_tried_first_where_some_strike(laws):
    """Of wheels and thrusters; it diagnoses no magnetorquer."""
    scenario = load("hybrid-wheels", (), purpose="motion")
    judgement = dataclasses.replace(judge_scenario(scenario), laws=laws)
    usual = list(FLYABLE[laws].laws)
    first = ["fault-tolerant", *(law for law in usual if law != "fault-tolerant")]
    for absent, names in (
        ((), first),
        (("wheel",), first),
        (("thruster",), first),
        (("wheel", "thruster"), usual),
        (("failure",), usual),
    ):
        some = scenario.model_copy(update=dict.fromkeys(absent, ()))
        assert fitting_laws(some, judgement) == names
