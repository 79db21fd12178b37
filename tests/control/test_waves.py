"""Flat-topped waves: closed forms against SciPy's quadrature, and the end game that makes them."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import jaxsat
from control.cases import body
from control.test_oscillatory import known
from jaxsat.control.drift_holds import balancing
from jaxsat.control.normal_form import NormalState, tilt_of
from jaxsat.control.oscillatory import SINE, FlatTop, Slow, twice_mean_square, wave_at
from jaxsat.control.presets import BALANCED, three_slew_settling
from jaxsat.core.attitude import WZ

ROUNDNESSES = (0.125, 0.4, SINE)
PHASES = np.linspace(-3.1, 3.1, 7)


def wave(phase, roundness):
    return wave_at(jnp.sin(phase), jnp.cos(phase), roundness)


def value(phase, q):
    return np.sin(np.arctan2(np.sin(phase), q * np.cos(phase)))


@pytest.mark.parametrize("q", ROUNDNESSES)
def test_closed_forms_are_the_integrals_of_the_wave(q):
    ends = {"limit": 200, "points": [0.0], "epsabs": 1e-12}
    mean = quad(lambda x: value(x, q) ** 2, -np.pi, np.pi, **ends)[0] / (2 * np.pi)
    assert float(twice_mean_square(jnp.array(q))) == pytest.approx(2 * mean, rel=1e-9)
    begin = wave(-np.pi / 2, jnp.array(q))
    for phase in PHASES:
        found = wave(phase, jnp.array(q))
        assert float(found.value) == pytest.approx(value(phase, q), abs=1e-12)
        slope = (value(phase + 1e-6, q) - value(phase - 1e-6, q)) / 2e-6
        assert float(found.slope) == pytest.approx(slope, abs=1e-7)
        for name, change in (
            ("fall", lambda x: -value(x, q)),
            ("ripple", lambda x: value(x, q) ** 2 - mean),
        ):
            exact = quad(change, -np.pi / 2, phase, limit=200, epsabs=1e-12)[0]
            moved = float(getattr(found, name) - getattr(begin, name))
            assert moved == pytest.approx(exact, abs=1e-8)
    for name in ("fall", "ripple"):
        mean_of = [float(getattr(wave(x, jnp.array(q)), name)) for x in (0.7, 0.7 + np.pi)]
        sign = -1 if name == "fall" else 1
        assert mean_of[1] == pytest.approx(sign * mean_of[0], abs=1e-9)
    ripples = jax.vmap(lambda x: wave(x, jnp.array(q)).ripple)(np.linspace(0, np.pi, 1001)[:-1])
    assert float(jnp.mean(ripples)) == pytest.approx(0, abs=1e-9)


def test_a_round_wave_is_a_sine():
    for phase in PHASES:
        np.testing.assert_allclose(wave(phase, jnp.array(SINE)), wave(phase, None), atol=2e-6)


@pytest.mark.parametrize("q", ROUNDNESSES)
def test_derivatives_are_finite_and_those_of_central_differences(q):
    @jax.jit
    def all_of(phase, q):
        return jnp.stack(wave(phase, q))

    by_phase, by_q = (jax.jit(jax.jacfwd(all_of, i)) for i in (0, 1))
    for phase in (0.0, np.pi / 2, *PHASES):
        step = 1e-6 if q < 0.9 else 1e-7
        ahead, behind = all_of(phase, q + step), all_of(phase, q - step)
        np.testing.assert_allclose(by_q(phase, q), (ahead - behind) / 2 / step, atol=2e-3)
        ahead, behind = all_of(phase + 1e-6, q), all_of(phase - 1e-6, q)
        np.testing.assert_allclose(by_phase(phase, q), (ahead - behind) / 2e-6, atol=1e-4)


def test_a_wave_is_as_flat_as_torques_and_periods_make_it():
    """Its steepest change takes the acceleration, or more than two control periods."""
    rate, frequency = 5e-4, 0.1
    phase = np.linspace(0, 2 * np.pi, 20001)

    def roundness(acceleration, period):
        return float(FlatTop(acceleration, period).roundness(jnp.array(rate), jnp.array(frequency)))

    for acceleration in (1e-4, 2.5e-4):
        q = roundness(acceleration, 0.1)
        steepest = rate * frequency * np.abs(np.gradient(value(phase, q), phase)).max()
        assert steepest == pytest.approx(acceleration, rel=1e-3)
    assert roundness(1.0, 0.1) == 1 / 8
    assert roundness(1e-9, 0.1) == SINE
    q = roundness(1.0, 2.0)
    from_end_to_end = 2 * q / frequency  # at the steepest slope
    assert from_end_to_end > 2 * 2.0


@pytest.mark.parametrize("acceleration", [None, 6e-4, 1e-9])
def test_the_end_game_stops_the_drift_that_is_told_within_its_amplitude(acceleration):
    """The tilt under the rates that the law tracks by SciPy: their mean product over a period.

    At the most c times it is ds/dt, and both rates together never exceed √2 of the amplitude.
    """
    law = balancing(three_slew_settling(body(), 5.0, gravity_gradient=True), 1e-3)
    stage = law.fine
    if acceleration is not None:
        flat_top = dataclasses.replace(stage.flat_top, acceleration=jnp.array(acceleration))
        stage = dataclasses.replace(stage, flat_top=flat_top)
    game, c = stage.end_game, float(law.form.coupling)
    third = known(jnp.zeros(()), law.form)
    motion = game.oscillation(Slow(jnp.zeros(()), jnp.array(-1.0)), third)
    frame = law.form.orbit_rate

    @jax.jit
    def rates(t, angles):
        state = NormalState(WZ(angles / 2, 0.0).as_quaternion(), frame, frame)
        tilt = tilt_of(state.attitude)._replace(phi=angles[0], theta=angles[1])
        return game.tracking(t, state, tilt, motion).rate - frame[:2]

    period = 2 * np.pi / float(game.frequency)
    times = np.linspace(11, 12, 2001) * period
    tilts = solve_ivp(
        rates,
        (0, times[-1]),
        np.zeros(2),
        t_eval=times,
        rtol=1e-9,
        atol=1e-12,
        max_step=period / 50,
    ).y
    found = np.array(jax.vmap(rates)(times[:-1], tilts.T[:-1]))
    change = c * np.mean(found[:, 0] * found[:, 1])
    assert change == pytest.approx(float(stage.largest_change(law.form.coupling)), rel=1e-4)
    amplitude = float(stage.holding_amplitude)
    assert np.linalg.norm(found, axis=1).max() == pytest.approx(np.sqrt(2) * amplitude, rel=1e-4)
    by_sines = c * amplitude**2 / 2
    assert change > by_sines * {None: 1.7, 6e-4: 1.3, 1e-9: 0.999}[acceleration]


def test_only_a_law_that_balances_drifts_has_flat_tops():
    sines = three_slew_settling(body(), 5.0, gravity_gradient=True)
    flat = balancing(sines, 1e-3)
    assert sines.fine.roundness is None
    share = float(twice_mean_square(flat.fine.roundness))
    assert float(flat.estimator.balanced) == pytest.approx(share * float(sines.estimator.balanced))
    before, after = (eqx.filter(one.fine.oscillator, eqx.is_array) for one in (sines, flat))
    assert all(map(np.array_equal, jax.tree.leaves(before), jax.tree.leaves(after)))


@pytest.mark.parametrize("frequency", [None, 1.0])
def test_drift_that_a_set_frequency_balances_moves_no_attitude(tmp_path, frequency):
    """At 1 rad/s waves are rounder than at the frequency of the gains, and balance less."""
    path = tmp_path / "case.toml"
    own = "" if frequency is None else f"frequency_rad_s = {frequency}"
    path.write_text(
        f"""
title = "A body in a low orbit"
[spacecraft]
inertia_kg_m2 = [60, 40, 50]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]
torque_limit_N_m = 1.0
[orbit]
altitude_km = 600
[disturbance]
gravity_gradient = true
[initial]
w = [0, 0]
z_rad = 0
omega_rad_s = [0.01, 0, 0]
[simulation]
duration_s = 100
[control]
law = "three-slew"
{own}
"""
    )
    law = jaxsat.build(jaxsat.load(path)).loop.controller
    assert (float(law.fine.roundness) > 0.14) == (frequency is not None)
    largest = float(law.fine.largest_change(law.form.coupling))
    assert float(law.estimator.balanced) == pytest.approx(BALANCED * largest, rel=1e-12)
