"""`[[failure]]` of a sensor in a scenario: what is told of mistakes, what is built, studies, and
the page's example."""

import re
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.core.declaration.sensor import SensorFailureKind
from jaxsat.core.declaration.wheels import WHEEL
from jaxsat.report.requirements import judgements
from jaxsat.report.run_document import run_document
from jaxsat.report.study_document import study_document
from jaxsat.scenario import ScenarioError, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.errors import ScenarioWarning
from jaxsat.simulation.loops import sensor_failures_of
from jaxsat.store.dataset import trajectory_dataset
from jaxsat.store.tables import case_table, open_study
from jaxsat.studies.quantities import QUANTITIES
from jaxsat.studies.run import run_study
from jaxsat.studies.summary import summarise
from jaxsat.synthesis.verification.conditions import with_failures

pytestmark = pytest.mark.filterwarnings("ignore:.*so that the filter predicts rates by")

ROOT = Path(__file__).parents[3]
SENSORS = """
[gyro]
noise_density_deg_sqrt_h = 0.05
bias_sigma_deg_h = 4

[star_tracker]
across_arcsec = 5
along_arcsec = 25
update_period_s = 0.5
latency_s = 0.2

[magnetometer]
noise_nT = 100

[sun_sensor]
noise_deg = 0.1
"""
TEST = "[estimator]\nfalse_alarm_probability = 1e-6\n"
BASE = """
title = "A CubeSat that points at the Earth"

[spacecraft]
inertia_kg_m2 = [0.30, 0.55, 0.62]

[orbit]
altitude_km = 500
inclination_rad = 1.7

[disturbance]
gravity_gradient = true

[[wheel]]
axis = [1, 0, 0]
torque_limit_N_m = 0.004

[[wheel]]
axis = [0, 1, 0]
torque_limit_N_m = 0.004

[[wheel]]
axis = [0, 0, 1]
torque_limit_N_m = 0.004

[initial]
quaternion = [1, 0, 0, 0]
omega_rad_s = [0, 0, 0]

[control]
law = "quaternion-feedback"
period_s = 0.1
natural_frequency_rad_s = 0.05

[simulation]
duration_s = 600
save_every_s = 0.5
"""


def failure(of="star_tracker", kind="stuck", at=2, more=""):
    return f'[[failure]]\nof = "{of}"\nat_s = {at}\nkind = "{kind}"\n{more}\n'


def loaded(folder, text, changes=(), purpose: Any = None):
    path = folder / "own.toml"
    path.write_text(BASE + SENSORS + text, encoding="utf-8")
    return load(path, list(changes), **({"purpose": purpose} if purpose else {}))


@pytest.mark.parametrize(
    ("text", "key", "message"),
    [
        (failure("star_trackr"), "failure.of", 'must name one of "gyro", "star_tracker", '),
        (failure("star_trackr"), "failure.of", 'got "star_trackr", did you mean star_tracker?'),
        (failure("tachometer 4"), "failure.of", 'got "tachometer 4"'),
        (failure("gyro", at=0), "failure.at_s", "must be above 0 for a gyro, after the first"),
        (failure("tachometer 1", at=0), "failure.at_s", "must be above 0 for a tachometer, after"),
        (
            failure("gyro", "stuck", more="drift_rad_s = [0, 0, 1]"),
            "failure.drift_rad_s",
            'must not be given for a failure of kind "stuck"',
        ),
        (
            failure("tachometer 1", "spiking", more="spike_probability = 0.1"),
            "failure.spike_N_m_s",
            'must be given for a failure of kind "spiking", got nothing',
        ),
        (failure("horizon_sensor"), "failure.of", 'got "horizon_sensor"'),
        (failure(kind="stuk"), "failure.kind", "did you mean stuck?"),
        (failure("wheel 1", "seized"), "failure.kind", "must be one of dead, degraded, stopped, "),
        (failure("wheel 1", "seized"), "failure.kind", 'friction-up, runaway for a wheel, got "se'),
        (
            failure(kind="stopped"),
            "failure.kind",
            'must be one of dead, stuck, drifting, spiking for a star_tracker, got "stopped"',
        ),
        (failure("wheel 1"), "failure.kind", "must be one of dead, degraded, stopped"),
        (
            failure(kind="drifting"),
            "failure.drift_rad_s",
            'must be given for a failure of kind "drifting", got nothing',
        ),
        (
            failure(kind="spiking", more="spike_deg = 1"),
            "failure.spike_probability",
            'must be given for a failure of kind "spiking", got nothing',
        ),
        (
            failure(more="fraction = 0.5"),
            "failure.fraction",
            'must not be given for a failure of kind "stuck", got 0.5',
        ),
        (
            "[estimator]\nkind = 'none'\nfalse_alarm_probability = 1e-3\n",
            "estimator.false_alarm_probability",
            'must be left out with kind "none", got 0.001',
        ),
        (
            "[estimator]\npatience = 3\n",
            "estimator.patience",
            "must be left out without false_alarm_probability, got 3",
        ),
        (
            "[estimator]\nprobation = 50\n",
            "estimator.probation",
            "must be left out without false_alarm_probability, got 50",
        ),
    ],
)
def test_mistakes_are_told(tmp_path, text, key, message):
    with pytest.raises(ScenarioError) as caught:
        loaded(tmp_path, text)
    (problem,) = caught.value.problems
    assert problem.key == key
    assert message in problem.message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (failure(), "estimator.false_alarm_probability: should be given, else the filter uses"),
        (TEST + failure(at=700), "failure.at_s: should be before simulation.duration_s"),
        (
            TEST + failure(kind="dead") + failure(at=5),
            'should be meant to replace "dead" at 2.0 s, after which star_tracker works again',
        ),
    ],
)
def test_cautions(tmp_path, text, message):
    with pytest.warns(ScenarioWarning, match=message):
        loaded(tmp_path, text)


