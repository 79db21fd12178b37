"""What is loaded can be built, and what cannot be built is refused with its key."""

import random
import warnings

import numpy as np
import pytest

from jaxsat.scenario import ScenarioError, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build, build_uncontrolled
from jaxsat.scenario.build.study import build_study

SETTLING = ["two-torque-free", "acceptance-mc"]


def refused(name, *overrides, purpose="run"):
    with pytest.raises(ScenarioError) as caught:
        load(name, overrides, purpose=purpose)
    return str(caught.value)


@pytest.mark.parametrize("name", SETTLING)
@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("spacecraft.inertia_kg_m2=[300,300,312.5]", "spacecraft.inertia_kg_m2"),
        ("spacecraft.inertia_kg_m2=[300,300,300]", "spacecraft.inertia_kg_m2"),
        ("spacecraft.inertia_kg_m2=[300,300.000000001,312.5]", "spacecraft.inertia_kg_m2"),
        ("control.model.inertia_kg_m2=[300,300,312.5]", "control.model.inertia_kg_m2"),
    ],
)
def test_a_law_that_cannot_steer_three_axes_is_refused(name, override, key):
    found = refused(name, override)
    assert found.startswith(f"--set {override}: key {key}: must be such that the law")
    load(name, [override], purpose="motion")  # which needs no law


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_which_moments_must_differ_depends_on_what_has_failed():
    failed, inertia = "spacecraft.failed_thrusters=[2]", "spacecraft.inertia_kg_m2=[300,200,300]"
    assert "S1 = 300 and S2 = 300 kg m²" in refused("acceptance-mc", failed, inertia)
    load("acceptance-mc", [inertia])


@pytest.mark.parametrize(
    ("name", "override", "message"),
    [
        ("paper-rate", "orbit.altitude_km=1e300", "must be at most 1.5e+06 km"),
        ("paper-rate", "orbit.rate_rad_s=1e300", "must be at most 1 rad/s"),
        ("paper-rate", "spacecraft.inertia_kg_m2=[1e300,1e300,1e300]", "must be at most 1e+12"),
        ("paper-rate", "spacecraft.inertia_kg_m2=[1e-300,1,1]", "principal moments from 1e-09"),
        ("paper-rate", "spacecraft.inertia_kg_m2=[1e-9,1e6,1e6]", "below 1e-09 of the largest"),
        ("paper-rate", "disturbance.amplitude_N_m=[1e300,0,0]", "must be at most 1e+09 N m"),
        ("paper-rate", "control.k1=1e300", "must be at most 1e+12"),
        ("paper-rate", "initial.omega_rad_s=[1e300,0,0]", "must be below 1e+06"),
        ("paper-rate", "spacecraft.thruster_torque_axes=[[1e300,0,0],[0,1,0],[0,0,1]]", "row 1"),
        ("paper-three-axis", "simulation.solver.step_s=1e-6", "at most 16777216 steps in a run"),
        ("paper-three-axis", "simulation.solver.max_steps=2000000000", "at most 1.67772e+07"),
        ("switching", "simulation.solver.substeps=10000", "at most 67108864 steps in a run"),
        ("switching", "control.period_s=1e-9", "must be at least 1e-06 s"),
        ("switching", "spacecraft.torque_limit_N_m=1e-300", "must be at least 1e-09 N m"),
        ("rate-limited", "tuning.cases=1000000000", "must be at most 1e+06"),
        ("rate-limited", "tuning.parameters.k1={low=1e-3,high=1e300}", "at most 1e+12 √(rad/s)"),
        ("rate-limited", "tuning.held_out_seed=0", "must not be simulation.seed"),
    ],
)
def test_numbers_beyond_reason_are_refused_with_their_key(name, override, message):
    found = refused(name, override)
    assert found.startswith(f"--set {override}: key {override.split('=')[0].split('.')[0]}.")
    assert message in found


def test_a_long_run_in_default_steps_has_a_limit_too():
    long = [
        "control.law=coast",
        "simulation.solver.name=heun",
        "simulation.duration_s=200000",
    ]
    assert "key simulation.duration_s: must leave at most 16777216 steps" in refused(
        "paper-rate", *long
    )


def test_gains_outside_their_bounds_are_told_with_their_key():
    override = "tuning.parameters.k3={low=1,high=2}"
    found = refused("oscillatory-dispersed", override, purpose="study")
    assert "must be bounds around control.k3 = 0.0491, got 1" in found


def test_the_motion_needs_nothing_of_the_law():
    """One thruster, no limit, an upside-down start: no law can begin there, a bound may."""
    changes = ["spacecraft.failed_thrusters=[2,3]", "initial.quaternion=[0,1,0,0]"]
    assert "independent torques" in refused("paper-three-axis", *changes)
    scenario = load("paper-three-axis", changes, purpose="motion")
    loop, start = build_uncontrolled(scenario)
    assert loop.plant.effectors[0].torque_axes.shape == (3, 1)
    np.testing.assert_array_equal(start.attitude.q, [0, 1, 0, 0])
    found = refused("paper-three-axis", *changes, "spacecraft.inertia_kg_m2=[1,2,-3]",
                    purpose="motion")  # fmt: skip
    assert "must be positive definite" in found


