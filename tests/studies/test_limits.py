"""What may be drawn: the ranges of the keys, for every quantity, in the file and in the draw."""

from typing import Any

import numpy as np
import pytest

from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.trajectory import Outcome
from jaxsat.studies.dispersions import Dispersions
from jaxsat.studies.distributions import Normal, Uniform
from jaxsat.studies.quantities import QUANTITIES
from studies.copies import copies_of, sampled
from studies.studies import tumbling

SENSORS = [
    "gyro={bias_sigma_rad_s=1e-5, outage_start_s=5, outage_s=9, outage_every_s=20}",
    "star_tracker={across_rad=1e-5, along_rad=1e-4, latency_s=0.2, outage_start_s=5, outage_s=9,"
    "outage_every_s=20}",
    "magnetometer={noise_T=1e-7, outage_start_s=5, outage_s=9, outage_every_s=20}",
    "sun_sensor={noise_rad=1e-3, outage_start_s=5, outage_s=9, outage_every_s=20}",
    "horizon_sensor={noise_rad=1e-3, outage_start_s=5, outage_s=9, outage_every_s=20}",
]

NOMINAL = {"rate_noise": 1e-5, "attitude_noise": 1e-5, "delay": 0.05, "tilt": 0.7}
NOMINAL |= {"tracker_across": 1e-5, "tracker_along": 1e-5}
NOMINAL |= {"magnetometer_noise": 1e-7, "sun_sensor_noise": 1e-3, "horizon_sensor_noise": 1e-3}
NOMINAL |= {f"{sensor}_outage_every": 20.0 for sensor in ("gyro", "tracker", "magnetometer")}
NOMINAL |= {f"{sensor}_outage_every": 20.0 for sensor in ("sun_sensor", "horizon_sensor")}
NOMINAL |= {"gyro_outage_start": 5.0, "tracker_update_period": 0.1, "tracker_rate_limit": 1.0}
"""Numbers that may be drawn; zero for all others."""

BEYOND = {
    "inertia": (-1.0, 1e12),
    "products_of_inertia": (-1.5, 1.5),
    "rotor_inertia": (-1.0, 1e14),
    "misalignment": (-1.1, 1.1),
    "torque_gain": (-1.1, 2e3),
    "disturbance_amplitude": (-1e13, 1e13),
    "disturbance_frequency": (-1e8, 1e8),
    "disturbance_phase": (-2e6, 2e6),
    "constant_torque": (-2e9, 2e9),
    "model_inertia": (-1.0, 1e12),
    "model_orbit_rate": (-1.1, 1e4),
    "rate_noise": (-1e-9, 2e3),
    "attitude_noise": (-1e-9, 20.0),
    "delay": (-0.05, 0.3),
    "tilt": (-0.1, 2e6),
    "tilt_direction": (-2e6, 2e6),
    "turn": (-2e6, 2e6),
    "attitude_error": (-7.0, 7.0),
    "omega": (-2e6, 2e6),
    "rate_error": (-2e6, 2e6),
    "failure_time": (-1.0, 2e8),
    "failed_thruster": (-0.6, 7.6),
    "failed_wheel": (-0.6, 1.6),
    "failed_magnetorquer": (-0.6, 1.6),
    "dipole_limit": (-1.1, 2e6),
    "magnetorquer_misalignment": (-1.1, 1.1),
    "failed_gimbal": (-0.6, 1.6),
    "rotor_momentum": (-1.1, 2e9),
    "mode_coupling": (-1.1, 1e7),
    "mode_frequency": (-1.1, 1e7),
    "mode_damping": (-1.1, 1e4),
    "wheel_momentum": (-21.0, 21.0),
    "sensor_failure_time": (-1.0, 2e8),
    "failure_kind": (-0.6, 6.6),
    "failure_amount": (-0.1, 1.1),
    "gyro_noise_density": (-1e-9, 2e3),
    "gyro_bias_walk": (-1e-9, 2e3),
    "gyro_bias": (-2e3, 2e3),
    "gyro_scale_factor": (-0.6, 0.6),
    "gyro_misalignment": (-1.1, 1.1),
    "gyro_outage_start": (0.0, 2e8),
    "gyro_outage": (-1.0, 2e8),
    "gyro_outage_every": (0.0, 2e8),
    "tracker_across": (0.0, 2.0),
    "tracker_along": (0.0, 2.0),
    "tracker_update_period": (0.01, 2e8),
    "tracker_latency": (-0.1, 0.3),
    "tracker_rate_limit": (0.0, 2e6),
    "tracker_outage_start": (-1.0, 2e8),
    "tracker_outage": (-1.0, 2e8),
    "tracker_outage_every": (0.0, 2e8),
    "magnetometer_noise": (0.0, 2e-3),
    "magnetometer_bias": (-2e-3, 2e-3),
    "magnetometer_scale_factor": (-0.6, 0.6),
    "magnetometer_misalignment": (-1.1, 1.1),
    "magnetometer_outage_start": (-1.0, 2e8),
    "magnetometer_outage": (-1.0, 2e8),
    "magnetometer_outage_every": (0.0, 2e8),
    "sun_sensor_noise": (0.0, 2.0),
    "sun_sensor_misalignment": (-1.1, 1.1),
    "sun_sensor_outage_start": (-1.0, 2e8),
    "sun_sensor_outage": (-1.0, 2e8),
    "sun_sensor_outage_every": (0.0, 2e8),
    "horizon_sensor_noise": (0.0, 2.0),
    "horizon_sensor_misalignment": (-1.1, 1.1),
    "horizon_sensor_outage_start": (-1.0, 2e8),
    "horizon_sensor_outage": (-1.0, 2e8),
    "horizon_sensor_outage_every": (0.0, 2e8),
}
"""For every quantity a number too low and one too high, in the scenarios of `scenario`."""


