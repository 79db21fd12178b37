"""Metrics on histories whose answers are plain to see."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.metrics import Tolerances, effort, settling_time, within, wrapped

TIMES = jnp.linspace(0.0, 10.0, 11)


@pytest.mark.parametrize(
    ("bad", "expected"),
    [
        ([], 0.0),
        ([0, 1, 2], 3.0),
        ([4], 5.0),
        ([8], 9.0),
        ([9], np.inf),  # only just inside: begins after 0.9 of the horizon
        ([10], np.inf),
        (list(range(11)), np.inf),
    ],
)
def test_settling_time(bad, expected):
    good = jnp.ones(11, bool).at[jnp.array(bad, int)].set(False)
    assert settling_time(TIMES, good) == expected


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
    np.testing.assert_allclose(wrapped(angles), expected, atol=1e-15)


def test_effort_is_the_integral_of_the_torques():
    torque = jnp.stack([jnp.sin(TIMES), -TIMES, 0 * TIMES], axis=1)
    exact = np.trapezoid(np.abs(np.sin(np.array(TIMES))), TIMES) + 50.0
    np.testing.assert_allclose(effort(TIMES, torque), exact, rtol=1e-14)