def test_failures_are_numbered_among_the_sensors_that_there_are(tmp_path):
    text = (
        TEST
        + "patience = 7\nprobation = 30\n"
        + failure("sun_sensor", "drifting", 5, "drift_deg_s = [0, 0, 0.1]")
        + failure("star_tracker", "spiking", 9, "spike_deg = 2\nspike_probability = 0.5")
        + failure("wheel 1", "dead", 7)
    )
    run: Any = build(loaded(tmp_path, text))
    found = run.loop.navigation.failures
    np.testing.assert_array_equal(found.number, [2, 0])
    np.testing.assert_array_equal(found.at, [5, 9])
    kinds = [SensorFailureKind.DRIFTING, SensorFailureKind.SPIKING]
    np.testing.assert_array_equal(found.kind, kinds)
    np.testing.assert_allclose(found.drift, np.radians([[0, 0, 0.1], [0, 0, 0]]))
    np.testing.assert_allclose(found.amount, [0, np.radians(2)])
    np.testing.assert_allclose(found.quantile, [np.inf, 0], atol=1e-15)
    (wheels,) = [one for one in run.loop.plant.effectors if one.kind == "wheel"]
    np.testing.assert_array_equal(wheels.failures.at, [7])
    estimator: Any = run.loop.navigation.estimator
    assert isinstance(estimator, MultiplicativeFilter)
    test: Any = estimator.test
    assert (test.patience, test.probation) == (7, 30)
    assert build(loaded(tmp_path, "")).loop.navigation.failures is None  # pyright: ignore
    verified = with_failures(loaded(tmp_path, text + DRAWN), (WHEEL,))
    assert [one.of for one in verified.failure] == ["sun_sensor", "star_tracker", "wheel 1"]


DRAWN = """
[dispersion.sensor_failure_time_s]
distribution = "uniform"
low = 1
high = 5
"""


def test_times_of_failures_are_drawn(tmp_path):
    scenario = loaded(tmp_path, TEST + failure() + DRAWN, purpose="study")
    study = build_study(scenario, 6, engine="scan")
    made: Any = jax.vmap(study.case_factory)(study.cases(np.arange(6)))
    at = np.asarray(made.loop.navigation.failures.at)
    assert at.shape == (6, 1)
    assert np.all((at >= 1) & (at <= 5))
    assert len(np.unique(at)) == 6
    with pytest.raises(ScenarioError, match="no failure of an actuator in flight"):
        drawn = DRAWN.replace("sensor_failure", "failure")
        loaded(tmp_path, TEST + failure() + drawn, purpose="study")


@pytest.mark.parametrize(("part", "low"), [("star_tracker", 0), ("gyro", 1e-6)])
def test_a_gyro_fails_after_the_first_sample_in_studies_too(tmp_path, part, low):
    text = TEST + failure(part, "stuck") + DRAWN
    study = build_study(loaded(tmp_path, text, purpose="study"), 2, engine="scan")
    limits = QUANTITIES["sensor_failure_time"].limits(study.case_factory.loop)
    assert float(limits.low) == low