def test_every_quantity_has_its_test():
    assert set(BEYOND) | {"attitude"} == set(QUANTITIES)


WHEELS = (
    "wheel=[{axis=[1.0,0.0,0.0],momentum_limit_N_m_s=20.0,rotor_inertia_kg_m2=0.1},"
    "{axis=[0.0,1.0,0.0],momentum_limit_N_m_s=20.0,rotor_inertia_kg_m2=0.1}]",
    "failure=[{of='wheel 1',at_s=5.0,kind='dead'}]",
)


OF_RODS = ("failed_magnetorquer", "dipole_limit", "magnetorquer_misalignment")
RODS = (
    "magnetorquer=[{axis=[1.0,0.0,0.0],dipole_limit_A_m2=1.0},"
    "{axis=[0.0,1.0,0.0],dipole_limit_A_m2=1.0}]",
    "failure=[{of='magnetorquer 1',at_s=5.0,kind='dead'}]",
)


OF_GYROS = ("failed_gimbal", "rotor_momentum")
GYROS = (
    "gimbal=[{axis=[1,0,0],spin_axis=[0,1,0],rotor_momentum_N_m_s=1.0,rate_limit_rad_s=1.0},"
    "{axis=[0,1,0],spin_axis=[0,0,1],rotor_momentum_N_m_s=1.0,rate_limit_rad_s=1.0}]",
    "failure=[{of='gimbal 1',at_s=5.0,kind='locked'}]",
)


OF_MODES = ("mode_coupling", "mode_frequency", "mode_damping")
MODES = (
    "flexible_mode=[{frequency_rad_s=1.0,damping=0.01,coupling_sqrt_kg_m=[0.1,0.0,0.0]},"
    "{frequency_rad_s=2.0,damping=0.01,coupling_sqrt_kg_m=[0.0,0.1,0.0]}]",
)


FAILING = ("failure=[{of='star_tracker',at_s=5.0,kind='stuck'}]",)


def scenario(name):
    """The scenario in which a quantity may be drawn: its name, and what is changed in it."""
    if name == "sensor_failure_time":
        return "switching", (*scenario("gyro")[1], *FAILING)
    if name in OF_RODS:
        return "cubesat-12u", RODS
    if name in OF_GYROS:
        return "cubesat-12u", GYROS
    if name in OF_MODES:
        return "cubesat-12u", MODES
    if name.startswith("fail") and "wheel" not in name:
        return "cubesat-12u", ()
    if name == "rate_error":
        return "benchmark-three-axis", ()
    if name.startswith(("gyro", "tracker", "magnetometer", "sun_sensor", "horizon_sensor")):
        noise = ("sampling.rate_noise_rad_s=0", "sampling.attitude_noise_rad=0")
        return "switching", (*SENSORS, *noise)
    sampling = ("sampling.delay_s=0.05", "sampling.rate_noise_rad_s=1e-5")
    return "switching", (*sampling, *(WHEELS if "wheel" in name or "rotor" in name else ()))


