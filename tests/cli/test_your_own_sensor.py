"""The sensors of docs/your-own-sensor.md, done as it says, and what is said of one that is none."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.core import process
from jaxsat.flight.files import export
from jaxsat.flight.request import Request
from jaxsat.report.results import fly
from jaxsat.scenario import ScenarioError, dump, plugins
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.read import library
from tests.flight.folders import write_files

TEXT = (Path(__file__).parents[2] / "docs" / "your-own-sensor.md").read_text(encoding="utf-8")
MODULE = "\n\n".join(re.findall(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL))
(TABLES,) = [
    one
    for one in re.findall(r"^```toml\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
    if "[sensor." in one
]
MORE = """

class Sun(AbstractSensedVector):
    declaration = VectorDeclaration(summary="the Sun once more")
    sunlight: AbstractSensedVector

    @classmethod
    def from_table(cls, values, context):
        return cls(context.sunlight)

    def __call__(self, t):
        return self.sunlight(t)


class Flat(Sun):
    def __call__(self, t):
        return self.sunlight(t)[0][:2], 1.0


class Bare(Sun):
    def __call__(self, t):
        return self.sunlight(t)[0]


class Broken(Sun):
    def __call__(self, t):
        return jnp.zeros(2) @ jnp.zeros(3)


class Bent(Sun):
    def distorted(self, t, vector):
        return vector @ vector
"""
OTHERS = """
[gyro]
noise_density_rad_s_sqrt_Hz = 1e-5
bias_sigma_rad_s = 1e-5

