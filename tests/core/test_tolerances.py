"""Metrics on histories whose answers are plain to see."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.tolerances import SettlingTracker, Tolerances, within, wrap_angle

TIMES = jnp.linspace(0.0, 10.0, 11)


@pytest.mark.parametrize(
    ("bad", "expected"),
    [
        ([], 0.0),
        ([0, 1, 2], 2.75),  # from 3 outside to 1 inside: three quarters of the way
        ([4], 4.75),
        ([8], 8.75),
        ([9], np.inf),  # only just inside: begins after 0.9 of the horizon
        ([10], np.inf),
        (list(range(11)), np.inf),
    ],
)
def test_since(bad, expected):
    since = SettlingTracker.initial(TIMES[0], 2)
    for number, time in enumerate(TIMES):
        outside = 3.0 if number in bad else -1.0
        since = since.observe(time, jnp.array([outside, -0.5]))
    assert since.settling_time(TIMES[-1]) == expected


def test_since_waits_for_the_last_condition_and_takes_no_nan():
    since = SettlingTracker.initial(jnp.array(0.0), 2).observe(
        jnp.array(0.0), jnp.array([1.0, 1.0])
    )
    inside = since.observe(jnp.array(1.0), jnp.array([-1.0, -3.0]))
    assert inside.start == 0.5
    assert inside.observe(jnp.array(2.0), jnp.array([-1.0, jnp.nan])).start == jnp.inf


def test_within_asks_for_everything_and_takes_no_nan():
    small = jnp.full((5, 2), 0.01), jnp.full(5, 0.01), jnp.full((5, 3), 1e-4)
    w, z, rate = small
    w = w.at[1, 0].set(0.06)
    z = z.at[2].set(2 * jnp.pi + 0.01).at[4].set(jnp.nan)
    rate = rate.at[3, 1].set(2e-3)
    np.testing.assert_array_equal(
        within(w, z, rate, Tolerances()), [True, False, True, False, False]
    )


def test_wrapped():
    angles = jnp.array([0.0, 3.0, -3.0, 3.2, 2 * jnp.pi, -7.0])
    expected = np.angle(np.exp(1j * np.array(angles)))
    np.testing.assert_allclose(wrap_angle(angles), expected, atol=1e-15)
