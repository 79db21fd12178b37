"""Runs under JAX's own checks: no promotion of types but told, and an error at the first NaN."""

import jax
import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.single import simulate

CASES = (
    pytest.param("benchmark-three-axis", "10", marks=pytest.mark.slow),
    # pulses, a diagnosis whose unknown numbers are NaN
    pytest.param("thruster-dies", "10", marks=pytest.mark.slow),
    pytest.param("wheels-fail", "10", marks=pytest.mark.slow),
    pytest.param("two-wheel-telescope", "10", marks=pytest.mark.slow),
    pytest.param("switching-rounded", "10", marks=pytest.mark.slow),
)


def refuse(obstacle):
    raise AssertionError(obstacle)


def strictly():
    return jax.numpy_dtype_promotion("strict"), jax.debug_nans(True)


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
@pytest.mark.parametrize(("name", "seconds"), CASES)
def test_scenarios_fly_under_both(name, seconds):
    changes = [f"simulation.duration_s={seconds}"]
    usual = build(load(name, changes)).simulate(refuse)
    promotion, nans = strictly()
    with promotion, nans:
        found = build(load(name, changes)).simulate(refuse)
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(usual), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_studies_and_diffrax_do_too():
    scenario = load("acceptance-mc", ["simulation.duration_s=4", "simulation.save_every_s=1"])
    promotion, nans = strictly()
    with promotion, nans:
        run = build(scenario)
        trajectory = simulate(run.loop, run.start, run.times, method=run.method)
        assert int(trajectory.code) == 0
        found = build_study(scenario, 2, engine="scan", batch_size=1).evaluate(np.arange(2))
    assert found.code.tolist() == [0, 0]
    assert not np.isfinite(found.settling_time).any()
