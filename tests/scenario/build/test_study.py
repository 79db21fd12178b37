"""Studies from scenario files."""

import jax
import numpy as np
import pytest

from jaxsat.core.declaration.actuators import EFFECTORS
from jaxsat.core.declaration.quantities import DISPERSIBLE, EXCLUSIVE
from jaxsat.core.declaration.sensors import DELAY, WHITE_NOISE
from jaxsat.core.solvers import class_name
from jaxsat.scenario import ScenarioError, dump
from jaxsat.scenario.build.dispersion_trial import _KINDS
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import (
    ADAPTIVE_SOLVERS,
    build_dispersions,
    build_study,
)
from jaxsat.scenario.dispersion_tables import PARAMETERS
from jaxsat.scenario.toml_text import toml_value
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.studies.designs import LatinHypercube, Sobol
from jaxsat.studies.quantities import QUANTITIES

OMEGA = "dispersion.omega_rad_s={distribution='uniform', low=-0.1, high=[0.1, 0.2, 0.3]}"


def test_every_quantity_has_an_effect_and_every_distribution_its_kind():
    assert list(DISPERSIBLE) == list(QUANTITIES)  # in the order in which they are applied
    assert set(PARAMETERS) == set(_KINDS)


def test_units_make_the_keys_of_quantities():
    """As README, library and files of users have them."""
    found = {one.unit: one.key.removeprefix(name) for name, one in DISPERSIBLE.items()}
    densities = {"rad/s/√Hz": "_rad_s_sqrt_Hz", "rad/s²/√Hz": "_rad_s2_sqrt_Hz"}
    plain = {
        "1": "",
        "rad": "_rad",
        "rad/s": "_rad_s",
        "N m": "_N_m",
        "N m s": "_N_m_s",
        "s": "_s",
        "T": "_T",
    }
    assert found == plain | densities


def test_effectors_change_what_their_declarations_name():
    for actuator in EFFECTORS:
        declared = {one.name for one in actuator.dispersible if one.field is None}
        assert set(actuator.effector.dispersible) == declared


def test_what_is_sampled_can_be_dispersed_under_the_same_key():
    """By which a loop gets the sensors and the delay that a study is to disperse."""
    assert {key.name for key in (*WHITE_NOISE.keys, DELAY)} <= {
        one.key for one in DISPERSIBLE.values()
    }


@pytest.mark.parametrize(("one", "other"), EXCLUSIVE)
def test_quantities_that_exclude_each_other_are_refused(one, other):
    drawn = {name: {"distribution": "discrete", "values": [0], "weights": [1]}
             for name in (one, other)}  # fmt: skip
    if DISPERSIBLE[one].random_attitude:
        drawn[one] = {"distribution": "random-attitude"}
    first, second = DISPERSIBLE[one].key, DISPERSIBLE[other].key
    changes = [f"dispersion.{DISPERSIBLE[name].key}={toml_value(drawn[name])}" for name in drawn]
    with pytest.raises(ScenarioError, match=f"dispersion.{second}: must be omitted with "
                                            f"dispersion.{first}, got both"):  # fmt: skip
        load("switching", changes, purpose="study")


def test_distributions_hold_the_numbers_of_the_file():
    scenario = load("switching", [OMEGA, "dispersion.inertia={distribution='normal', mean=0, "
                                  "sigma=0.01}"])  # fmt: skip
    found = build_dispersions(scenario.dispersion).distributions
    assert set(found) == {"omega", "inertia"}
    np.testing.assert_array_equal(found["omega"].high, [0.1, 0.2, 0.3])
    assert found["inertia"].sigma == 0.01


def test_a_scenario_with_dispersions_dumps_and_loads(tmp_path):
    scenario = load("switching", [OMEGA, "sampling.delay_s=0.05", "dispersion.design=sobol"])
    path = tmp_path / "again.toml"
    path.write_text(dump(scenario), encoding="utf-8")
    assert load(path) == scenario