def problems(names, distributions, *more):
    """What is wrong with the distributions of quantities that share a scenario: key and message."""
    base, changed = scenario(names[0])
    keys = {name: f"dispersion.{DISPERSIBLE[name].key}" for name in names}
    drawn = [f"{keys[name]}={distributions[name]}" for name in names]
    with pytest.raises(ScenarioError) as caught:
        load(base, [*more, *changed, *drawn], purpose="study")
    return {
        name: [
            ((problem.key or "").removeprefix(key).removeprefix("."), problem.message)
            for problem in caught.value.problems
            if f"{problem.key}.".startswith(f"{key}.")
        ]
        for name, key in keys.items()
    }


def refused(name, distribution, *more):
    return problems([name], {name: distribution}, *more)[name][0]


OF_ONE_SCENARIO = [
    [name for name in BEYOND if scenario(name) == one]
    for one in dict.fromkeys(map(scenario, BEYOND))
]


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")  # of two wheels' momentum
@pytest.mark.parametrize("names", OF_ONE_SCENARIO, ids=lambda names: names[0])
@pytest.mark.parametrize(("end", "word"), [("low", "least"), ("high", "most")])
def test_supports_are_held_against_the_ranges_of_the_keys(names, end, word):
    beyond = {name: BEYOND[name][end == "high"] for name in names}
    fine = {name: NOMINAL.get(name, 0.0) for name in names}
    ends = {
        name: f"low={min(fine[name], other)}, high={max(fine[name], other)}"
        for name, other in beyond.items()
    }
    of_kinds = {
        "uniform": (end, ends),
        "normal": ("mean", {name: f"mean={other}, sigma=1" for name, other in beyond.items()}),
        "discrete": (
            "values",
            {name: f"values=[{fine[name]}, {beyond[name]}], weights=[1, 1]" for name in names},
        ),
        "truncated-normal": (end, {name: f"mean=0, sigma=1e6, {ends[name]}" for name in names}),
    }
    for kind, (key, texts) in of_kinds.items():
        tables = {name: f"{{distribution='{kind}', {text}}}" for name, text in texts.items()}
        for name, wrong in problems(names, tables).items():
            assert [found for found, _ in wrong] == [key], (name, kind)
            if kind == "uniform":
                assert f"must be at {word} " in wrong[0][1]
                assert f"got {beyond[name]:.6g}" in wrong[0][1]


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
@pytest.mark.parametrize("names", OF_ONE_SCENARIO, ids=lambda names: names[0])
def test_distributions_made_in_python_are_held_against_them_as_well(names):
    loop = build(load(*scenario(names[0]))).loop
    for name in names:
        beyond = Uniform(BEYOND[name][0], NOMINAL.get(name, 0.0))
        with pytest.raises(ValueError, match=f"`{name}` must be at least"):
            Dispersions({name: beyond}).check(loop)


@pytest.mark.parametrize(
    ("name", "distribution", "key", "message"),
    [
        ("turn", "{distribution='uniform', low=1, high=-1}", "low", "must not exceed `high`"),
        ("turn", "{distribution='uniform', low=[1, 2], high=3}", "", "must have 1 components"),
        ("omega", "{distribution='uniform', low=[0, 0, 0], high=[1, 1]}", "", "one length"),
        ("turn", "{distribution='normal', mean=0, sigma=-1}", "sigma", "zero or positive"),
        ("turn", "{distribution='discrete', values=[1, 2], weights=[1]}", "weights", "2 entries"),
        ("turn", "{distribution='discrete', values=[1], weights=[0]}", "weights", "a sum from"),
        ("turn", "{distribution='discrete', values=[1, 2], weights=[2, -1]}", "weights", "posit"),
        ("omega", "{distribution='discrete', values=[[0], [0]], weights=[[1], [1]]}", "",
         "must have 3 components"),
        ("omega", "{distribution='discrete', values=[[0, 1], [0, 9e9], [0, 1]], "
         "weights=[[1, 1], [1, 1], [1, 1]]}", "values", "(component 2), got 9e+09 as entry 2"),
        ("omega", "{distribution='discrete', values=[[0, 1], [0]], weights=[1]}", "",
         "lists of one length in values, got [2, 1]"),
        ("turn", "{distribution='truncated-normal', mean=0, sigma=1e-300, low=-1, high=1}", "sigma",
         "of the distance from the mean"),
        ("omega", "{distribution='random-attitude'}", "distribution", "RandomAttitude"),
        ("attitude", "{distribution='uniform', low=0, high=1}", "distribution", "RandomAttitude"),
        ("omega", "{distribution='uniform', low=[-1, -1, -9e9], high=1}", "low", "as entry 3"),
    ],
)  # fmt: skip
def test_what_is_no_distribution_for_the_quantity_is_told_with_its_key(
    name, distribution, key, message
):
    found = refused(name, distribution)
    assert found[0] == key
    assert message in found[1]


