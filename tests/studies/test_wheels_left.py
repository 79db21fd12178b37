"""What failed wheels leave in each case of a study, and what of it no law can settle."""

import numpy as np
import pytest

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.studies.failure_codes import DIAGNOSED, FAILURES, HYPOTHESES
from jaxsat.studies.torques_left import TorquesLeft, torques_left


def left(loop, *failures, momentum=(0.0, 0.0, 0.0)):
    """Of one case: (wheel, kind, amount) of each failure, one second after the other."""
    struck = {
        "failure_time": np.arange(float(len(failures)))[None],
        "failed_part": np.array([[wheel for wheel, *_ in failures]]),
        "failure_kind": np.array([[FAILURES.index(f"wheel {kind}") for _, kind, _ in failures]]),
        "failure_amount": np.array([[amount for *_, amount in failures]]),
    }
    return TorquesLeft(int(torques_left(loop, np.array(momentum), struck)[0]))


@pytest.fixture(scope="module")
def four():
    return build(load("wheels-fail")).loop


@pytest.fixture(scope="module")
def three():
    return build(load("failures-telescope")).loop


@pytest.mark.parametrize(
    ("failures", "expected"),
    [
        ([(0, "dead", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "dead", np.nan), (1, "stopped", np.nan)], TorquesLeft.TWO_TORQUES),
        ([(0, "dead", np.nan), (0, "stopped", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "degraded", 0.1), (1, "degraded", 0.2)], TorquesLeft.THREE_AXES),
        ([(0, "friction to", 0.3), (1, "dead", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "friction to", 0.37), (1, "dead", np.nan)], TorquesLeft.TWO_TORQUES),
        ([(0, "runaway", np.nan)], TorquesLeft.UNHELD_MOMENTUM),
        ([(0, "runaway", np.nan), (0, "dead", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "dead", np.nan), (0, "runaway", np.nan)], TorquesLeft.UNHELD_MOMENTUM),
        ([(0, "dead", np.nan), (1, "dead", np.nan), (0, "degraded", 0.5)], TorquesLeft.THREE_AXES),
    ],
)
def test_what_four_wheels_leave(four, failures, expected):
    assert left(four, *failures) == expected


def test_a_wheel_that_had_failed_before_is_not_counted(three):
    assert left(three, (1, "dead", np.nan)) == TorquesLeft.TWO_TORQUES
    assert left(three, (0, "dead", np.nan)) == TorquesLeft.THREE_AXES
    assert left(three, (1, "runaway", np.nan)) == TorquesLeft.UNHELD_MOMENTUM


def test_momentum_leaves_some_attitudes(three):
    assert left(three, (1, "dead", np.nan), momentum=(1.0, 2.0, 0.5)) == TorquesLeft.SOME_ATTITUDES


def test_a_runaway_that_holds_less_than_the_others_is_held():
    wheels = ",".join(
        f"{{axis={axis},torque_limit_N_m=0.4,momentum_limit_N_m_s={most}}}"
        for axis, most in (("[1,0,1]", 10), ("[0,1,1]", 20), ("[-1,0,1]", 20), ("[0,-1,1]", 20))
    )
    changes = [f"wheel=[{wheels}]", "failure=[{of='wheel 1',at_s=5,kind='dead'}]"]
    loop = build(load("wheels-fail", changes)).loop
    assert left(loop, (0, "runaway", np.nan)) == TorquesLeft.THREE_AXES
    assert left(loop, (1, "runaway", np.nan)) == TorquesLeft.UNHELD_MOMENTUM


def test_every_failure_of_a_wheel_has_the_verdict_that_is_right_for_it():
    for code, name in enumerate(FAILURES):
        if name.startswith("wheel "):
            verdict = DIAGNOSED[HYPOTHESES[code]]
            assert name.removeprefix("wheel ").split()[0] == verdict.split()[0]
    assert HYPOTHESES[FAILURES.index("dead")] == 1 + DiagnosedKind.DEAD