[magnetometer]
noise_nT = 100
"""
PLACE = ["orbit.inclination_deg=97", "orbit.argument_of_latitude_deg=65"]


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A scenario of the library with the page's sensor and a magnetometer, beside the module."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    (tmp_path / "beacons.py").write_text(MODULE + MORE, encoding="utf-8")
    path = tmp_path / "own.toml"
    kept = library()["switching"].read_text(encoding="utf-8")
    path.write_text(f"{kept}\n{OTHERS}\n{TABLES}", encoding="utf-8")
    yield path
    sys.modules.pop("beacons", None)


def refused(path, *overrides):
    with pytest.raises(ScenarioError) as caught:
        load(path, overrides)
    return str(caught.value)


def test_it_is_built_with_its_keys_and_dumped(own):
    scenario = load(own)
    navigation = build(scenario).loop.navigation
    assert [*navigation.sensors] == ["magnetometer", "kiruna", "gyro"]
    sensor = navigation.sensors["kiruna"]
    assert (sensor.every, sensor.latency, float(sensor.noise)) == (5, 0, np.deg2rad(0.1))
    assert sensor.reference.latitude == np.deg2rad(67.9)
    noises = [float(noise) for noise in navigation.estimator.vector_noise]
    assert noises == pytest.approx([1e-7, float(sensor.noise)], rel=1e-15)
    assert navigation.failures.number == 1
    own.write_text(dump(scenario), encoding="utf-8")
    assert load(own) == scenario


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("sensor.kiruna.kind=beacn", 'have the form "module:Class", got beacn'),
        ("sensor.kiruna.kind=beacons:Gone", "must name a class of beacons"),
        ("sensor.kiruna.kind=beacons:AbstractPlace", "a subclass of AbstractSensedVector"),
        ("sensor.kiruna.latitude_deg=120", "must be at most 1.6 rad, got 2.094395"),
        ("sensor.kiruna.latitud_deg=2", "did you mean latitude_deg"),
        ("sensor.kiruna.noise_T=1e-7", "noise_T: must be one of the keys of [sensor.kiruna]"),
        ("sensor.kiruna.latency_s=0.05", "must be a multiple of control.period_s"),
        ("sensor.kiruna.boresight=[0, 0, 0]", "must be a direction, got [0.0, 0.0, 0.0]"),
        ("sensor.kiruna.outage_s=5", "sensor.kiruna.outage_start_s: must be given"),
        ('sensor.magnetometer={kind="beacons:Sun", noise_rad=0.01}', "that no other sensor has"),
        ('sensor.gyro={kind="beacons:Sun", noise_rad=0.01}', "that no other sensor has, got gyro"),
        ('sensor."a b"={kind="beacons:Sun", noise_rad=0.01}', "of letters, digits and _"),
        ('sensor."größe"={kind="beacons:Sun", noise_rad=0.01}', "of letters, digits and _"),
        ('sensor.sun={kind="beacons:Flat", noise_rad=0.01}', "an array of shape (3,), a vector"),
        ('sensor.sun={kind="beacons:Bare", noise_rad=0.01}', "a vector and its visibility"),
        ('sensor.sun={kind="beacons:Broken", noise_rad=0.01}', "can be run, got TypeError"),
        ('sensor.sun={kind="beacons:Bent", noise_rad=0.01}', "shape (3,) from `distorted`"),
        ("failure=[{of='sensor kirna', at_s=2, kind='dead'}]", "did you mean sensor kiruna?"),
        (
            "failure=[{of='sensor kiruna', at_s=2, kind='reversed'}]",
            "drifting, spiking for a sensor",
        ),
        ("control.law=rate", "sensor: must belong to a sampled law"),
    ],
)
def test_what_is_no_sensor_is_refused(own, override, message):
    assert message in refused(own, override)


def test_an_installed_one_has_a_name(own, monkeypatch):
    from importlib.metadata import EntryPoint

    entry = EntryPoint("beacon", "beacons:Beacon", plugins.SENSOR.group)
    found = {plugins.SENSOR: {"beacon": entry}}
    monkeypatch.setattr(plugins, "installed", lambda kind: found.get(kind, {}))
    assert load(own)  # whose module is now known
    assert load(own, ["sensor.kiruna.kind=beacon"]).sensor["kiruna"].kind == "beacon"
    assert "did you mean beacon?" in refused(own, "sensor.kiruna.kind=becon")


def test_untested_readings_and_late_outages_are_cautioned_about(own):
    from jaxsat.scenario import ScenarioWarning

    late = ["sensor.kiruna.outage_start_s=1e6", "sensor.kiruna.outage_s=1", "estimator={}"]
    with pytest.warns(ScenarioWarning) as caught:
        load(own, late)
    text = "\n".join(str(one.message) for one in caught)
    assert "uses every reading of the failed sensor kiruna" in text
    assert "sensor.kiruna.outage_start_s: should be before simulation.duration_s" in text


@pytest.mark.slow
def test_a_copy_of_the_sun_sensor_flies_to_the_bit_as_that_of_jaxsat(own):
    """Under the same name, which selects its noise; a drift lets the filter exclude it."""
    keys = "noise_deg=0.1, update_period_s=0.2, latency_s=0.1, half_angle_deg=120, outage_start_s=2"
    keys += ", outage_s=1, misalignment_rad=[1e-4, 0, 0]"
    changes = ["simulation.duration_s=12", "estimator={false_alarm_probability=1e-4}", *PLACE]
    flights = []
    for of, table in (
        ("sun_sensor", f"sun_sensor={{{keys}}}"),
        ("sensor sun_sensor", f'sensor.sun_sensor={{kind="beacons:Sun", {keys}}}'),
    ):
        failure = f'failure=[{{of="{of}", at_s=6, kind="drifting", drift_rad_s=[0.1, 0.02, 0]}}]'
        path = own.with_name("one.toml")
        kept = library()["switching"].read_text(encoding="utf-8")
        path.write_text(f"{kept}\n{OTHERS}", encoding="utf-8")
        flights.append(fly(load(path, [*changes, table, failure])).dataset)
    built_in, copy = flights
    assert set(built_in) == set(copy)
    for name in built_in:
        np.testing.assert_array_equal(built_in[name], copy[name], err_msg=name)
    assert copy.attitude_sensor.values.tolist() == ["magnetometer", "sun_sensor"]
    assert copy.sensor_excluded.values[:, 1].max() == 1


@pytest.mark.slow
def test_studies_count_its_rejections_and_draw_its_noise(own):
    dispersion = 'dispersion.omega_rad_s={distribution="normal",mean=0.0,sigma=0.01}'
    more = ["simulation.duration_s=8", "estimator={false_alarm_probability=1e-4}", *PLACE]
    strike = 'of="sensor kiruna", at_s=4, kind="drifting", drift_rad_s=[0.1, 0.1, 0]'
    failing = [f"failure=[{{{strike}}}]"]
    scenario = load(own, [*more, *failing, dispersion], purpose="study")
    values = {
        engine: build_study(scenario, 3, engine=engine, batch_size=4).values(np.arange(3))
        for engine in ("native", "scan")
    }
    for name in ("omega", "rejected_readings", "sensor_exclusions"):
        np.testing.assert_allclose(values["native"][name], values["scan"][name], atol=1e-9)
    assert values["native"]["sensor_exclusions"].tolist() == [[0, 1]] * 3


@needs("gcc")
@pytest.mark.slow
def test_its_flight_code_agrees_to_the_bit(own, tmp_path, monkeypatch):
    monkeypatch.setattr("jaxsat.flight.vectors.SAMPLES", 50)
    monkeypatch.setattr("jaxsat.flight.vectors.CASES", 2)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])
    run = build(load(own, ["failure=[]", *PLACE]))
    origin = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}
    made = export(Request(run.loop, run.start, 5.0, "", "", origin))
    folder = tmp_path / "code"
    folder.mkdir()
    write_files(folder, made.files)
    command = ["make", "test", "fly", "CC=gcc", "CFLAGS=-O1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 0 numbers differ") == 2
    assert "kiruna_reference,kiruna.reference" in made.files["icd.csv"].decode()


def test_flight_code_has_no_names_of_its_own_twice(own):
    from jaxsat.flight.flight import CannotExport
    from jaxsat.flight.measurements import measured_example

    table = 'sensor={attitude={kind="beacons:Sun", noise_rad=0.01}}'
    run = build(load(own, ["failure=[]", table]))
    with pytest.raises(CannotExport, match=r"sensor.attitude: must have another name"):
        measured_example(run.loop, run.start)
