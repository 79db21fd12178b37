"""What is told of a study, from columns made by hand."""

import numpy as np

from jaxsat.report.document import Lines
from jaxsat.report.study_document import study_document
from jaxsat.studies.summary import summarise


def document(cost, more=None, scenario=None, **drawn):
    count = len(cost)
    columns = {
        "code": np.zeros(count, np.int8),
        "settling_time": np.linspace(10.0, 20.0, count),
        "effort": np.linspace(1.0, 2.0, count),
        "cost": cost,
        **(more or {}),
        **{f"drawn_{name}": values for name, values in drawn.items()},
    }
    return study_document(summarise(columns), {"control": {"law": "rate"}, **(scenario or {})})


def percentiles(found):
    (table,) = (block for block in found.blocks if block.title == "Percentiles")
    return {row[0].partition(",")[0]: [cell.text for cell in row[1:]] for row in table.rows}


def test_the_verdict_tells_all_cases_and_what_settled_means():
    found = document(np.ones(25))
    assert found.title == "25 cases under the law rate"
    assert found.verdict.text == "100.00% of 25 cases settle (95 % interval 86.68% to 100.00%)."
    assert found.verdict.more[0].startswith("Settled means ")
    assert found.verdict.more[1] == "Outcomes: 25 settled, 0 unsettled."
    assert "errors" not in " ".join(found.verdict.more)
    errors = {"rate_error_estimate": np.full(25, 1e-5), "attitude_error_estimate": np.ones(25)}
    told = " ".join(document(np.ones(25), errors).verdict.more)
    assert "Integration errors are up to 1e-05 rad/s and 1 rad" in told
    assert "more than the scenario allows" not in told
    solver = {"rate_error_rad_s": 1e-4, "attitude_error_rad": 0.01}
    told = document(np.ones(25), errors, {"simulation": {"solver": solver}}).verdict.more
    assert "half the length: more than the scenario allows, 0.0001 rad/s and 0.01 rad." in told[2]


def test_percentiles_that_need_more_cases_have_an_open_end():
    found = percentiles(document(np.ones(25)))
    half, _, most = found["settling time (s)"]
    assert (half, most) == ("15 (12.92 to 17.08)", "19.9 (over 19.17)")


def test_what_actuators_used_is_told_where_there_are_some():
    """Openings of all valves together, and of the wheels the one with the largest momentum."""
    used = {
        "propellant": np.linspace(0.01, 0.03, 25),
        "valve_openings": np.arange(50.0).reshape(25, 2),
        "peak_wheel_momentum": np.stack([np.full(25, 4.0), np.linspace(1, 3, 25)], axis=1),
        "peak_torque_unmade": np.zeros(25),
        "unmade_fraction": np.linspace(0.1, 0.3, 25),
    }
    found = percentiles(document(np.ones(25), used))
    assert found["propellant (kg)"][0].startswith("0.02 (")
    assert found["openings of all valves"][0].startswith("49 (")
    assert found["largest momentum of any wheel (N m s)"][0] == "4 (4 to 4)"
    assert found["fraction of samples with unmet torque"][0].startswith("0.2 (")
    assert len(found) == len(percentiles(document(np.ones(25)))) + 4  # of the torque there is none


def test_what_matters_is_listed_first_and_noise_is_said_to_be():
    rng = np.random.default_rng(0)
    x, q = rng.random((200, 3)), rng.normal(size=(200, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    angle = 2 * np.arccos(np.abs(q[:, 0]))
    found = document(angle + 0.1 * rng.random(200), omega=x, attitude=q)
    ranking = found.blocks[-1]
    assert ranking.title == "Sensitivity of the cost"
    assert len(found.blocks) == 2  # nothing about settling, as all cases settle
    assert ranking.rows[0][0] == "attitude[angle]"
    assert [row[-1] for row in ranking.rows] == ["yes"] + ["no"] * (len(ranking.rows) - 1)
    assert ranking.first == 1
    told = document(rng.random(200), omega=x).blocks[-1]
    assert isinstance(told, Lines)
    assert told.lines == ["No dependence is significant with this number of cases."]


def test_propellant_that_no_thruster_counts_is_left_out():
    used = {"propellant": np.zeros(25)}
    assert "propellant (kg)" not in percentiles(document(np.ones(25), used))
    used = {"propellant": np.linspace(0.0, 1.0, 25)}
    assert "propellant (kg)" in percentiles(document(np.ones(25), used))
