"""`dispersion.case` and `dispersion.point`: cases of a study as runs of `simulate`."""

import numpy as np
import pytest

import jaxsat
from jaxsat.report.facts import scenario_tables
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.datasets import simulated

SHORT = ["simulation.duration_s=4", "simulation.save_every_s=1"]
POINT = [0.125, 0.5, 0.75, 0.25, 0.5, 0.9]
"""Of `rate-limited`: three components of the phase, or of the rate."""


@pytest.mark.slow
def test_a_simulated_case_is_that_of_the_study():
    scenario = jaxsat.load("rate-limited", [*SHORT, "dispersion.case=2"], purpose="study")
    study = jaxsat.build_study(scenario, 3)
    flown, replayed = simulated(scenario), jaxsat.replay_case(scenario, study, 2)
    assert flown.attrs["case"] == 2
    assert np.array_equal(flown["omega"].values, replayed["omega"].values)
    other = jaxsat.load("rate-limited", [*SHORT, "dispersion.case=1"], purpose="study")
    assert jaxsat.build_study(other, 3).description == study.description


@pytest.mark.slow
def test_the_results_of_a_case_tell_its_own_failures():
    """Not those of the scenario in place of which they are drawn."""
    changes = ["simulation.duration_s=400", "simulation.save_every_s=1"]
    scenario = jaxsat.load("failures-telescope", [*changes, "dispersion.case=5"], purpose="study")
    study = jaxsat.build_study(scenario, 6)
    (failure,) = scenario_tables(simulated(scenario).dataset())["failure"]
    values = {name: one[0] for name, one in study.values(np.array([5])).items()}
    assert failure["of"] == study.names[values["failed_part"][0]] != scenario.failure[0].of
    assert failure["at_s"] == values["failure_time"][0]
    assert failure["kind"] == "friction-up" != scenario.failure[0].kind
    assert failure["friction_N_m"] == values["failure_amount"][0]


@pytest.mark.slow
def test_all_cases_have_the_point():
    scenario = jaxsat.load("rate-limited", [*SHORT, f"dispersion.point={POINT}"], purpose="study")
    study = jaxsat.build_study(scenario, 3)
    cases = study.cases(np.arange(3))
    assert np.array_equal(cases.point, [POINT] * 3)
    assert cases.number.tolist() == [0, 1, 2]
    values = study.values(np.arange(3))
    names = list(study.case_factory.dimensions())
    first = 3 * names.index("omega")
    low, high = scenario.dispersion.omega_rad_s.low, scenario.dispersion.omega_rad_s.high
    own = low + (high - low) * np.array(POINT[first : first + 3])
    np.testing.assert_allclose(values["drawn_omega"], [own] * 3, rtol=1e-14)
    assert np.ptp(values["cost"]) == 0


@pytest.mark.parametrize("purpose", ["run", "study"])
@pytest.mark.parametrize(
    ("scenario", "override", "message"),
    [
        ("rate-limited", "point=[0.5, 0.5]", "dispersion.point.* must have 6 numbers .* got 2"),
        ("rate-limited", "point=[0.5, 1]", "dispersion.point.* must be less than 1"),
        ("acceptance-nominal", "design='latin-hypercube'", "dispersion.case: must be omitted"),
        ("rate-limited", "design='sobol'", "dispersion.case: must be at most 1073741823"),
    ],
)
def test_cases_that_cannot_be_flown_are_refused(scenario, override, message, purpose):
    with pytest.raises(ScenarioError, match=message):
        jaxsat.load(
            scenario, ["dispersion.case=4294967295", f"dispersion.{override}"], purpose=purpose
        )
