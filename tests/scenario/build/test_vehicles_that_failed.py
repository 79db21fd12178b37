"""Vehicles on which the settling laws once failed without a word: they settle, or it is told."""

import warnings

import numpy as np
import pytest

from jaxsat.core.declaration.tuned_gains import APPROACH, STEPS
from jaxsat.scenario import ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study

VEHICLES = {
    "telescope": [
        "spacecraft.inertia_kg_m2=[9000,7000,4000]",
        "spacecraft.torque_limit_N_m=20",
        "simulation.duration_s=2000",
    ],
    "axes exchanged": ["spacecraft.inertia_kg_m2=[264.6,312.5,449.5]"],
    "flat, weak": [
        "spacecraft.inertia_kg_m2=[450,350,200]",
        "spacecraft.torque_limit_N_m=1",
        "simulation.duration_s=2000",
    ],
    "little coupling": ["spacecraft.inertia_kg_m2=[272,265.75,312.5]"],
    "large products": ["spacecraft.inertia_kg_m2=[[449.5,39.69,0],[39.69,264.6,0],[0,0,312.5]]"],
    "geostationary": ["orbit.rate_rad_s=7.3e-5"],
    "slow control": ["control.period_s=0.5", "simulation.save_every_s=0.5"],
}
CASES = 48


@pytest.mark.slow
@pytest.mark.parametrize("law", ["three-slew", "oscillatory"])
@pytest.mark.parametrize("name", VEHICLES)
def test_it_settles_or_is_told(name, law):
    """Of 48 hard cases at least 46, and no rate grows far beyond what the slews need."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScenarioWarning)
        scenario = load("acceptance-hard", [f"control.law={law}", *VEHICLES[name]])
    told = " ".join(str(one.message) for one in caught)
    columns = build_study(scenario, CASES, seed=20).values(np.arange(CASES))
    settled = np.isfinite(columns["settling_time"]).sum()
    good = settled >= CASES - 2 and columns["peak_rate"].max() < 0.5
    assert good or "was verified" in told or "can be held" in told


@pytest.mark.slow
def test_gains_of_the_three_slews_that_are_given_as_they_are_change_no_bit():
    """Every key with the number that the law has anyway; and another number does change it."""
    from jaxsat.synthesis.controller_design.candidates import written_out

    scenario = load("acceptance-hard", ["control.law=three-slew"])
    given = written_out(scenario)
    tuned = APPROACH[STEPS[1]].rate_law.share
    assert given.control.stopping_share == pytest.approx(tuned, rel=1e-6)
    other = given.control.model_copy(update={"slewing_share": 0.4})
    times = [
        build_study(one, 8, seed=3).values(np.arange(8))["settling_time"]
        for one in (scenario, given, given.model_copy(update={"control": other}))
    ]
    np.testing.assert_array_equal(times[0], times[1])
    assert np.all(times[2] != times[1])
