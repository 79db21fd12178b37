"""Whole pulses of thrusters: what they owe together stays small."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.thruster_layouts import canted
from jaxsat.control.pulse_rounding import PulseRounding
from jaxsat.spacecraft.modulation import DeltaSigma

MOMENTS = np.array([0.30, 0.55, 0.62])
EFFECT = canted()[0] / MOMENTS[:, None]
PERIOD, LEAST = 0.1, 0.02
SOUND = jnp.ones(8)


@pytest.mark.slow
def test_the_rate_owed_is_below_a_pulse_however_long_it_goes_on():
    """Three thrusters that each owe up to a pulse of their own would owe up to three together."""
    rounded = eqx.filter_jit(PulseRounding(EFFECT, np.full(8, LEAST)))
    rng = np.random.default_rng(2)
    pulse = np.linalg.norm(EFFECT * LEAST, axis=0).max()
    duty = np.where(rng.random(8) < 0.4, rng.random(8), 0.0)
    inverse = np.linalg.pinv(EFFECT)
    owed, worst, given = np.zeros(3), [], []
    for _ in range(400):
        want = duty + inverse @ owed / PERIOD  # which may be negative: others then make it
        want = np.clip(want, 0.0, 1.0)
        owed = owed - PERIOD * EFFECT @ (want - duty)
        now = np.asarray(rounded(SOUND, jnp.asarray(want), jnp.array(PERIOD)))
        np.testing.assert_allclose(now * PERIOD / LEAST, np.round(now * PERIOD / LEAST), atol=1e-9)
        owed = owed + PERIOD * EFFECT @ (want - now)
        worst.append(np.linalg.norm(owed))
        given.append(now)
    assert max(worst) < 1.3 * pulse
    drift = EFFECT @ (np.mean(given, axis=0) - duty)
    assert np.linalg.norm(drift) < 2 * pulse / (400 * PERIOD)


@pytest.mark.slow
def test_any_width_passes_and_failed_thrusters_give_none():
    duty = jnp.asarray(np.linspace(0.03, 0.9, 8))
    free = PulseRounding(EFFECT, np.zeros(8))
    np.testing.assert_array_equal(free(SOUND, duty, jnp.array(PERIOD)), duty)
    failed = jnp.arange(8) == 4
    whole = PulseRounding(EFFECT, np.full(8, LEAST))
    limit = jnp.where(failed, 0.0, 1.0)
    assert whole(limit, jnp.where(failed, 0.0, duty), jnp.array(PERIOD))[4] == 0


def test_thrusters_that_hardly_have_torque_to_spare_make_all_of_it_on_average():
    """Three that oppose a fourth at 0.94 to 0.98 of their thrust: duties cannot take up what is
    owed, and pulses do."""
    columns = canted()[0][:, [1, 2, 4]]
    effect = columns / MOMENTS[:, None]
    rounded = eqx.filter_jit(PulseRounding(effect, np.full(3, LEAST)))
    duty, inverse = np.array([0.9408, 0.9753, 0.9809]), np.linalg.inv(effect)
    owed, given, worst = np.zeros(3), [], 0.0
    for _ in range(300):
        more = inverse @ owed / PERIOD
        room = np.where(more > 0, 1 - duty, duty) / np.abs(np.where(more == 0, 1e-9, more))
        fits = min(1.0, room.min())
        besides = (1 - fits) * owed
        want = duty + fits * more
        now = rounded(jnp.ones(3), jnp.asarray(want), jnp.array(PERIOD), jnp.asarray(besides))
        owed = besides + PERIOD * effect @ (want - np.asarray(now))
        worst = max(worst, np.linalg.norm(owed))
        given.append(now)
    pulse = np.linalg.norm(effect * LEAST, axis=0).max()
    assert worst < 1.3 * pulse
    drift = effect @ (np.mean(given, axis=0) - duty)
    assert np.linalg.norm(drift) < 2 * pulse / (300 * PERIOD)


def test_a_thruster_can_push_all_the_period_long_where_pulses_do_not_fill_it():
    """Of 0.25 s pulses of 0.02 s fill 0.24 s: a duty of 0.99 comes as one of 0.96 or of 1."""
    rounded = eqx.filter_jit(PulseRounding(EFFECT, np.full(8, LEAST)))
    modulate, memory = DeltaSigma(), jnp.zeros(8)
    period, only = 0.25, np.arange(8) == 3
    given, owed = [], 0.0
    for _ in range(200):
        duty = rounded(SOUND, jnp.asarray(only * min(0.99 + owed, 1.0)), jnp.array(period))
        owed += 0.99 - float(duty[3])
        pulses, memory = modulate(duty, memory, period, np.full(8, LEAST))
        given.append(float((pulses.off - pulses.on)[0, 3]) / period)
        assert np.min(np.abs(given[-1] - np.array([0.96, 1.0]))) < 1e-12
    assert np.mean(given) == pytest.approx(0.99, abs=0.04 / 200)