def test_ranges_follow_what_else_the_scenario_says():
    delay = "{distribution='uniform', low=0, high=0.3}"
    assert "at most 0.1 s" in refused("delay", delay)[1]
    load("switching", ["control.period_s=0.5", "sampling.delay_s=0", f"dispersion.delay_s={delay}"],
         purpose="study")  # fmt: skip
    omega = "{distribution='uniform', low=-0.1, high=0.1}"
    held = ["spacecraft.third_rate=held", "initial.omega_rad_s=[0, 0, 0]"]
    assert "component 3" in refused("omega", omega, *held)[1]
    known = "{distribution='uniform', low=-1.5, high=0}"
    wave = ["disturbance.frequency_rad_s=[0.7, 0.8, 0]"]
    key = f"dispersion.disturbance_frequency={known}"
    load("switching", [*wave, key], purpose="study")
    assert "at least -1" in refused(
        "disturbance_frequency", known, *wave, "dispersion.frequency_known=true"
    )[1]  # fmt: skip


def test_a_tilt_has_a_direction_to_keep():
    tilt = "{distribution='uniform', low=0, high=1}"
    assert "must have a start that is tilted" in refused("tilt", tilt, "initial.w=[0, 0]")[1]


def test_simulating_does_not_need_what_is_dispersed_but_its_ranges_are_checked():
    noise = "dispersion.rate_noise_rad_s={distribution='uniform', low=0, high=%s}"
    load("paper-rate", [noise % 1])
    with pytest.raises(ScenarioError, match="only sampled loops have sensors"):
        load("paper-rate", [noise % 1], purpose="study")
    gain = "dispersion.torque_gain={distribution='uniform', low=-2, high=0}"
    with pytest.raises(ScenarioError, match=r"key dispersion\.torque_gain\.low: must be at least"):
        load("switching", [gain])


TAILS: Any = {"delay": Normal(0.05, 0.04), "rate_noise": Normal(0.0, 1e-3),
         "tilt": Normal(0.5, 0.5), "torque_gain": Normal(-0.9, 0.1),
         "model_orbit_rate": Normal(-0.5, 1.0)}  # fmt: skip


def allowed(copy, name):
    drawn = np.asarray(copy.drawn[name])
    limits = QUANTITIES[name].limits(sampled())
    return ((drawn >= np.asarray(limits.low)) & (drawn <= np.asarray(limits.high))).all(axis=1)


@pytest.mark.slow
def test_one_draw_beyond_its_limits_makes_the_case_impossible():
    """Whichever it is: of each quantity there are cases in which it alone is beyond."""
    copy = copies_of(sampled(), 200, **TAILS)
    good = np.array([allowed(copy, name) for name in TAILS])
    np.testing.assert_array_equal(copy.possible, good.all(axis=0))
    assert 5 < good.all(axis=0).sum() < 195
    for row in good:
        assert np.any(~row & (good.sum(axis=0) == len(TAILS) - 1))


@pytest.mark.slow
@pytest.mark.parametrize("name", TAILS)
def test_what_only_the_draw_can_tell_makes_the_case_impossible(name):
    copy = copies_of(sampled(), 60, **{name: TAILS[name]})
    good = allowed(copy, name)
    np.testing.assert_array_equal(copy.possible, good)
    assert 5 < good.sum() < 55


@pytest.mark.slow
def test_an_impossible_draw_fails_its_case_alone_and_is_counted():
    """Through an engine: a code of its own, no numbers, and the neighbours' bits as if alone."""
    study = tumbling(24, 3, torque_gain=Normal(-0.9, 0.1))
    found = study.evaluate(np.arange(24))
    bad = found.code == int(Outcome.IMPOSSIBLE_CASE)
    np.testing.assert_array_equal(bad, (found.drawn["torque_gain"] < -1).any(axis=1))
    assert 2 < bad.sum() < 22
    for values in (found.cost, found.effort, found.omega, found.quaternion, found.peak_rate):
        assert np.isnan(values[bad]).all()
        assert np.isfinite(values[~bad]).all()
    alone = study.evaluate(np.flatnonzero(~bad))
    np.testing.assert_array_equal(alone.omega, found.omega[~bad])
    np.testing.assert_array_equal(alone.cost, found.cost[~bad])
