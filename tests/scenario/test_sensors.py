"""Gyro, star tracker and estimator in a scenario: what is told of mistakes, and what is built."""

import re
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.navigation.dynamics_filter import DynamicsFilter
from jaxsat.control.navigation.estimator import RawMeasurements
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.flight.flight import CannotExport, FlightController
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.errors import ScenarioWarning
from jaxsat.spacecraft.environment.disturbances import GravityGradient
from jaxsat.studies.columns import attitude_sensors
from scenario.mistakes import SWITCHING, THREE_AXIS, problems_of

GYRO = """
[gyro]
noise_density_rad_s_sqrt_Hz = 1.5e-5
bias_walk_rad_s2_sqrt_Hz = 3e-8
bias_rad_s = [1e-5, 0, -1e-5]
bias_sigma_rad_s = 1e-5
limit_rad_s = 0.2
"""
TRACKER = """
[star_tracker]
across_rad = 2.4e-5
along_rad = 1.2e-4
boresight = [0, 3, 4]
update_period_s = 0.5
latency_s = 0.2
rate_limit_rad_s = 0.1
"""
BOTH = GYRO + TRACKER
DYNAMICS = "[estimator]\nrate_sigma_rad_s = 0.1\ntorque_noise_N_m_sqrt_Hz = 1e-3\n"
MAGNETOMETER = "[magnetometer]\nnoise_nT = 100\n"
SUN_SENSOR = "[sun_sensor]\nnoise_deg = 0.1\nboresight = [1, 0, 0]\nhalf_angle_deg = 60\n"


@pytest.mark.parametrize(
    ("text", "key", "message"),
    [
        (
            GYRO,
            "star_tracker",
            "must be given with [gyro], or else [magnetometer]",
        ),
        (
            TRACKER,
            "gyro",
            "must be given with [star_tracker], or else estimator.rate_sigma_rad_s and "
            "estimator.torque_noise_N_m_sqrt_Hz, for a filter that predicts the rates",
        ),
        (
            TRACKER + "[estimator]\nrate_sigma_deg_s = 1",
            "estimator.torque_noise_N_m_sqrt_Hz",
            "must be given with [star_tracker] without [gyro], got nothing",
        ),
        (
            BOTH + "[estimator]\ntorque_noise_N_m_sqrt_Hz = 1e-3",
            "estimator.rate_sigma_rad_s",
            "must be given with torque_noise_N_m_sqrt_Hz, got nothing",
        ),
        (
            BOTH + "[estimator]\ntorque_sigma_N_m = 1e-3\nrate_sigma_rad_s = 0.1",
            "estimator.torque_noise_N_m_sqrt_Hz",
            "must be given with rate_sigma_rad_s, got nothing",
        ),
        (
            "[gyro]\nbias_rad_s = 1e-3\n" + TRACKER + DYNAMICS,
            "gyro.noise_density_rad_s_sqrt_Hz",
            "must be above 0 for a filter that takes in rates as measurements, got 0",
        ),
        (
            BOTH + "[estimator]\nkind = 'none'\ntorque_noise_N_m_sqrt_Hz = 1e-3",
            "estimator.torque_noise_N_m_sqrt_Hz",
            'must be left out with kind "none", got 0.001',
        ),
        (
            TRACKER + "[estimator]\nkind = 'none'",
            "estimator.kind",
            'must be "mekf" without [gyro], got "none"',
        ),
        (
            TRACKER + DYNAMICS + "torque_noise_N_m_s_sqrt_Hz = 1e-3",
            "estimator.torque_noise_N_m_s_sqrt_Hz",
            "did you mean torque_noise_N_m_sqrt_Hz?",
        ),
        (
            TRACKER + DYNAMICS.replace("0.1", "-0.1"),
            "estimator.rate_sigma_rad_s",
            "must be at least 0",
        ),
        ("[estimator]\nkind = 'mekf'", "estimator", "must belong to [gyro] and [star_tracker]"),
        (
            BOTH + "[estimator]\nkind = 'ukf'",
            "estimator.kind",
            'one of "mekf", "none" or have the form "module:Class", got ukf',
        ),
        (
            BOTH.replace("update_period_s = 0.5", "update_period_s = 0.25"),
            "star_tracker.update_period_s",
            "must be a multiple of control.period_s = 0.1, got 0.25",
        ),
        (
            BOTH.replace("latency_s = 0.2", "latency_s = 0.05"),
            "star_tracker.latency_s",
            "must be a multiple of control.period_s = 0.1, got 0.05",
        ),
        (
            BOTH.replace("latency_s = 0.2", "latency_s = 200"),
            "star_tracker.latency_s",
            "must be at most 1000 times control.period_s, got 200",
        ),
        (
            BOTH + "outage_start_s = 3\noutage_s = 2.5\noutage_every_s = 2.5",
            "star_tracker.outage_every_s",
            "must be above outage_s = 2.5, got 2.5",
        ),
        (
            BOTH + "outage_every_s = 2.5",
            "star_tracker.outage_every_s",
            "must be left out without outage_s, got 2.5",
        ),
        (
            GYRO + "outage_start_s = 3\n" + TRACKER,
            "gyro.outage_s",
            "must be given with outage_start_s, got nothing",
        ),
        (
            BOTH + "outage_s = 3",
            "star_tracker.outage_start_s",
            "must be given with outage_s, got nothing",
        ),
        (
            BOTH.replace("[0, 3, 4]", "[0, 0, 0]"),
            "star_tracker.boresight",
            "must be a direction, got [0.0, 0.0, 0.0]",
        ),
        (
            BOTH.replace("across_rad = 2.4e-5", "across_rad = 0"),
            "star_tracker.across_rad",
            "must be at least 1e-09",
        ),
        (MAGNETOMETER + SUN_SENSOR, "gyro", "must be given with [magnetometer], or else"),
        (
            GYRO + SUN_SENSOR,
            "magnetometer",
            "or else [horizon_sensor] or [star_tracker]: no Sun sensor measures a turn about",
        ),
        (
            GYRO + MAGNETOMETER + "[estimator]\nkind = 'none'",
            "estimator.kind",
            'must be "mekf" without [star_tracker], got "none"',
        ),
        (
            GYRO + MAGNETOMETER + "update_period_s = 0.25",
            "magnetometer.update_period_s",
            "must be a multiple of control.period_s = 0.1, got 0.25",
        ),
        (
            BOTH + SUN_SENSOR.replace("[1, 0, 0]", "[0, 0, 0]"),
            "sun_sensor.boresight",
            "must be a direction",
        ),
        (
            BOTH + SUN_SENSOR + "outage_s = 3",
            "sun_sensor.outage_start_s",
            "must be given with outage_s, got nothing",
        ),
        (
            BOTH + "[sampling]\nattitude_noise_rad = 1e-5",
            "sampling.attitude_noise_rad",
            "must be omitted with [star_tracker], got 1e-05",
        ),
    ],
)
def test_mistakes_are_told_with_their_key(text, key, message, tmp_path):
    (problem,) = problems_of(SWITCHING + text, tmp_path)
    assert problem.key == key
    assert message in problem.message


