"""Laws compared in any scenario: the tables of each law, and the stores."""

import re

import pytest

from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.studies.ensemble import Study
from jaxsat.synthesis.comparison import in_scenario
from jaxsat.synthesis.comparison.in_scenario import compare_in_scenario, scenario_under
from jaxsat.synthesis.execution import Listener

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


def test_gains_without_a_default_are_those_of_design_with_what_belongs_to_them():
    """The natural frequency has none, and its largest rate is half of it; of a period of 1/ω0."""
    scenario = load("rods-only")
    control, rate = scenario_under(scenario, "fault-tolerant").control, scenario.orbit.rate()
    assert control.natural_frequency_rad_s == pytest.approx(0.4 * rate, rel=1e-3)
    assert control.max_rate_rad_s == pytest.approx(0.2 * rate, rel=1e-3)
    assert control.period_s == scenario.control.period_s


@pytest.mark.slow
def test_laws_that_do_not_suit_are_refused():
    scenario = load("failures-12u")
    with pytest.raises(ValueError, match=r"must be one of .*quaternion-feedback"):
        scenario_under(scenario, "no-law")
    with pytest.raises(ScenarioError, match="law"):
        scenario_under(scenario, "rate")


@pytest.fixture
def not_flown(monkeypatch):
    """Laws are checked, and nothing is compiled."""
    monkeypatch.setattr(
        in_scenario, "refined_study", lambda given, *_, **__: (given, object.__new__(Study))
    )


@pytest.mark.parametrize(
    ("name", "laws", "remarks"),
    [
        ("hybrid-wheels", ["fault-tolerant", "quaternion-feedback"], []),
        ("rods-only", ["magnetic", "fault-tolerant"], []),
        ("one-torque-damping", ["one-torque"], []),
        ("switching", ["switching", "three-slew", "oscillatory"], ["planned is left out"]),
        ("paper-rate", ["rate"], ["three-slew: key.*limit", "oscillatory: key.*", "planned is"]),
    ],
)
def test_all_stands_for_the_own_law_and_those_that_fit(name, laws, remarks, not_flown):
    """As `design` takes them for the same actuators."""
    remarks_made = []
    given = (load(name), ["all"], 2, remarks_made.append)
    assert [law for law, _ in in_scenario._studies(*given)] == laws
    for text, pattern in zip(remarks_made, remarks, strict=True):
        assert re.search(pattern, text), text


def test_a_law_that_was_named_is_not_left_out(not_flown):
    with pytest.raises(ScenarioError, match="torque_limit"):
        compare_in_scenario(load("paper-rate"), ["all", "three-slew"])


def test_a_scenario_without_dispersions_flies_once(monkeypatch):
    studies = []

    def stop(scenario, count, tell, **keys):
        studies.append((scenario.dispersion.distributions, count))
        raise KeyboardInterrupt

    monkeypatch.setattr(in_scenario, "refined_study", stop)
    remarks = []
    with pytest.raises(KeyboardInterrupt):
        compare_in_scenario(load("k2"), listener=Listener(remark=remarks.append))
    assert studies == [({}, 1)]
    assert "one flight of each law" in remarks[0]


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