UPSIDE_DOWN = ["initial.quaternion=[0,0.6,0.8,0]", "simulation.duration_s=1"]


@pytest.mark.parametrize("name", ["paper-three-axis", "switching"])
def test_a_law_in_w_and_z_cannot_begin_upside_down(name):
    assert "must not be upside down" in refused(name, *UPSIDE_DOWN)


@pytest.mark.slow
def test_a_law_that_needs_no_w_and_z_can_begin_upside_down_and_says_that_they_are_none():
    changes = [*UPSIDE_DOWN, "simulation.save_every_s=0.5", "simulation.solver.substeps=1"]
    with pytest.warns(ScenarioWarning, match=r"key initial\.quaternion: should not be upside down"):
        scenario = load("two-torque-free", changes)
    signals = build(scenario).simulate().signals
    assert np.isnan(signals.w[0]).all()
    for part in (signals.w[1:], signals.quaternion, signals.omega, signals.torque):
        assert np.isfinite(part).all()


def test_a_study_whose_every_cost_is_infinite_is_refused():
    turn = "dispersion.omega_rad_s={distribution='uniform', low=-0.1, high=0.1}"
    with pytest.warns(ScenarioWarning):
        load("two-torque-free", [*UPSIDE_DOWN, turn])
    found = refused("two-torque-free", *UPSIDE_DOWN, turn, purpose="study")
    assert "key initial.quaternion: must not be upside down in a study" in found


VALUES = [
    "0", "-1", "1e-300", "1e300", "1e-9", "1e9", "1e-12", "1e12", "0.1", "1", "5", "inf", "nan",
    "true", '"x"', "[]", "[1, 2]", "[0, 0, 0]", "[300, 300, 312.5]", "[1e-9, 1, 1]", "[0, 1, 0, 0]",
    "[1e12, 1e12, 1e12]", "[1e6, 1e6]", "[[1, 0, 0], [0, 1, 0]]", "{}", '"coast"', '"wz"', '"held"',
]  # fmt: skip
KEYS = [
    "spacecraft.inertia_kg_m2", "spacecraft.torque_limit_N_m", "spacecraft.third_rate",
    "spacecraft.thruster_torque_axes", "spacecraft.failed_thrusters", "orbit.rate_rad_s",
    "orbit.altitude_km", "disturbance.amplitude_N_m", "disturbance.frequency_rad_s", "initial.w",
    "initial.quaternion", "initial.omega_rad_s", "initial.z_rad", "control.law", "control.k1",
    "control.k3", "control.a", "control.k4", "control.period_s", "control.model.inertia_kg_m2",
    "control.model.orbit_rate_rad_s", "control.tilt_width", "control.ratio", "control.damping",
    "control.upper_threshold_rad_s", "simulation.duration_s", "simulation.save_every_s",
    "simulation.attitude", "simulation.solver.step_s", "simulation.solver.substeps",
    "sampling.delay_s", "sampling.rate_noise_rad_s", "dispersion.inertia", "tuning.steps",
]  # fmt: skip
DISTRIBUTIONS = [
    "{distribution='uniform', low=%s, high=%s}",
    "{distribution='normal', mean=%s, sigma=%s}",
    "{distribution='discrete', values=[%s], weights=[%s]}",
    "{distribution='truncated-normal', mean=0, sigma=1, low=%s, high=%s}",
]
DISPERSED = [
    "delay_s", "rate_noise_rad_s", "tilt", "turn_rad", "omega_rad_s", "inertia", "torque_gain",
    "products_of_inertia", "model_inertia", "model_orbit_rate", "misalignment_rad",
    "disturbance_frequency", "attitude_error_rad", "rate_error_rad_s", "constant_torque_N_m",
]  # fmt: skip
NAMES = [
    "paper-rate",
    "paper-three-axis",
    "switching-dispersed",
    "two-torque-free",
    "acceptance-mc",
]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_whatever_is_loaded_can_be_built(seed):
    """Values of every kind under keys of every table; what is refused is refused with its place."""
    choose = random.Random(seed)
    accepted = 0
    for _ in range(60):
        overrides = [f"{choose.choice(KEYS)}={choose.choice(VALUES)}"]
        if choose.random() < 0.5:
            ends = choose.choices(["0", "0.05", "-0.05", "1", "-1", "1e-9", "1e300"], k=2)
            key = f"dispersion.{choose.choice(DISPERSED)}"
            overrides.append(f"{key}={choose.choice(DISTRIBUTIONS) % tuple(ends)}")
        name = choose.choice(NAMES)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ScenarioWarning)
                scenario = load(name, overrides, purpose="study")
        except ScenarioError as error:
            refused = error.problems
        else:
            refused = ()
        assert all(found.key or found.line for found in refused), (name, overrides)
        if refused:
            continue
        accepted += 1
        build(scenario)
        if scenario.dispersion is not None:
            build_study(scenario, 4, engine="diffrax")
    assert accepted > 1