@pytest.mark.slow
def test_sampling_and_design_reach_the_study():
    overrides = [OMEGA, "sampling.delay_s=0.05", "sampling.rate_noise_rad_s=1e-5"]
    study = build_study(load("switching", [*overrides, "dispersion.design=sobol"]), 7, seed=3)
    loop = study.case_factory.loop
    assert loop.delay == 0.05
    assert loop.sensors.rate_noise == 1e-5
    assert study.design == Sobol(3)
    assert not isinstance(study.engine, ReferenceEngine)
    assert study.program.intervals == 20000
    other = build_study(load("switching", [*overrides, "dispersion.design=latin-hypercube"]), 7)
    assert other.design == LatinHypercube(0, 7)
    assert other.identity()["scenario"]["sampling"]["delay_s"] == 0.05


@pytest.mark.slow
def test_an_accelerator_is_used_on_request_and_in_large_batches(monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    scenario = load("benchmark-three-axis")
    assert isinstance(build_study(scenario, 4).engine, NativeEngine)
    small = build_study(scenario, 4, engine="scan")
    assert "batches of 64 cases leave an accelerator idle" in str(small.remark)
    large = build_study(scenario, 20_000, engine="scan", batch_size=16_384)
    assert (large.remark, large.chunk) == (None, 16_384)


@pytest.mark.slow
def test_engines_that_suit():
    benchmark = load("benchmark-three-axis")
    chosen = build_study(benchmark, 4).engine
    assert class_name(chosen.stepper.solver) == "Dopri8"
    assert chosen.stepper.tolerance.rtol == ADAPTIVE_SOLVERS["dopri8"]
    assert isinstance(build_study(benchmark, 4, engine="diffrax").engine, ReferenceEngine)
    other = load("benchmark-three-axis", ["simulation.solver.name=bosh3"])
    assert isinstance(build_study(other, 4).engine, ReferenceEngine)
    with pytest.raises(ValueError, match="Tsit5, Dopri5 or Dopri8"):
        build_study(other, 4, engine="scan")
    passing = ["simulation.solver.min_step_s=1e-3", "simulation.solver.max_steps=500"]
    judged = build_study(load("benchmark-three-axis", passing), 4).engine.stepper.tolerance
    assert (judged.min_step, judged.max_steps) == (1e-3, 500)
    loose = ["simulation.solver.steps=adaptive", "simulation.solver.rtol=1e-6"]
    found = build_study(load("benchmark-three-axis", loose), 4, engine="scan").engine
    assert found.stepper.tolerance.rtol == 1e-6
    stepped = load("benchmark-three-axis", ["simulation.solver.step_s=0.05"])
    fixed = build_study(stepped, 4).engine
    assert fixed.stepper.substeps == 20


@pytest.mark.parametrize(
    ("name", "overrides", "message"),
    [
        ("switching", ["dispersion.turn_rad={distribution='uniform', low=0}"], "must have high"),
        ("switching", ["dispersion.turn_rad={distribution='normal', mean=0, sigma=1, low=0}"],
         "must not have low"),
        ("switching", ["dispersion.turn_rad={distribution='gauss'}"], "must be one of"),
        ("switching", ["dispersion.trun_rad={distribution='uniform'}"], "did you mean turn_rad"),
        ("switching", ["sampling.delay_s=0.2"], "at most control.period_s"),
        ("paper-rate", ["sampling.rate_noise_rad_s=0.2"], "sampled law"),
    ],
)  # fmt: skip
def test_mistakes_are_told(name, overrides, message):
    with pytest.raises(ScenarioError, match=message):
        load(name, overrides)


def test_studies_without_sense_are_refused():
    with pytest.raises(ValueError, match=r"\[dispersion\] must be given"):
        build_study(load("switching"), 4)
    with pytest.raises(ValueError, match="error coordinates"):
        build_study(
            load("benchmark-three-axis", ["dispersion.inertia={distribution='uniform', low=0, "
                                          "high=0.1}"]), 4)  # fmt: skip
