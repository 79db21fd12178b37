"""The estimator of docs/sensors.md, done as it says, and what is told of one that is none."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from jaxsat.core import process
from jaxsat.scenario import ScenarioError, dump, plugins
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.read import library

TEXT = (Path(__file__).parents[2] / "docs" / "sensors.md").read_text(encoding="utf-8")
TABLES = re.findall(r"^```toml\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
(MODULE,) = re.findall(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
SENSORS = TABLES[0].partition("[estimator]")[0]
MORE = """

class Forgetful(FixedGains):
    def step(self, sample, period, measurement, memory):
        estimate, after = super().step(sample, period, measurement, memory)
        return estimate, after[0]


class Flat(FixedGains):
    def step(self, sample, period, measurement, memory):
        estimate, after = super().step(sample, period, measurement, memory)
        return estimate._replace(omega=period), after


class Bare(FixedGains):
    def step(self, sample, period, measurement, memory):
        return super().step(sample, period, measurement, memory)[0]


class Broken(FixedGains):
    def step(self, sample, period, measurement, memory):
        return jnp.zeros(2) @ jnp.zeros(3)
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A scenario of the library with the page's sensors and estimator, beside the module."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    (tmp_path / "observers.py").write_text(MODULE + MORE, encoding="utf-8")
    path = tmp_path / "own.toml"
    kept = library()["switching"].read_text(encoding="utf-8")
    path.write_text(f"{kept}\n{SENSORS}\n{TABLES[-1]}", encoding="utf-8")
    yield path
    sys.modules.pop("observers", None)


def refused(path, *overrides):
    with pytest.raises(ScenarioError) as caught:
        load(path, overrides)
    return str(caught.value)


def test_it_is_built_with_its_keys_and_dumped(own):
    scenario = load(own)
    navigation = build(scenario).loop.navigation
    assert type(navigation.estimator).__name__ == "FixedGains"
    assert navigation.estimator.attitude_gain == 0.1
    assert navigation.attitude_sigma == 0.01
    own.write_text(dump(scenario), encoding="utf-8")
    assert load(own) == scenario


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("kind=ukf", 'must be one of "mekf", "none" or have the form "module:Class", got ukf'),
        ("kind=mefk", "got mefk, did you mean mekf?"),
        ("kind=3", "must be text in quotes, got 3"),
        ("kind=observers:Gone", "must name a class of observers"),
        ("kind=observers:Estimate", "a subclass of AbstractEstimator"),
        ("attitude_gain=2", "must be at most 1, got 2"),
        ("atitude_gain=1", "did you mean attitude_gain?"),
        ("kind=none", "attitude_gain: must be one of the keys of [estimator]"),
        ("kind=observers:Forgetful", "keeps a memory of arrays of the same shapes and types"),
        ("kind=observers:Flat", "estimates an array of shape (3,) as `omega`"),
        ("kind=observers:Bare", "gives an `Estimate` and the memory from `step`"),
    ],
)
def test_what_is_no_estimator_is_refused(own, override, told):
    assert told in refused(own, f"estimator.{override}")


def test_an_exception_is_told_with_the_line_of_the_file(own):
    line = (MODULE + MORE).split("\n").index("        return jnp.zeros(2) @ jnp.zeros(3)") + 1
    told = refused(own, "estimator.kind=observers:Broken")
    assert "can be run, got TypeError" in told
    assert f"observers.py:{line})" in told


def test_an_installed_one_has_a_name(own, monkeypatch):
    from importlib.metadata import EntryPoint

    entry = EntryPoint("fixed", "observers:FixedGains", plugins.ESTIMATOR.group)
    found = {plugins.ESTIMATOR: {"fixed": entry}}
    monkeypatch.setattr(plugins, "installed", lambda kind: found.get(kind, {}))
    assert load(own)  # whose module is now known
    assert load(own, ["estimator.kind=fixed"]).estimator.kind == "fixed"


@pytest.mark.slow
def test_both_engines_of_studies_run_it_and_a_store_knows_it_from_another(own, tmp_path):
    dispersion = 'dispersion.omega_rad_s={distribution="normal",mean=0.0,sigma=0.01}'
    sensors = ["star_tracker.latency_s=0", "star_tracker.rate_limit_rad_s=1"]
    changes = ["simulation.duration_s=12", *sensors, dispersion]
    scenario = load(own, changes, purpose="study")
    found = {
        engine: build_study(scenario, 3, engine=engine, batch_size=4).evaluate(np.arange(3))
        for engine in ("native", "scan")
    }
    np.testing.assert_allclose(found["native"].omega, found["scan"].omega, atol=1e-9)
    study = build_study(scenario, 3, engine="native")
    mekf = load(own, [*changes, 'estimator={kind="mekf"}'])
    other = build_study(mekf, 3, engine="native")
    assert other.program_identity()["operations"] != study.program_identity()["operations"]
    signals = study.replay(1).signals
    late = np.abs(signals.parts["attitude_estimate_error"][100:]).max()
    assert late < 0.5 * np.abs(signals.parts["attitude_estimate_error"][0]).max()
    assert "bias_estimate_error" in signals.parts
    assert "attitude_estimate_3sigma" not in signals.parts
