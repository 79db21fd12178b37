"""Time against effort: exact efforts of a turn about a driven axis, a law's own, the command."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from jaxsat.report.front import front_figure
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build, build_tolerances
from jaxsat.synthesis.comparison.front import (
    FlownPoint,
    Front,
    FrontPoint,
    _falling,
    front,
)
from jaxsat.synthesis.comparison.in_scenario import scenario_under

LIMIT, MOMENT, ANGLE = 5.0, 449.5, 0.4

TURN = [
    "orbit.rate_rad_s=0",
    "disturbance.amplitude_N_m=[0,0,0]",
    f"initial.w=[{math.tan(ANGLE / 2)},0]",
    "initial.z_rad=0",
    "initial.omega_rad_s=[0,0,0]",
    "simulation.duration_s=50",
    "simulation.save_every_s=0.1",  # every control period
]
"""At rest, turned about x alone: w = tan(angle / 2) about that axis."""


def least_effort(duration):
    """Thrust, coast, brake: J θ = T t (duration - t), 2 T t of effort."""
    thrusting = (duration - math.sqrt(duration**2 - 4 * MOMENT * ANGLE / LIMIT)) / 2
    return 2 * LIMIT * thrusting


@pytest.mark.slow
def test_a_turn_about_a_driven_axis_and_laws_beside_it(command_line, tmp_path, monkeypatch):
    """With fewer durations, each of which is planned three times."""
    stretches = (1.01, 1.1, 1.35, 2.0, 5.0)
    monkeypatch.setattr("jaxsat.synthesis.comparison.front.STRETCHES", stretches)
    sets = [token for change in TURN for token in ("--set", change)]
    laws = ["--law", "three-slew", "--law", "oscillatory", "--guesses", "6", "--end", "rest"]
    tokens = ["front", "acceptance-nominal", *sets, *laws, "--out", "f"]
    status, out, err = command_line(*tokens)
    assert status == 0, err
    assert {path.name for path in (tmp_path / "f").iterdir()} >= {
        "front.json",
        "front.png",
        "front.svg",
    }
    (found,) = json.loads((tmp_path / "f" / "front.json").read_text())["fronts"]
    shortest = 2 * math.sqrt(MOMENT * ANGLE / LIMIT)
    assert (found["torque_limit_N_m"], found["end"]) == (LIMIT, "rest")
    assert found["failed_durations_s"] == []
    points = [(one["duration_s"], one["effort_N_m_s"]) for one in found["front"]]
    assert points[0][0] == pytest.approx(shortest, rel=2e-3)
    assert len(points) == len(stretches) + 1
    for duration, effort in points[2:]:  # intervals of 1/48 of it cost up to 2.1 %
        assert least_effort(duration) * 0.999 < effort < least_effort(duration) * 1.03
    assert "\nPlans end exactly at rest" in out

    slew, slow = found["laws"]
    assert slow == {"law": "oscillatory", "settled_from_s": None, "effort_N_m_s": None}
    trajectory = build(scenario_under(load("acceptance-nominal", TURN), "three-slew")).simulate()
    held = 0.1 * np.abs(trajectory.signals.torque[:-1]).sum(axis=1)  # the axes of the thrusters
    settled = slew["settled_from_s"] + np.array([-0.1, 0.1])
    efforts = np.interp(settled, trajectory.times[1:], held.cumsum())
    assert efforts[0] - 1e-6 <= slew["effort_N_m_s"] <= efforts[1] + 1e-6
    *_, flown, unsettled, _ = out.splitlines()
    assert flown.split()[:2] == ["5", "three-slew"]
    assert "oscillatory, which does not settle" in unsettled  # takes longer
    status, _, err = command_line(*tokens)
    assert status == 2
    assert "--overwrite" in err


@pytest.mark.slow
def test_laws_that_settle_count_where_plans_end_settled(monkeypatch):
    """The planner is left out: one plan arrives, in the least time and later."""
    plan = SimpleNamespace(duration=80.0, effort=1000.0)
    planners, told = [], []

    def quickest(planner, start):
        planners.append(planner)
        return [plan]

    module = "jaxsat.synthesis.comparison.front."
    monkeypatch.setattr(module + "quickest_plans", quickest)
    monkeypatch.setattr(module + "_cheapest", lambda *given: [(90.0, None)])
    monkeypatch.setattr(module + "arrives", lambda manoeuvre, plan: True)
    scenario = load("acceptance-nominal", TURN)
    found = front(scenario, ["three-slew"], 6, told.append)
    tolerances = build_tolerances(scenario)
    assert [one.tolerances for one in planners] == [tolerances]
    assert found.failed == [90.0]
    (flown,) = found.flown
    assert 0 < flown.settled_from < 80
    assert found.points[0] == FrontPoint(flown.settled_from, flown.effort)
    assert (FrontPoint(80.0, 1000.0) in found.points) == (flown.effort > 1000)
    assert told == ["least time", "flying three-slew"]
    assert front(scenario, ["three-slew"], 6, end="rest").points == [FrontPoint(80.0, 1000.0)]
    assert planners[-1].tolerances is None


FRONTS = [
    Front(5.0, [FrontPoint(30.0, 300.0), FrontPoint(60.0, 90.0)], [70.0], []),
    Front(0.3, [], [9.0], [FlownPoint("a", math.inf, math.nan), FlownPoint("$b", 80.0, 99.0)]),
]


def test_figure_of_fronts():
    figure = front_figure([one.as_data() for one in FRONTS], "a title")
    first, second = figure.axes
    np.testing.assert_array_equal(first.lines[0].get_xdata(), [30, 60])
    np.testing.assert_array_equal(first.lines[0].get_ydata(), [300, 90])
    assert [line.get_xdata()[0] for line in second.lines if len(line.get_xdata())] == [80.0]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["least effort within the time, until settled", "law \\$b"]
    assert "s)" in first.get_xlabel()
    figure.canvas.draw()


def test_a_point_that_another_one_beats_is_left_out():
    points = [FrontPoint(*one) for one in [(3, 8), (2, 9), (4, 8), (2, 7), (5, 1)]]
    assert _falling(points) == [FrontPoint(2, 7), FrontPoint(5, 1)]


def test_what_is_not_finite_is_none_in_the_data():
    assert FRONTS[1].as_data()["laws"][0] == {
        "law": "a",
        "settled_from_s": None,
        "effort_N_m_s": None,
    }


def test_no_plan_is_told_with_what_to_do(command_line, monkeypatch, tmp_path):
    monkeypatch.setattr("jaxsat.front", lambda *arguments: FRONTS[1])
    status, out, err = command_line("front", "acceptance-nominal", "--out", "f")
    assert status == 1
    assert "a, which does not settle" in out
    assert "\nPlans end settled, |w| < 0.05, |z| < 0.05 rad" in out
    assert "no plan reaches the target with 0.3 N m; give more --guesses" in err
    assert (tmp_path / "f" / "front.json").is_file()


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (["two-wheel-telescope"], "wheel: must be left out for a front"),
        (["paper-rate"], "spacecraft.torque_limit_N_m: must be given in N m"),
        (["acceptance-nominal", "--law", "best"], "--law: must be one of coast, rate, "),
        (["acceptance-nominal", "--law", "fault-tolerant"], "control"),
    ],
)
def test_mistakes(command_line, tmp_path, tokens, message):
    status, out, err = command_line("front", *tokens)
    assert (status, out) == (2, "")
    assert message in err
    assert list(tmp_path.iterdir()) == []
