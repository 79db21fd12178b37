"""Trial dipoles of magnetorquers: torque-free while all work, within limits, none for two."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.rod_trial import TRIAL, trial_dipoles
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build

FIELD = np.array([1.2e-5, -0.7e-5, 2.1e-5])
SKEW = np.array([[1.0, 0.3, -0.2], [0.0, 0.9, 0.4], [0.1, 0.0, 0.8]])


@pytest.fixture(scope="module")
def steering():
    one = build(load("cubesat-3w3m")).loop.controller.rods.steering
    axes = SKEW / np.linalg.norm(SKEW, axis=0)
    limit = jnp.array([0.2, 0.3, 0.4])
    return dataclasses.replace(one, axes=axes, shares=np.linalg.inv(axes), dipole_limit=limit)


@pytest.mark.parametrize("sense", [1.0, -1.0, 0.0])
def test_their_sum_is_along_the_field(steering, sense):
    dipoles = trial_dipoles(steering, jnp.array(FIELD), jnp.zeros(3), jnp.array(sense))
    expected = sense * TRIAL * 0.2 * FIELD / np.linalg.norm(FIELD)
    np.testing.assert_allclose(steering.axes @ dipoles, expected, atol=1e-15)


def test_what_one_lacks_makes_a_torque(steering):
    dipoles = np.array(trial_dipoles(steering, jnp.array(FIELD), jnp.zeros(3), jnp.array(1.0)))
    axes = np.asarray(steering.axes)
    np.testing.assert_allclose(np.cross(axes @ dipoles, FIELD), 0, atol=1e-19)
    dipoles[1] = 0
    assert np.linalg.norm(np.cross(axes @ dipoles, FIELD)) > 1e-9


def test_they_leave_room_for_others(steering):
    free = np.asarray(trial_dipoles(steering, jnp.array(FIELD), jnp.zeros(3), jnp.array(1.0)))
    place = int(np.argmax(np.abs(free) / np.asarray(steering.dipole_limit)))
    besides = np.zeros(3)
    besides[place] = float(steering.dipole_limit[place]) - abs(free[place]) / 4
    small = trial_dipoles(steering, jnp.array(FIELD), jnp.array(besides), jnp.array(1.0))
    np.testing.assert_allclose(small, free / 4, rtol=1e-9)
    full = trial_dipoles(steering, jnp.array(FIELD), steering.dipole_limit, jnp.array(1.0))
    np.testing.assert_array_equal(full, 0)


def test_two_have_none(steering):
    shares = np.zeros((3, 3))
    shares[:2] = np.linalg.pinv(np.asarray(steering.axes)[:, :2])
    two = dataclasses.replace(steering, shares=shares)
    none = trial_dipoles(two, jnp.array(FIELD), jnp.zeros(3), jnp.array(1.0))
    np.testing.assert_array_equal(none, 0)
