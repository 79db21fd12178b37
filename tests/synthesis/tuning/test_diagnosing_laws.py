"""Tuning of the laws that diagnose thrusters or wheels: what false alarms cost."""

import numpy as np
import pytest
from scipy.optimize import brentq

from jaxsat.control.diagnosis.diagnosis import average_run_length
from jaxsat.scenario.build.load import load
from jaxsat.synthesis.tuning.build import build_plan

pytest.importorskip("cma")

TESTS = {"failures-12u": (8 * 2, 8), "failures-telescope": (4 * 3, 0)}
"""Thrusters times missing and additional thrust, and the likelihood ratio of a dead one; wheels
times missing torque, brake and drive."""

KEYS = (
    "natural_frequency_rad_s", "damping", "cusum_reference", "cusum_threshold",
    "isolation_margin", "torque_uncertainty",
)  # fmt: skip
"""In the order of the search."""


def values(threshold):
    return np.array([0.05, 1.0, 0.8, threshold, 8.0, 0.1])


@pytest.mark.parametrize("name", TESTS)
def test_thresholds_pay_for_false_alarms_of_all_tests_of_the_law(name):
    """None from the threshold on whose false alarms are as far apart as the table asks for."""
    interval, reference = 1e6, 0.8
    change = f"tuning.false_alarm_interval_s={interval}"
    plan = build_plan(load(name, [change]), engine="scan")
    assert plan.space.labels == KEYS
    scores, ratios = TESTS[name]

    def alarms(threshold):
        of_ratios = ratios * np.exp(-2 * reference * threshold)
        of_scores = scores / average_run_length(reference, threshold)
        return interval / 0.1 * (of_scores + of_ratios)

    enough = brentq(lambda x: np.log(alarms(x)), 1.0, 50.0)
    found = plan.exact.penalty(np.stack([values(x) for x in (5.0, enough - 1e-3, enough + 1e-3)]))
    assert found[0] == pytest.approx(np.log(alarms(5.0)))
    assert 0 < found[1] < 0.01
    assert found[2] == 0
