"""Angles in degrees, against rotation matrices and SciPy."""

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from jaxsat.core.attitude import Quaternion, euler_angles, pointing_error
from jaxsat.store.dataset import pointing

RANDOM = np.random.default_rng(0).normal(size=(200, 4))
UNIT = RANDOM / np.linalg.norm(RANDOM, axis=1, keepdims=True)


def about(axis, degrees):
    """The direction cosines of a frame that is turned about an axis of its own."""
    turn = np.zeros(3)
    turn[axis] = np.radians(degrees)
    return Rotation.from_rotvec(turn).as_matrix().T


def test_euler_angles_make_the_direction_cosines():
    """Yaw first, then pitch, then roll: v_b = R1(roll) R2(pitch) R3(yaw) v_o."""
    for quaternion, (roll, pitch, yaw) in zip(UNIT[:40], euler_angles(UNIT[:40]), strict=True):
        made = about(0, roll) @ about(1, pitch) @ about(2, yaw)
        expected = Quaternion(jnp.asarray(quaternion)).as_dcm().matrix
        np.testing.assert_allclose(made, expected, atol=1e-12)


def test_the_pointing_error_is_the_rotation_vector():
    """That of the shorter way; to full accuracy next to zero, and NaN where the attitude is."""
    expected = Rotation.from_quat(np.roll(UNIT, -1, axis=1)).as_rotvec(degrees=True)
    np.testing.assert_allclose(pointing_error(UNIT), expected, atol=1e-11)
    tiny = np.array([[1.0, 1e-12, 0.0, 0.0], [-1.0, 0.0, 1e-9, 0.0], [1.0, 0.0, 0.0, 0.0]])
    found = pointing_error(tiny)
    np.testing.assert_allclose(found[0], [np.degrees(2e-12), 0, 0], rtol=1e-14)
    np.testing.assert_allclose(found[1], [0, -np.degrees(2e-9), 0], rtol=1e-14)
    np.testing.assert_array_equal(found[2], 0)
    assert np.isnan(pointing_error(np.full((1, 4), np.nan))).all()


def test_a_trajectory_has_them_with_units():
    told = pointing(UNIT)
    assert {variable.attrs["units"] for variable in told.values()} == {"degree"}
    size = np.linalg.norm(told["pointing_error"].values, axis=1)
    np.testing.assert_allclose(told["pointing_error_total"].values, size)
    assert "3-2-1" in told["euler_angle"].attrs["long_name"]
