"""Sampled laws on estimates: signals, file, engines, and manoeuvres that settle."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from control.navigation.motion import attitude_errors
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.store.dataset import open_trajectory, trajectory_dataset
from jaxsat.store.files import save_file
from jaxsat.store.netcdf import dataset_bytes
from simulation.engine.examples import KICKS, estimated_example, program

SENSORS = [
    "gyro.noise_density_rad_s_sqrt_Hz=1.5e-5",
    "gyro.bias_walk_rad_s2_sqrt_Hz=3e-8",
    "gyro.bias_sigma_rad_s=2e-5",
    "star_tracker.across_rad=2.4e-5",
    "star_tracker.along_rad=1.2e-4",
    "star_tracker.boresight=[0, 0.6, 0.8]",
    "star_tracker.update_period_s=0.5",
    "star_tracker.latency_s=0.2",
]
"""Those of a small spacecraft: 0.05 °/√h, 5 and 25 arc seconds."""

NAMES = [
    f"{name}_estimate_{what}"
    for name in ("attitude", "rate", "bias")
    for what in ("error", "3sigma")
]


def built(duration, *overrides):
    return build(load("switching", [f"simulation.duration_s={duration}", *SENSORS, *overrides]))


@pytest.mark.slow
def test_a_law_is_told_the_estimate_and_the_signals_tell_how_far_off_it_is():
    run = built(2, "simulation.attitude=wz")
    zero = jnp.array(0)

    @eqx.filter_jit
    def sample(loop, state):
        return loop.law_input(zero, state), loop.signals(zero, zero * 0.1, state)

    state = eqx.filter_jit(lambda loop, start: loop.start(start))(run.loop, run.start)
    told, signals = sample(run.loop, state)
    true, believed = (
        np.asarray(part.attitude.as_quaternion().q) for part in (run.start, told.state)
    )
    assert abs(told.state.attitude.z - run.start.attitude.z) < 0.1  # wound up as the truth is
    error = attitude_errors(true, believed)
    assert 1e-3 < np.abs(error).max() < 0.05  # the draw
    np.testing.assert_allclose(signals.parts["attitude_estimate_error"], error, atol=1e-12)
    np.testing.assert_allclose(signals.parts["attitude_estimate_3sigma"], 0.03, rtol=1e-12)
    rate = run.start.omega - told.state.omega
    np.testing.assert_array_equal(signals.parts["rate_estimate_error"], rate)
    np.testing.assert_allclose(signals.parts["bias_estimate_3sigma"], 6e-5, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_errors_and_what_is_claimed_of_them_reach_the_file(tmp_path):
    trajectory = built(20).simulate()
    save_file(tmp_path / "run.nc", dataset_bytes(trajectory_dataset(trajectory)))
    found = open_trajectory(tmp_path / "run.nc")
    for name in NAMES:
        np.testing.assert_array_equal(found[name], trajectory.signals.parts[name])
        assert found[name].attrs["units"] == ("rad" if "attitude" in name else "rad s-1")
    share = found["attitude_estimate_error"] / found["attitude_estimate_3sigma"]
    assert 0.15 < float(np.sqrt((share**2).mean())) < 0.6


@pytest.mark.slow
def test_without_an_estimator_there_is_an_error_and_no_claim():
    signals = built(4, "estimator.kind=none").simulate().signals
    off = np.linalg.norm(signals.parts["attitude_estimate_error"][3:], axis=1)
    turned = 0.7 * np.linalg.norm(signals.relative_rate, axis=1).max()
    assert 1e-3 < off.max() < turned  # up to 0.6 s old
    for name in NAMES:
        there = name in ("attitude_estimate_error", "rate_estimate_error")
        assert (name in signals.parts) == there


@pytest.mark.slow
def test_all_engines_agree():
    """Steps of diffrax, of XLA and in machine code; the last two also on the estimates' errors."""
    example = estimated_example()
    prog, engines = program(example), (example.reference, example.scan, NativeEngine())
    reference, scan, native = (engine.evaluate(prog, KICKS[:5]) for engine in engines)
    for outputs in (scan, native):
        for name in ("w", "z", "quaternion", "omega", "cost", "effort", "peak_rate"):
            expected = getattr(reference, name)
            tolerance = 1e-9 * np.abs(expected).max()
            np.testing.assert_allclose(getattr(outputs, name), expected, atol=tolerance)
    replays = [engine.replay(prog, KICKS[2]).signals for engine in engines[1:]]
    for name in NAMES:
        one, other = (signals.parts[name] for signals in replays)
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(one).max())


@pytest.mark.slow
def test_the_three_slews_settle_on_estimates():
    """Random tumbles, dispersed and disturbed as the laws are compared."""
    perfect = ["sampling.rate_noise_rad_s=0", "sampling.attitude_noise_rad=0"]
    scenario = load("acceptance-mc", ["simulation.duration_s=300", *perfect, *SENSORS])
    outputs = build_study(scenario, 32, engine="native").evaluate(np.arange(32))
    assert np.all(outputs.code == 0)
    assert np.all(outputs.settling_time < 200)
