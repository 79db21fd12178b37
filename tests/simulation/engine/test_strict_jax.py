"""Runs under JAX's own checks: no implicit promotion of types, and an error at the first NaN."""

import contextlib

import jax
import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.native import engine, kernel_store
from jaxsat.simulation.engine.single import simulate

SCENARIOS = (
    "benchmark-three-axis",
    "thruster-dies",  # pulses, a diagnosis whose unknown numbers are NaN
    "wheels-fail",
    "cubesat-3w3m",  # magnetorquers, with gains around the orbit
    "switching-rounded",
)


def refuse(obstacle):
    raise AssertionError(obstacle)


@contextlib.contextmanager
def strictly(monkeypatch):
    """Both checks, and no kernel that was traced without them: machine code of its text alone."""
    monkeypatch.setenv(kernel_store.SETTING, "0")
    monkeypatch.setattr(engine, "_kernels", {})
    with jax.numpy_dtype_promotion("strict"), jax.debug_nans(True):
        yield


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
@pytest.mark.parametrize("name", SCENARIOS)
def test_scenarios_fly_under_both(name, monkeypatch):
    scenario = load(name, ["simulation.duration_s=10"])
    usual = build(scenario).simulate(refuse)
    with strictly(monkeypatch):
        strict = build(scenario).simulate(refuse)
        assert len(engine._kernels) == 1
    for x, y in zip(jax.tree.leaves(strict), jax.tree.leaves(usual), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_studies_and_diffrax_do_too(monkeypatch):
    scenario = load("acceptance-mc", ["simulation.duration_s=4", "simulation.save_every_s=1"])
    with strictly(monkeypatch):
        run = build(scenario)
        trajectory = simulate(run.loop, run.start, run.times, method=run.method)
        assert int(trajectory.code) == 0
        study = build_study(scenario, 2, engine="scan", batch_size=1).evaluate(np.arange(2))
    assert study.code.tolist() == [0, 0]
    assert not np.isfinite(study.settling_time).any()
