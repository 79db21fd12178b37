"""Attitude parameterisations against SciPy's Rotation, which shares no code with them.

SciPy's matrix maps body components to orbit components, so C is its transpose.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from helpers.strategies import rotations, vectors
from jaxsat.core.attitude import DCM, WZ, Quaternion, skew

to_dcm = eqx.filter_jit(lambda attitude: attitude.as_dcm().matrix)
to_wz = eqx.filter_jit(lambda attitude: attitude.as_wz())
to_quaternion = eqx.filter_jit(lambda attitude: attitude.as_quaternion().q)
rate_of = eqx.filter_jit(lambda attitude, relative_rate: attitude.rate(relative_rate))


def scalar_first(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1)


def wz_rotation(w, z) -> Rotation:
    """(w, z) from its geometry: turn z about axis 3, then tilt by 2 atan|w| about the axis w."""
    tilt = 2 * np.arctan(np.hypot(*w))
    axis = np.array([w[0], w[1], 0]) / max(np.hypot(*w), 1e-300)
    return Rotation.from_rotvec([0, 0, z]) * Rotation.from_rotvec(tilt * axis)


@given(vectors(2, 20.0), st.floats(-3, 3))
def test_wz_is_a_turn_followed_by_a_tilt(w, z):
    rotation = wz_rotation(w, z)
    np.testing.assert_allclose(to_dcm(WZ(w, z)), rotation.as_matrix().T, atol=1e-14)
    q = scalar_first(rotation)
    np.testing.assert_allclose(to_quaternion(WZ(w, z)), q if q[0] > 0 else -q, atol=1e-14)


@given(rotations())
def test_dcm_and_quaternion_agree_with_scipy(rotation):
    q = scalar_first(rotation)
    np.testing.assert_allclose(to_dcm(Quaternion(q)), rotation.as_matrix().T, atol=1e-14)
    back = to_quaternion(DCM(rotation.as_matrix().T))
    assert abs(abs(back @ q) - 1) < 1e-14
    assert back[0] >= 0


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -2, 3]])
def test_half_turns_survive_the_dcm(axis):
    rotation = Rotation.from_rotvec(np.pi * np.array(axis) / np.linalg.norm(axis))
    back = to_quaternion(DCM(rotation.as_matrix().T))
    assert abs(abs(back @ scalar_first(rotation)) - 1) < 1e-14


@given(rotations())
def test_conversions_return_to_the_same_attitude(rotation):
    matrix = rotation.as_matrix().T
    for attitude in (Quaternion(scalar_first(rotation)), DCM(matrix)):
        if matrix[2, 2] < -1 + 1e-6:
            continue
        wz = to_wz(attitude)
        assert -np.pi <= wz.z <= np.pi
        tilt_error = 1e-14 * (1 + float(jnp.sum(wz.w**2)))
        np.testing.assert_allclose(to_dcm(wz), matrix, atol=10 * tilt_error)
        scaled = Quaternion(3.0 * to_quaternion(wz))
        np.testing.assert_allclose(to_dcm(scaled), matrix, atol=10 * tilt_error)


@given(st.floats(1e-12, 1e-2), st.floats(-3.1, 3.1), st.floats(-3, 3))
def test_wz_keeps_its_digits_next_to_the_singularity(distance, direction, z):
    """Tilted to within `distance` of upside down |w| = 1 / tan(distance / 2), from quaternions."""
    w = np.array([np.cos(direction), np.sin(direction)]) / np.tan(distance / 2)
    wz = to_wz(Quaternion(scalar_first(wz_rotation(w, z))))
    size = np.linalg.norm(w)
    np.testing.assert_allclose(wz.w, w, rtol=0, atol=size * 4e-15 / distance)
    from_exact = to_wz(Quaternion(to_quaternion(WZ(w, z))))
    np.testing.assert_allclose(from_exact.w, w, rtol=0, atol=size * 1e-14)
    np.testing.assert_allclose(from_exact.z, z, atol=1e-14)


def test_upside_down_has_no_wz():
    for attitude in (Quaternion([0.0, 0.6, 0.8, 0.0]), DCM(np.diag([1.0, -1.0, -1.0]))):
        wz = to_wz(attitude)
        assert np.all(np.isnan(wz.w))
        assert np.isnan(wz.z)


@given(rotations(), vectors(3, 2.0))
def test_every_rate_is_that_of_the_same_motion(rotation, relative_rate):
    """Each kinematic equation against a finite rotation exp(-skew(ω) h), differenced centrally."""
    matrix, h = rotation.as_matrix().T, 1e-5
    forward, backward = (expm(-s * h * np.array(skew(jnp.array(relative_rate)))) for s in (1, -1))
    np.testing.assert_allclose(
        rate_of(DCM(matrix), jnp.array(relative_rate)).matrix,
        (forward - backward) @ matrix / (2 * h),
        atol=1e-9,
    )
    q0 = to_quaternion(DCM(matrix))
    ends = [to_quaternion(DCM(turn @ matrix)) for turn in (forward, backward)]
    ends = [np.sign(end @ q0) * end for end in ends]
    q_rate = rate_of(Quaternion(q0), jnp.array(relative_rate)).q
    np.testing.assert_allclose(q_rate, (ends[0] - ends[1]) / (2 * h), atol=1e-8)
    if matrix[2, 2] < -0.9:
        return
    wz, ends = to_wz(DCM(matrix)), [to_wz(DCM(turn @ matrix)) for turn in (forward, backward)]
    wz_rate = rate_of(wz, jnp.array(relative_rate))
    scale = 1 + float(jnp.sum(wz.w**2))
    np.testing.assert_allclose(wz_rate.w, (ends[0].w - ends[1].w) / (2 * h), atol=1e-8 * scale**2)
    turned = np.mod(ends[0].z - ends[1].z + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(wz_rate.z, turned / (2 * h), atol=1e-8 * scale**2)


def test_normalised_removes_drift():
    q = Quaternion([1.1, 0.2, -0.3, 0.4])
    assert abs(jnp.linalg.norm(q.normalised().q) - 1) < 1e-15
    c = DCM(np.eye(3) + 1e-6 * np.arange(9).reshape(3, 3)).normalised().matrix
    np.testing.assert_allclose(c @ c.T, np.eye(3), atol=1e-15)
    wz = WZ([0.1, 0.2], 9.0)
    assert wz.normalised() is wz
    assert wz.as_wz() is wz