def test_sensors_with_a_state_belong_to_a_sampled_law(tmp_path):
    found = problems_of(THREE_AXIS + BOTH, tmp_path)
    assert {problem.key for problem in found} == {"gyro", "star_tracker"}
    assert all(
        'must belong to a sampled law ("quaternion-feedback"' in each.message for each in found
    )


def loaded(tmp_path, text, overrides=()):
    path = tmp_path / "own.toml"
    path.write_text(SWITCHING + text, encoding="utf-8")
    return load(path, overrides)


def test_what_is_declared_is_built(tmp_path):
    run: Any = build(loaded(tmp_path, BOTH))
    navigation = run.loop.navigation
    gyro, tracker = navigation.gyro, navigation.tracker
    assert (gyro.noise_density, gyro.bias_walk, gyro.bias_sigma) == (1.5e-5, 3e-8, 1e-5)
    np.testing.assert_array_equal(gyro.bias, [1e-5, 0, -1e-5])
    assert gyro.limit == 0.2
    assert (tracker.across, tracker.along, tracker.rate_limit) == (2.4e-5, 1.2e-4, 0.1)
    np.testing.assert_allclose(tracker.axes[2], [0, 0.6, 0.8], atol=1e-15)
    assert (tracker.every, tracker.latency) == (5, 2)
    assert isinstance(navigation.estimator, MultiplicativeFilter)
    assert navigation.attitude_sigma == 0.01


def test_the_example_of_the_page_can_be_run(tmp_path):
    """The page docs/sensors.md, as it stands: with a gyro, without, and with one that may fail."""
    page = Path(__file__).parents[2] / "docs" / "sensors.md"
    example, *others = re.findall(r"(?ms)^```toml\n(.*?)^```", page.read_text(encoding="utf-8"))
    run: Any = build(loaded(tmp_path, "\n" + example))
    navigation = run.loop.navigation
    assert (navigation.tracker.every, navigation.tracker.latency) == (5, 2)
    without, beside = (one for one in others if "torque_noise" in one)
    run = build(loaded(tmp_path, "\n" + without, ["initial.omega_rad_s=[0.01, 0, 0]"]))
    assert isinstance(run.loop.navigation.estimator, DynamicsFilter)
    run = build(loaded(tmp_path, BOTH + beside, ["initial.omega_rad_s=[0.01, 0, 0]"]))
    assert run.loop.navigation.estimator.gyro is not None


