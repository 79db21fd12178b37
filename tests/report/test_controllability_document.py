"""The written page and the map say of one-signed thrusters and wheels what is judged."""

import numpy as np
import pytest

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.failures import failure_records, failure_table
from jaxsat.controllability.judging import judge
from jaxsat.controllability.rank import analyse
from jaxsat.controllability.wording import verdict_sentence
from jaxsat.report.controllability_document import controllability_document, controllability_lines
from jaxsat.report.controllability_figures import failure_chart, torque_map

PAPER = [449.5, 264.6, 312.5]
TURNING_ABOUT_Z = np.array([[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]], float).T


def lines_of(actuators):
    judgement = judge(PAPER, actuators)
    columns = judgement.decision and analyse(PAPER, actuators.columns)
    return "\n".join([verdict_sentence(judgement), *controllability_lines(judgement, columns)])


def test_one_signed_thrusters_are_told_apart_from_rank_6():
    text = lines_of(actuator_set(TURNING_ABOUT_Z, forces=np.ones((3, 4))))
    for said in (
        "Controllable by drift",
        "none towards -z",
        "no law of jaxsat applies",
        "one-sided torques counted as two-sided",
        "at rest: disproved. Every torque has a component against -z",
        "Turn time: infinite",
        "Net force: at least",
    ):
        assert said in text


def test_torques_of_both_signs_in_a_half_space_keep_the_laws_of_two():
    columns = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], float).T
    text = lines_of(actuator_set(columns))
    for said in (
        "the plane with normal +z, and towards +z alone",
        "the laws for two torques apply",
        "Turn time: 39.4 s with 1 N m about each axis of both signs",
        "at rest: proved. Two independent torque axes",
    ):
        assert said in text


def test_failures_that_no_law_can_fly_are_not_counted_as_survived():
    """Torques about x, y and (1, 1, 1): any two suffice, and (1, 1, 1) alone by drift."""
    cases = failure_table(PAPER, np.array([[1, 0, 0], [0, 1, 0], [1, 1, 1]], float).T)
    document = controllability_document("", "Rank 6.", failure_records(cases), [])
    assert document.verdict.text == (
        "Survives 3 of 3 single, 0 of 3 double, 0 of 1 triple failures. (Rank 6.)"
    )
    assert list(document.verdict.more) == [
        "Controllable, but flown by no law of jaxsat: 1 of 3 double failures.",
    ]
    nothing_fails = controllability_document("", "Rank 6.", failure_records(cases[:1]), [])
    assert nothing_fails.verdict.text == "Rank 6."


def test_failures_without_a_verdict_are_not_counted_as_lost():
    verdicts = {
        "none": "borderline",
        "a": "borderline",
        "b": "not decided",
        "a b": "uncontrollable",
    }
    entries = {"laws": "none", "rank": 6, "dimension": 6, "margin": 1e-4, "turn_time_s": np.nan}
    records = [
        {
            "failed": one,
            "verdict": verdict,
            "once_stopped": verdict,
            "torques": "",
            "lost": "",
            **entries,
        }
        for one, verdict in verdicts.items()
    ]
    assert list(controllability_document("", "", records, []).verdict.more) == [
        "Survives: 0 of 2 single, 0 of 1 double failures.",
        "Borderline: 1 of 2 single failures.",
        "Not decided: 1 of 2 single failures.",
    ]


def test_only_what_a_law_flies_is_told_as_good():
    """Two wheels and a thruster: with momentum a law flies to some attitudes alone."""
    axes, thruster = np.eye(3)[:, :2], np.eye(3)[:, 2:]
    found = []
    for momentum in ([0.0, 0.0, 0.0], [0.0, 3.0, 0.0]):
        actuators = actuator_set(thruster, wheel_axes=axes, momentum=momentum)
        records = failure_records(failure_table(PAPER, actuators))
        document = controllability_document("", "", records, [])
        assert records[0]["verdict"] == "controllable"
        assert document.blocks[0].rows[0][1].good == document.verdict.good
        found.append((document.verdict.good, records[0]["laws"]))
        chart = failure_chart(records)
        labels = [one.get_text() for one in chart.axes[0].get_legend().get_texts()]
        assert ("controllable, by no law" in labels) == any(momentum)
    assert found == [(True, "two wheels"), (None, "nearest attitude")]


@pytest.mark.parametrize(
    ("momentum", "said"), [((0, 0, 0), "n·Jω stays zero"), ((0, 0.2, 0), "Some attitudes")]
)
def test_wheels_are_judged_by_momentum_and_no_rank_of_thrusters_is_told(momentum, said):
    text = lines_of(actuator_set(wheel_axes=np.eye(3)[:, :2], momentum=momentum))
    assert said in text
    assert "conserved: no actuator removes momentum from the wheels" in text
    assert "Turn time" not in text


def test_the_map_marks_actuators_and_what_cannot_be_made():
    judgement = judge(PAPER, actuator_set(TURNING_ABOUT_Z, wheel_axes=np.array([[1.0], [0], [0]])))
    figure = torque_map(judgement.cone, judgement.actuators)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    marked = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(marked["thruster"][:, 1], 45)
    assert len(marked["wheel"]) == 2
    assert abs(marked["farthest from all torques"][0, 1]) == pytest.approx(90)
    angles = axes.collections[0].get_array()
    assert angles.min() == pytest.approx(0, abs=1e-4)
    assert axes.get_title() == "Attainable torques: wedge"
    figure = torque_map(judgement.cone, judgement.actuators, without=["magnetorquers"])
    assert figure.axes[0].get_title() == "Attainable torques, without magnetorquers: wedge"
