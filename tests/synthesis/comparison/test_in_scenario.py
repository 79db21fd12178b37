"""Laws compared in any scenario: the tables of each law, and the stores."""

import pytest

from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.errors import MissingTable
from jaxsat.synthesis.comparison.in_scenario import compare_in_scenario, scenario_under

LAWS = ("quaternion-feedback", "fault-tolerant")


@pytest.mark.slow
def test_another_law_takes_the_keys_that_it_shares_and_no_tuning():
    scenario = load("failures-12u", ["control.damping=0.9", "control.cusum_threshold=15"])
    own = scenario_under(scenario, "fault-tolerant")
    assert own.control.model_dump() == scenario.control.model_dump()
    other = scenario_under(scenario, "quaternion-feedback")
    assert own.tuning is other.tuning is None
    assert (other.control.law, other.control.damping) == ("quaternion-feedback", 0.9)
    assert other.control.max_rate_rad_s == scenario.control.max_rate_rad_s
    assert "cusum_threshold" not in other.control.model_dump()
    assert other.failure == scenario.failure
    assert other.dispersion == scenario.dispersion


@pytest.mark.slow
def test_laws_that_do_not_suit_are_refused():
    scenario = load("failures-12u")
    with pytest.raises(ValueError, match=r"must be one of .*quaternion-feedback"):
        scenario_under(scenario, "no-law")
    with pytest.raises(ScenarioError, match="law"):
        scenario_under(scenario, "rate")


def test_a_scenario_without_dispersed_cases_is_no_fault_of_a_law():
    with pytest.raises(MissingTable, match=r"\[dispersion\] must be given"):
        compare_in_scenario(load("switching"), ["switching"], count=2)


@pytest.mark.slow
def test_one_call_gives_what_the_stores_of_a_larger_run_begin_with(tmp_path):
    strikes = "dispersion.failure_time_s.low=5"
    scenario = load("failures-12u", ["simulation.duration_s=20", strikes])
    out = tmp_path / "c"
    more = compare_in_scenario(scenario, LAWS[:1], count=4, seed=7, out=out)
    fewer = compare_in_scenario(scenario, LAWS[:1], count=2, seed=7, out=out)
    assert (more.rows[0].cases, fewer.rows[0].cases) == (4, 2)
    assert fewer.recoveries[0].by_kind[-1].cases == 2
    assert fewer.verdict.law is None