def test_vectors_are_built_in_the_field_and_under_the_sun_of_the_scenario(tmp_path):
    text = GYRO + MAGNETOMETER + "bias_nT = [10, 20, 30]\nlatency_s = 0.3\n" + SUN_SENSOR
    changes = ["disturbance.sun_direction=[0, 0, 2]", "disturbance.eclipses=true"]
    run: Any = build(loaded(tmp_path, text, changes))
    navigation = run.loop.navigation
    assert navigation.tracker is None
    field, sun = navigation.vectors
    assert field.noise == pytest.approx(1e-7)
    np.testing.assert_allclose(field.bias, [1e-8, 2e-8, 3e-8])
    assert (field.latency, sun.latency, navigation.estimator.latency) == (3, 0, 3)
    assert np.degrees([sun.noise, sun.half_angle]) == pytest.approx([0.1, 60])
    np.testing.assert_array_equal(sun.reference.sun, [0, 0, 2])
    assert sun.reference.eclipses
    horizon = SUN_SENSOR.replace("sun_sensor", "horizon_sensor")
    run = build(loaded(tmp_path, GYRO + SUN_SENSOR + horizon, ["simulation.duration_s=10"]))
    _, down = run.loop.navigation.vectors
    np.testing.assert_array_equal(down.reference(jnp.array(3.0))[0], [0, 0, 1])
    assert float(field.reference.field.orbit.rate) == float(run.loop.plant.orbit.rate)


def test_a_magnetometer_alone_needs_time(tmp_path):
    half_orbit = np.pi / loaded(tmp_path, "").orbit.rate()
    short, long = (f"simulation.duration_s={round(half_orbit + s)}" for s in (-10, 10))
    with pytest.warns(ScenarioWarning, match=f"magnetometer: .*half an orbit, {half_orbit:.4g} s"):
        loaded(tmp_path, GYRO + MAGNETOMETER, [short])
    loaded(tmp_path, GYRO + MAGNETOMETER, [long])
    loaded(tmp_path, GYRO + MAGNETOMETER + SUN_SENSOR, [short])


def test_without_an_estimator_the_law_is_told_what_is_measured(tmp_path):
    run: Any = build(loaded(tmp_path, BOTH + "[estimator]\nkind = 'none'"))
    assert isinstance(run.loop.navigation.estimator, RawMeasurements)


