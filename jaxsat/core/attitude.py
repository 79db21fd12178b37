"""Attitude of the body frame relative to the orbit frame: three parameterisations of SO(3).

The direction cosine matrix C maps orbit-frame components to body components, v_b = C v_o.
Every parameterisation computes its rate for a given angular velocity relative to the orbit frame
(in body axes, rad/s) and converts to the others.

The (w, z) parameters are those of Tsiotras and Longuski, J. Astronaut. Sci. 43(3), 1995:
C = C2(w) C1(z), a rotation by z about the third axis followed by a tilt. They are singular
upside down: |w| = tan(tilt / 2) grows without bound as the third body axis turns away from the
third orbit axis by 180 degrees, and exactly there the conversion returns NaN.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, Pair, RealScalar, Vector
from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.core.quotients import reciprocal


def skew(v: Vector) -> Matrix:
    """Return the cross-product matrix: skew(v) x = v × x (the paper's v^× is its negative)."""
    zero = jnp.zeros_like(v[0])
    return jnp.stack(
        [
            jnp.stack([zero, -v[2], v[1]]),
            jnp.stack([v[2], zero, -v[0]]),
            jnp.stack([-v[1], v[0], zero]),
        ]
    )


class AbstractAttitude(eqx.Module):
    """An attitude of the body frame relative to the orbit frame."""

    @abc.abstractmethod
    def rate(self, relative_rate: Vector) -> "AbstractAttitude":
        """Return the parameters' rates for an angular velocity ω_r in body axes, rad/s."""

    @abc.abstractmethod
    def as_dcm(self) -> "DCM":
        """Return the same attitude as a direction cosine matrix."""

    @abc.abstractmethod
    def as_quaternion(self) -> "Quaternion":
        """Return the same attitude as a unit quaternion, scalar first."""

    @abc.abstractmethod
    def as_wz(self) -> "WZ":
        """Return the same attitude as (w, z); NaN exactly upside down."""

    @abc.abstractmethod
    def normalised(self) -> "AbstractAttitude":
        """Return the same attitude without the drift of numerical integration."""


class WZ(AbstractAttitude):
    """Tsiotras-Longuski parameters: tilt `w` (shape (2,)) and turn `z` (rad, not wrapped)."""

    w: Pair = eqx.field(converter=as_float)
    z: RealScalar = eqx.field(converter=as_float)

    def rate(self, relative_rate: Vector) -> "WZ":
        """Return the rates of equation (36), 1/s and rad/s."""
        w1, w2 = self.w
        r1, r2, r3 = relative_rate
        half, along = (1 - (w1**2 + w2**2)) / 2, w1 * r1 + w2 * r2
        w1_rate = r3 * w2 + half * r1 + w1 * along
        w2_rate = -r3 * w1 + half * r2 + w2 * along
        z_rate = r3 + w1 * r2 - w2 * r1
        return WZ(jnp.stack([w1_rate, w2_rate]), z_rate)

    def as_dcm(self) -> "DCM":
        """Return C = C2(w) C1(z)."""
        w1, w2 = self.w
        c, s = jnp.cos(self.z), jnp.sin(self.z)
        tilt = jnp.stack(
            [
                jnp.stack([1 + w1**2 - w2**2, 2 * w1 * w2, -2 * w2]),
                jnp.stack([2 * w1 * w2, 1 - w1**2 + w2**2, 2 * w1]),
                jnp.stack([2 * w2, -2 * w1, 1 - w1**2 - w2**2]),
            ]
        ) / (1 + w1**2 + w2**2)
        zero, one = jnp.zeros_like(c), jnp.ones_like(c)
        turn = jnp.stack(
            [jnp.stack([c, s, zero]), jnp.stack([-s, c, zero]), jnp.stack([zero, zero, one])]
        )
        return DCM(tilt @ turn)

    def as_quaternion(self) -> "Quaternion":
        """Return the quaternion of turn and tilt; its sign changes as z grows by 2π."""
        xp, (w1, w2), z = numpy_if_known(self.w, self.z)
        c, s = xp.cos(z / 2), xp.sin(z / 2)
        q = xp.stack([c, w1 * c - w2 * s, w2 * c + w1 * s, s])
        size = xp.sqrt(1 + w1**2 + w2**2)
        return Quaternion(q * (1 / size) if xp is np else q / size)  # as XLA divides, bit for bit

    def as_wz(self) -> "WZ":
        """Return this attitude."""
        return self

    def normalised(self) -> "WZ":
        """Return this attitude: (w, z) has no redundant component."""
        return self


class Quaternion(AbstractAttitude):
    """Unit quaternion of the frame rotation from orbit to body frame, scalar first (shape (4,)).

    C is the transpose of the usual rotation matrix of q. Conversions do not need unit length.
    """

    q: Float[Array, "4"] = eqx.field(converter=as_float)

    def rate(self, relative_rate: Vector) -> "Quaternion":
        """Return half the quaternion product q ⊗ (0, ω_r)."""
        q0, q1, q2, q3 = self.q
        r1, r2, r3 = relative_rate
        rate = jnp.stack(
            [
                -q1 * r1 - q2 * r2 - q3 * r3,
                q0 * r1 + q2 * r3 - q3 * r2,
                q0 * r2 + q3 * r1 - q1 * r3,
                q0 * r3 + q1 * r2 - q2 * r1,
            ]
        )
        return Quaternion(rate / 2)

    def turned(self, rotation: Vector) -> "Quaternion":
        """Return the attitude after a small rotation of the body (rad, body axes).

        The angle is 2 arctan(|rotation| / 2), |rotation| to third order.
        """
        return Quaternion(self.q + self.rate(rotation).q).normalised()

    def as_dcm(self) -> "DCM":
        """Return C = (2 q0² - |q|²) I + 2 v vᵀ - 2 q0 skew(v), divided by |q|²."""
        scalar, vector = self.q[0], self.q[1:]
        norm2 = jnp.sum(self.q**2)
        c = (
            (2 * scalar**2 - norm2) * jnp.eye(3, dtype=self.q.dtype)
            + 2 * vector[:, None] * vector[None, :]
            - 2 * scalar * skew(vector)
        )
        return DCM(c * reciprocal(norm2))

    def as_quaternion(self) -> "Quaternion":
        """Return this attitude with a quaternion of unit length."""
        return self.normalised()

    def as_wz(self) -> "WZ":
        """Return the same attitude as (w, z) with z in [-π, π]; NaN exactly upside down."""
        q0, q1, q2, q3 = self.q
        norm2 = q0**2 + q3**2  # cos²(tilt / 2)
        w = jnp.stack([q1 * q0 + q2 * q3, q2 * q0 - q1 * q3]) * reciprocal(norm2)
        sign = jnp.where(q0 < 0, -1.0, 1.0)  # q and -q are the same attitude
        z = 2 * jnp.arctan2(sign * q3, sign * q0)
        return WZ(w, jnp.where(norm2 > 0, z, jnp.nan))

    def normalised(self) -> "Quaternion":
        """Return the quaternion scaled to unit length."""
        xp, q = numpy_if_known(self.q)
        size = xp.sqrt(xp.sum(q**2))
        return Quaternion(q * (1 / size if xp is np else reciprocal(size)))


class DCM(AbstractAttitude):
    """Direction cosine matrix C (shape (3, 3)), orbit frame to body frame."""

    matrix: Matrix = eqx.field(converter=as_float)

    def rate(self, relative_rate: Vector) -> "DCM":
        """Return dC/dt = -skew(ω_r) C, equation (10)."""
        return DCM(-skew(relative_rate) @ self.matrix)

    def as_dcm(self) -> "DCM":
        """Return this attitude."""
        return self

    def as_quaternion(self) -> "Quaternion":
        """Return the normalised row of 4 q qᵀ with the largest diagonal entry, for accuracy."""
        c = self.matrix
        d = jnp.diagonal(c)
        x, y, z = c[1, 2] - c[2, 1], c[2, 0] - c[0, 2], c[0, 1] - c[1, 0]
        xy, xz, yz = c[0, 1] + c[1, 0], c[0, 2] + c[2, 0], c[1, 2] + c[2, 1]
        rows = jnp.stack(
            [
                jnp.stack([1 + d[0] + d[1] + d[2], x, y, z]),
                jnp.stack([x, 1 + d[0] - d[1] - d[2], xy, xz]),
                jnp.stack([y, xy, 1 - d[0] + d[1] - d[2], yz]),
                jnp.stack([z, xz, yz, 1 - d[0] - d[1] + d[2]]),
            ]
        )
        row = rows[jnp.argmax(jnp.diagonal(rows))]
        return Quaternion(jnp.where(row[0] < 0, -row, row)).normalised()

    def as_wz(self) -> "WZ":
        """Return (w, z) by way of the quaternion, which is accurate near the singularity."""
        return self.as_quaternion().as_wz()

    def normalised(self) -> "DCM":
        """Return the nearest rotation, by way of the quaternion."""
        return self.as_quaternion().as_dcm()


SEQUENCE = "3-2-1: yaw about z, then pitch about y, then roll about x"


def pointing_error(quaternion: np.ndarray) -> np.ndarray:
    """Compute the rotation vectors (..., 3) from orbit to body frame, degrees, of at most 180.

    `quaternion` (..., 4) has unit length, scalar first. The vector's length is the total pointing
    error; its components are the errors about body axes.
    """
    scalar, vector = quaternion[..., :1], quaternion[..., 1:]
    size = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, np.abs(scalar))
    small = size < 1e-8  # angle / size is 2 there, to round-off
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, size))
    return np.degrees(factor * np.where(scalar < 0, -1.0, 1.0) * vector)


def euler_angles(quaternion: np.ndarray) -> np.ndarray:
    """Compute roll, pitch and yaw (..., 3), degrees, of the `SEQUENCE` from orbit to body frame.

    Roll and yaw are between -180 and 180, pitch between -90 and 90; at its ends only the sum or the
    difference of roll and yaw is defined.
    """
    q0, q1, q2, q3 = np.moveaxis(quaternion, -1, 0)
    roll = np.arctan2(2 * (q0 * q1 + q2 * q3), q0**2 - q1**2 - q2**2 + q3**2)
    pitch = np.arcsin(np.clip(2 * (q0 * q2 - q1 * q3), -1.0, 1.0))
    yaw = np.arctan2(2 * (q0 * q3 + q1 * q2), q0**2 + q1**2 - q2**2 - q3**2)
    return np.degrees(np.stack([roll, pitch, yaw], axis=-1))
