"""Loops without a gyro: what the filter is told of torques, engines, and a study's errors."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from control.navigation.test_filter import within_band
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.errors import ScenarioWarning

WHEELS = """
title = "Test"
[spacecraft]
inertia_kg_m2 = [10, 12, 8]
[orbit]
altitude_km = 500
[disturbance]
gravity_gradient = true
[[wheel]]
axis = [1, 0, 0]
torque_limit_N_m = 0.05
tachometer_noise_N_m_s = 1e-4
[[wheel]]
axis = [0, 1, 0]
torque_limit_N_m = 0.05
viscous_friction_N_m_s = 1e-5
rotor_inertia_kg_m2 = 1e-3
momentum_N_m_s = 0.1
tachometer_noise_N_m_s = 1e-4
[[wheel]]
axis = [0, 0, 1]
torque_limit_N_m = 0.05
tachometer_noise_N_m_s = 1e-4
"""
THRUSTERS = """
title = "Test"
[spacecraft]
inertia_kg_m2 = [10, 12, 8]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
torque_limit_N_m = 0.05
[orbit]
altitude_km = 500
[disturbance]
gravity_gradient = true
"""
REST = """
[initial]
quaternion = [1, 0, 0, 0]
omega_rad_s = [0.001, -0.002, 0.0015]
[control]
law = "quaternion-feedback"
period_s = 0.5
natural_frequency_rad_s = 0.1
[simulation]
duration_s = 120
[star_tracker]
across_arcsec = 5
along_arcsec = 25
update_period_s = 1
latency_s = 0.5
[estimator]
rate_sigma_rad_s = 0.002
torque_noise_N_m_sqrt_Hz = 1e-5
torque_sigma_N_m = 1e-3
"""
STUDY = """
[dispersion.constant_torque_N_m]
distribution = "normal"
mean = [0.0, 0.0, 0.0]
sigma = [1e-3, 1e-3, 1e-3]
[dispersion.omega_rad_s]
distribution = "normal"
mean = [0.0, -0.0011, 0.0]
sigma = [0.002, 0.002, 0.002]
"""


def loaded(folder, text, changes=(), **others):
    path = folder / "own.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, changes, **others)


def walked(loop, start, count):
    """States after 0 to `count` periods of a sampled loop, in steps of Runge-Kutta."""

    def step(t, hold, plant, carry):
        del carry
        return plant, None

    @eqx.filter_jit
    def period(loop, number, state):
        return loop.period(number, number * loop.controller.period, state, step, None)[0]

    states = [loop.start(start)]
    for number in range(count):
        states.append(period(loop, jnp.array(number), states[-1]))
    return states


@pytest.mark.slow
def test_the_filter_is_told_the_commanded_torque_whatever_fails(tmp_path):
    """The mean over a period, with the delay; a dead thruster still counts as if it worked."""
    failure = "[[failure]]\nof = 'thruster 1'\nat_s = 0\nkind = 'dead'\n[sampling]\ndelay_s = 0.2\n"
    run: Any = build(loaded(tmp_path, THRUSTERS + REST + failure))
    states = walked(run.loop, run.start, 3)
    np.testing.assert_array_equal(states[0].navigation.torque, 0)
    limit = 0.05
    uses = [np.clip(state.uses[0], -limit, limit) for state in states]
    assert np.abs(uses[1]).min() > 0
    for before, after, state in zip(uses, uses[1:], states[1:], strict=False):
        np.testing.assert_allclose(state.navigation.torque, 0.4 * before + 0.6 * after, rtol=1e-12)


@pytest.mark.slow
def test_the_filter_is_told_no_torque_of_wheels_but_their_momentum(tmp_path):
    run: Any = build(loaded(tmp_path, WHEELS + REST))
    states = walked(run.loop, run.start, 2)
    np.testing.assert_array_equal(states[2].navigation.torque, 0)
    found = states[1].navigation.memory.momenta
    assert np.abs(np.asarray(found[-1]) - [0, 0.1, 0]).max() < 6e-4
    assert np.abs(np.asarray(found[-1]) - [0, 0.1, 0]).max() > 1e-6  # the noise


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [THRUSTERS, WHEELS], ids=["thrusters", "wheels"])
def test_engines_agree_and_errors_are_as_large_as_claimed(vehicle, tmp_path):
    """64 unknown constant torques and first rates, and χ² at the end; torques have no noise."""
    changes = ["simulation.duration_s=60", "estimator.torque_noise_N_m_sqrt_Hz=1e-8"]
    scenario = loaded(tmp_path, vehicle + REST + STUDY, changes, purpose="study")
    numbers = np.arange(4)
    native, scan = (
        build_study(scenario, 4, engine=engine, batch_size=4).evaluate(numbers)
        for engine in ("native", "scan")
    )
    np.testing.assert_allclose(native.omega, scan.omega, atol=1e-9)
    study = build_study(scenario, 64, engine="native")
    squares = []
    for number in range(64):
        parts = study.replay(number).signals.parts
        errors = (
            3 * parts[f"{name}_estimate_error"][-1] / parts[f"{name}_estimate_3sigma"][-1]
            for name in ("attitude", "rate")
        )
        squares.append([np.sum(np.asarray(error) ** 2) for error in errors])
    assert within_band(np.array(squares)[:, 0], 3)
    assert within_band(np.array(squares)[:, 1], 3)


def test_what_the_filter_does_not_expect_is_told(tmp_path):
    quiet = REST.replace("torque_sigma_N_m = 1e-3\n", "")
    with pytest.warns(ScenarioWarning, match=r"torque_sigma_N_m: should be given.*constant_N_m"):
        loaded(tmp_path, THRUSTERS + quiet, ["disturbance.constant_N_m=[1e-3, 0, 0]"])
    failure = "[[failure]]\nof = 'thruster 1'\nat_s = 10\nkind = 'dead'\n"
    with pytest.warns(ScenarioWarning, match="here that of the failed thruster 1"):
        loaded(tmp_path, THRUSTERS + quiet + failure)
    with pytest.warns(ScenarioWarning, match="a fifth of the first rate.*0.2 rad/s"):
        loaded(tmp_path, THRUSTERS + REST, ["initial.omega_rad_s=[0.2, 0, 0]"])
    loaded(tmp_path, THRUSTERS + quiet)