def test_noise_of_sampling_is_not_dispersed_beside_them(tmp_path):
    path = tmp_path / "own.toml"
    noise = "[dispersion.rate_noise_rad_s]\ndistribution = 'uniform'\nlow = 0\nhigh = 1e-5"
    path.write_text(SWITCHING + BOTH + noise, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load(path, purpose="study")
    (problem,) = caught.value.problems
    assert "the loop has no sensors" in problem.message


@pytest.mark.slow
def test_a_case_draws_its_errors_from_its_own_key(tmp_path):
    """Bias and first estimate, the same in any company and of the size that is declared."""
    study = build_study(
        loaded(
            tmp_path,
            BOTH + "[dispersion.turn_rad]\ndistribution = 'uniform'\nlow = 0\nhigh = 1",
        ),
        400,
        engine="scan",
    )

    def first(case):
        made: Any = study.case_factory(case)
        true = made.start.attitude.as_quaternion()
        return made.loop.navigation.init(made.start), true.q

    def drawn(numbers):
        return jax.jit(jax.vmap(first))(study.cases(np.array(numbers)))

    states, true = drawn(range(400))
    alone, _ = drawn([17])
    np.testing.assert_array_equal(alone.bias[0], states.bias[17])
    np.testing.assert_array_equal(alone.memory.belief.q[0], states.memory.belief.q[17])
    off = np.asarray(states.bias) - [1e-5, 0, -1e-5]
    assert off.std() == pytest.approx(1e-5, rel=0.1)
    angles = 2 * np.sqrt(1 - np.sum(np.asarray(states.memory.belief.q * true), axis=1) ** 2)
    assert np.sqrt(np.mean(angles**2)) == pytest.approx(0.01 * np.sqrt(3), rel=0.1)


WHEELS = """
[[wheel]]
axis = [1, 0, 0]
tachometer_noise_N_m_s = 1e-3
[[wheel]]
axis = [0, 1, 1]
tachometer_noise_N_m_s = 2e-3
"""


def test_a_filter_without_a_gyro_knows_the_declared_body(tmp_path):
    """Its actuators without failures, of the disturbances the gravity gradient, tachometers."""
    failure = "\n[[failure]]\nof = 'thruster 1'\nat_s = 10\nkind = 'dead'\n"
    changes = ["disturbance.gravity_gradient=true", "disturbance.constant_N_m=[1, 0, 0]"]
    torques = "torque_sigma_N_m = 2\ntorque_walk_N_m_s_sqrt_Hz = 0.1\n"
    text = TRACKER + DYNAMICS + torques + failure
    run: Any = build(loaded(tmp_path, text, changes))
    navigation = run.loop.navigation
    estimator, model = navigation.estimator, navigation.body
    assert isinstance(estimator, DynamicsFilter)
    assert navigation.gyro is None
    assert run.loop.sensors is None
    assert estimator.body is model
    assert run.loop.plant.effectors[0].failures is not None
    assert model.effectors[0].failures is None
    assert isinstance(model.disturbance, GravityGradient)
    torques = estimator.torques
    numbers = (torques.noise, torques.sigma, torques.walk, estimator.rate_sigma)
    assert [float(one) for one in numbers] == [1e-3, 2.0, 0.1, 0.1]
    assert estimator.latency == 2
    assert estimator.momentum_noise is None


def test_tachometers_are_known_with_their_noise(tmp_path):
    wheels = SWITCHING.replace("thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\n", "")
    path = tmp_path / "own.toml"
    names = ("rate_slope_limit_rad_s2", "three_axis_slope_limit_rad_s2")
    limits = "k1 = 0.4\n" + "".join(f"{name} = [0.1, 0.1]\n" for name in names)
    wheels = wheels.replace("torque_limit_N_m = 5\n", "").replace("k1 = 0.4\n", limits)
    path.write_text(wheels + WHEELS + TRACKER + DYNAMICS, encoding="utf-8")
    run: Any = build(load(path))
    axes = np.array([[1.0, 0, 0], [0, np.sqrt(0.5), np.sqrt(0.5)]]).T
    expected = axes @ np.diag([1e-6, 4e-6]) @ axes.T
    np.testing.assert_allclose(run.loop.navigation.estimator.momentum_noise, expected)


def test_a_filter_without_a_gyro_does_not_become_flight_code(tmp_path):
    run: Any = build(loaded(tmp_path, TRACKER + DYNAMICS))
    with pytest.raises(CannotExport, match="gyro: must be given for what becomes flight code"):
        FlightController.of(run.loop)


NUMBERS = "estimator={rate_sigma_rad_s=0.1, torque_noise_N_m_sqrt_Hz=1e-3}"


def test_what_a_filter_without_a_gyro_cannot_know_is_refused(tmp_path):
    own = SWITCHING.replace("[[1, 0, 0], [0, 1, 0]]", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]")
    held = own.replace("torque_limit_N_m = 5", 'torque_limit_N_m = 5\nthird_rate = "held"')
    found = problems_of(held + TRACKER + DYNAMICS, tmp_path)
    messages = {one.key: one.message for one in found}
    assert 'must be "free" without [gyro]' in messages["spacecraft.third_rate"]
    outage = "tachometer_outage_start_s = 5\ntachometer_outage_s = 2\n"
    (problem,) = problems_of(SWITCHING + WHEELS + outage + TRACKER + DYNAMICS, tmp_path)
    assert problem.key == "wheel.tachometer_outage_start_s"
    assert "must be left out without [gyro]" in problem.message
    with pytest.raises(ScenarioError, match=r"gyro: must be given with this law, which finds"):
        load("failures-12u", ["star_tracker={across_rad=1e-5, along_rad=1e-4}", NUMBERS])


def test_a_gyro_beside_the_dynamics_is_a_sensor(tmp_path):
    """The filter knows gyro and body; its loop needs no guard when the gyro fails, and has no
    flight code."""
    failing = "[[failure]]\nof = 'gyro'\nat_s = 3\nkind = 'dead'\n"
    run: Any = build(loaded(tmp_path, BOTH + DYNAMICS + failing))
    estimator: Any = run.loop.navigation.estimator
    assert isinstance(estimator, DynamicsFilter)
    assert estimator.gyro is not None
    assert run.loop.guard is None
    assert attitude_sensors(run.loop) == ("star_tracker", "gyro")
    with pytest.raises(CannotExport, match="torque_noise_N_m_sqrt_Hz: must be left out for what"):
        FlightController.of(run.loop)
    with pytest.warns(ScenarioWarning, match="so that the filter predicts rates by the dynamics"):
        integrating: Any = build(loaded(tmp_path, BOTH + failing))
    assert integrating.loop.guard is not None
    assert attitude_sensors(integrating.loop) == ("star_tracker",)
    with pytest.raises(ScenarioError, match=r"must be left out with this law, which finds"):
        load("thruster-dies", [NUMBERS])