OTHERS = (
    failure("gyro", "spiking", more="spike_deg_s = 0.1\nspike_probability = 0.1")
    + failure("tachometer 1", "stuck")
    + failure("tachometer 2", "drifting", more="drift_N_m = 1e-5")
)


@pytest.mark.slow
@pytest.mark.parametrize("failing", [failure(), OTHERS], ids=["tracker", "gyro, tachometers"])
def test_engines_agree_and_a_case_alone_has_the_same_bits(tmp_path, failing):
    changes = ["simulation.duration_s=20"]
    scenario = loaded(tmp_path, TEST + failing + DRAWN, changes, purpose="study")
    found = {
        engine: build_study(scenario, 5, engine=engine, batch_size=6).evaluate(np.arange(5))
        for engine in ("native", "diffrax")
    }
    np.testing.assert_allclose(found["native"].omega, found["diffrax"].omega, atol=1e-9)
    alone = build_study(scenario, 5, engine="native", batch_size=6).evaluate(np.array([3]))
    np.testing.assert_array_equal(alone.omega[0], found["native"].omega[3])


OUTAGES = {
    "gyro": ("[gyro]\n", "[gyro]\noutage_start_s = 3\noutage_s = 1e8\n"),
    "tachometer 2": (
        "axis = [0, 1, 0]\n",
        "axis = [0, 1, 0]\ntachometer_outage_start_s = 3\ntachometer_outage_s = 1e8\n",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("part", OUTAGES)
def test_what_is_dead_flies_as_in_an_outage_that_never_ends(tmp_path, part):
    """Bit for bit, with commands that are held for ten samples and then zero."""
    changes = ["simulation.duration_s=20", "initial.omega_rad_s=[0.002,0.001,-0.001]"]
    dead = build(loaded(tmp_path, TEST + failure(part, "dead", 3), changes)).simulate()
    path = tmp_path / "own.toml"
    path.write_text((BASE + SENSORS + TEST).replace(*OUTAGES[part]), encoding="utf-8")
    outage = build(load(path, changes)).simulate()
    np.testing.assert_array_equal(dead.signals.omega, outage.signals.omega)
    np.testing.assert_array_equal(dead.signals.torque, outage.signals.torque)
    commands = np.abs(dead.signals.parts["wheel_torque"]).max(axis=1)
    time = np.asarray(dead.times)
    assert np.all(commands[(time > 3.05) & (time < 3.95)] > 0)
    assert not commands[time > 4.05].any()


def test_failures_of_gyro_and_tachometers_are_built(tmp_path):
    text = TEST + failure("gyro", "drifting", 5, "drift_deg_s2 = [0, 0, 0.1]")
    text += failure("tachometer 3", "spiking", 9, "spike_N_m_s = 0.1\nspike_probability = 0.5")
    loop: Any = build(loaded(tmp_path, text)).loop
    gyro, wheels = loop.navigation.gyro.failures, loop.tachometers.failures
    np.testing.assert_allclose(gyro.drift, np.radians([[0, 0, 0.1]]))
    np.testing.assert_array_equal(wheels.number, [2])
    np.testing.assert_allclose(wheels.amount, [0.1])
    np.testing.assert_allclose(wheels.quantile, [0], atol=1e-15)
    assert loop.navigation.failures is None
    assert loop.guard is not None
    assert sensor_failures_of(loop) == [gyro, wheels]


def example():
    """The tables of the page's example, of an estimator and a failure."""
    text = (ROOT / "docs/sensors.md").read_text(encoding="utf-8")
    (found,) = re.findall(r"```toml\n(\[estimator\]\nfalse_alarm.*?)```", text, re.DOTALL)
    return found


REQUIREMENT = """
[[requirement]]
id = "pointing"
formula = "always[failure, end] pointing_error < 0.1 deg"
"""


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="no docs beside the package")
def test_the_star_tracker_of_the_page_is_excluded_and_the_pointing_kept(tmp_path):
    scenario = loaded(tmp_path, example() + REQUIREMENT)
    run = build(scenario)
    dataset = trajectory_dataset(run.simulate(), title="own", scenario=dump(scenario), seed=0)
    assert list(dataset["attitude_sensor"].values) == [
        "star_tracker",
        "magnetometer",
        "sun_sensor",
    ]
    np.testing.assert_array_equal(dataset["sensor_excluded"][-1], [1, 0, 0])
    excluded = float(dataset["time"][int(np.argmax(dataset["sensor_excluded"].values[:, 0]))])
    assert 201 < excluded < 205
    error = np.abs(dataset["attitude_estimate_error"].values)
    assert np.all(error[-400:] < 5 / 3 * dataset["attitude_estimate_3sigma"].values[-400:])
    assert float(dataset["pointing_error_total"][400:].max()) < 0.1
    sentences = run_document(dataset).verdict.more
    assert "Star tracker stuck at 200 s." in sentences
    assert f"Star tracker excluded at {excluded:g} s." in sentences
    (requirement,) = judgements(dataset)
    assert requirement.margin > 0


ACTUATORS = """
import jax.numpy as jnp

from jaxsat import AbstractSmoothActuators, PartDeclaration


class Weak(AbstractSmoothActuators):
    declaration = PartDeclaration(summary="actuators that make less", keys=())

    @classmethod
    def from_table(cls, values, context):
        return cls()

    def __call__(self, command):
        return 0.9 * command
"""


def test_sensors_fail_beside_actuators_of_ones_own(tmp_path, monkeypatch):
    """Their own failures are refused: jaxsat does not know how they fail."""
    (tmp_path / "weak_actuators.py").write_text(ACTUATORS, encoding="utf-8")
    base = BASE[: BASE.index("[[wheel]]")] + BASE[BASE.index("[initial]") :]
    inertia = "inertia_kg_m2 = [0.30, 0.55, 0.62]\n"
    torques = "thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\ntorque_limit_N_m = 0.01\n"
    base = base.replace(inertia, inertia + torques)
    base += '[actuators]\nkind = "weak_actuators:Weak"\n'
    path = tmp_path / "own.toml"
    path.write_text(base + SENSORS + TEST + failure(), encoding="utf-8")
    run: Any = build(load(path))
    np.testing.assert_array_equal(run.loop.navigation.failures.at, [2])
    path.write_text(base + SENSORS + TEST + failure() + failure("thruster 1", "dead"), "utf-8")
    with pytest.raises(ScenarioError) as caught:
        load(path)
    (problem,) = caught.value.problems
    assert problem.key == "failure.of"
    told = 'must be a sensor with actuators.kind = "weak_actuators:Weak", got "thruster 1"'
    assert told in problem.message


@pytest.mark.slow
def test_a_study_counts_rejections_and_exclusions(tmp_path):
    """Of every case and sensor: in the store, the table of cases, and the summary."""
    scenario = loaded(
        tmp_path, TEST + failure() + DRAWN, ["simulation.duration_s=20"], purpose="study"
    )
    study = build_study(scenario, 3, engine="native")
    run_study(study, tmp_path / "s.zarr")
    found = open_study(tmp_path / "s.zarr")
    assert list(found["attitude_sensor"].values) == ["star_tracker", "magnetometer", "sun_sensor"]
    histories = study.engine.histories(study.program, study.cases(np.arange(3)))
    last = np.asarray(histories.parts["sensor_excluded"])[:, -1]
    np.testing.assert_array_equal(found["sensor_exclusions"], last)
    np.testing.assert_array_equal(found["sensor_exclusions"][:, 0], [1, 1, 1])
    np.testing.assert_array_equal(found["rejected_readings"][:, 0], [5, 5, 5])
    diffrax = build_study(scenario, 3, engine="diffrax").evaluate(np.arange(3))
    np.testing.assert_array_equal(found["rejected_readings"], diffrax.parts["rejected_readings"])
    table = case_table(found)
    assert list(table["sensor_exclusions_star_tracker"]) == [1, 1, 1]
    plain: Any = {name: found[name].values for name in found.data_vars}
    for columns in (found, plain):
        blocks = study_document(summarise(columns), {}).blocks
        sensors: Any
        (sensors,) = [one for one in blocks if one.title == "Sensors of the attitude"]
        name, rejected, fraction = sensors.rows[0]
        assert name == ("star tracker" if columns is found else "1")
        assert rejected == 15
        assert fraction.text.startswith("100.00%")


def test_tachometers_fail_under_sampled_laws_alone():
    wheel = "wheel=[{axis=[0,0,1],torque_limit_N_m=0.1}]"
    failing = 'failure=[{of="tachometer 1",at_s=3,kind="stuck"}]'
    with pytest.raises(ScenarioError, match='must not be a tachometer under the law "three-axis"'):
        load("paper-three-axis", [wheel, failing])
