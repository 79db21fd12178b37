"""Flight code of a filter with a magnetometer and a horizon sensor, without a star tracker."""

import subprocess
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.control.navigation.estimator import Measurement
from jaxsat.flight import vectors
from jaxsat.flight.external import Library, with_library
from jaxsat.flight.files import export
from jaxsat.flight.measurements import vectors_of
from jaxsat.flight.request import Request
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.vector_sensors import Observation
from tests.flight.folders import write_files
from tests.flight.sizes import too_large

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}

SENSORS = [
    "gyro={noise_density_rad_s_sqrt_Hz=1e-5, bias_walk_rad_s2_sqrt_Hz=1e-8, bias_sigma_rad_s=1e-5}",
    "orbit.inclination_deg=97",
    "magnetometer={noise_T=1e-7, update_period_s=0.5, latency_s=0.1}",
    "horizon_sensor={noise_rad=1e-3}",
]


@pytest.fixture(scope="module")
def run() -> Any:
    return build(load("switching", SENSORS))


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch):
    monkeypatch.setattr(vectors, "SAMPLES", 50)
    monkeypatch.setattr(vectors, "CASES", 2)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])


def _made(folder, run, *targets: str, single: bool = False):
    """The files of an export in a folder, with these targets made."""
    made = export(Request(run.loop, run.start, 5.0, "", "", PROVENANCE, single=single))
    write_files(folder, made.files)
    command = ["make", *targets, "CC=gcc", "CFLAGS=-O1"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return made, done.stdout


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True])
def test_vectors_agree_to_the_bit(tmp_path, run, single):
    """Samples, calls and a recorded flight, which begins at the scenario's attitude."""
    made, told = _made(tmp_path, run, "test", "fly", single=single)
    assert told.count(" 0 numbers differ") == 2
    assert too_large(made.files) == {}
    q = np.asarray(run.start.attitude.as_quaternion().q, np.float32 if single else float)
    task = made.files["freertos_task.c"].decode()
    numbers = task.split("attitude[4] = {")[1].split("}")[0].split(", ")
    np.testing.assert_array_equal(np.array([x.rstrip("F") for x in numbers], q.dtype), q)
    text = made.files["icd.csv"].decode()
    assert "magnetometer_reference,magnetometer.reference" in text
    assert "horizon_sensor_seen,horizon_sensor.seen,bool" in text


@needs("gcc")
@pytest.mark.slow
def test_the_library_takes_vectors_in_the_place_of_the_estimator(tmp_path, run):
    """For three cases at once, seen and unseen, as the filter itself."""
    _made(tmp_path, run, "build/libcontroller.so")
    assert vectors_of(run.loop) == ["magnetometer", "horizon_sensor"]
    library = Library(tmp_path / "build" / "libcontroller.so", run.loop, run.start)
    inside = run.loop.navigation.estimator
    outside: Any = with_library(run.loop, library).navigation.estimator
    q = run.start.attitude.as_quaternion()
    memory = jax.tree.map(lambda x: jnp.stack([x] * 3), inside.init(q, jnp.array(0.01)))
    key, period = jax.random.key(0), jnp.array(0.1)
    for sample in range(4):
        draws = jax.random.normal(jax.random.fold_in(key, sample), (5, 3, 3))
        seen = [jnp.array([True, False, True]), jnp.array([sample == 1, True, True])]
        observations = tuple(
            Observation(draws[2 * i + 1], draws[2 * i + 2], one) for i, one in enumerate(seen)
        )
        measurement = Measurement(0.01 * draws[0], None, None, observations)

        def step(estimator, measurement, memory, sample=sample):
            return estimator.step(jnp.int32(sample), period, measurement, memory)

        wanted, following = jax.vmap(lambda *x: step(inside, *x))(measurement, memory)
        found = jax.jit(jax.vmap(lambda *x: step(outside, *x)))(measurement, memory)
        pairs = ((found[0].attitude.q, wanted.attitude.q), (found[0].omega, wanted.omega))
        for one, other in (*pairs, *zip(*map(jax.tree.leaves, (found[1], following)), strict=True)):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
        memory = following
