"""Normal form of any rigid body with two torques, in which it obeys the paper's equations.

Two torques span a plane with the normal n, and no torque changes h = n·Jω. With x and y the axes in
that plane about which the inertia reduced by h is diagonal, p1 = x·ω, p2 = y·ω and s = h / (n·Jn),
equation (37) holds for (p1, p2, s) in place of (ω1, ω2, ω3), except for terms in s; the derivation
is in docs/laws.md.

With (w, z) of (36) the tilt (φ, θ) = 2 w / √(1 + |w|²) has |(φ, θ)| = 2 sin(tilt / 2): it stays
bounded upside down, and near zero φ, θ and z are the small angles about the three body axes.
"""

import dataclasses
import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.array_types import Matrix, Pair, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude, Quaternion
from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.core.inertia import normal_axes
from jaxsat.core.quotients import angle_of, reciprocal, root
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Tilt(NamedTuple):
    """Tilt (φ, θ), turn z in [-π, π] (rad), and |w|."""

    phi: RealScalar
    theta: RealScalar
    turn: RealScalar
    size: RealScalar


def tilt_of(attitude: AbstractAttitude) -> Tilt:
    """The tilt and turn of an attitude, finite even upside down (where the turn is arbitrary)."""
    q0, q1, q2, q3 = attitude.as_quaternion().q
    upright = root(q0**2 + q3**2)
    safe = jnp.maximum(upright, 1e-12)  # cos(tilt / 2)
    inverse = reciprocal(safe)
    sine1, sine2 = (q0 * q1 + q2 * q3) * inverse, (q0 * q2 - q1 * q3) * inverse
    sign = jnp.where(q0 < 0, -1.0, 1.0)
    turn = 2 * angle_of(sign * q3, sign * q0)
    return Tilt(2 * sine1, 2 * sine2, turn, root(q1**2 + q2**2) * inverse)


BODY_XY = np.eye(3)[:, :2]
"""Torque directions about body x and y, as on the paper's spacecraft."""


class NormalState(NamedTuple):
    """A state in the frame (x, y, n): `omega` is (p1, p2, s), rad/s.

    `attitude` is the frame's attitude relative to the orbit frame turned likewise, `frame_rate` the
    angular velocity of the orbit frame along (x, y, n), rad/s.
    """

    attitude: Quaternion
    omega: Vector
    frame_rate: Vector

    def relative_to(self, turn: Vector) -> "NormalState":
        """The same state with the attitude relative to a frame turned from the orbit frame.

        `turn` is a small rotation vector along (x, y, n), rad.
        """
        half, q = turn / 2, self.attitude.q
        scalar = q[0] + jnp.sum(half * q[1:])
        vector = q[1:] - q[0] * half - jnp.cross(half, q[1:])
        scale = reciprocal(jnp.sqrt(1 + jnp.sum(half**2)))
        return self._replace(attitude=Quaternion(jnp.concatenate([scalar[None], vector]) * scale))

    def turned(self, axes: Pair) -> "NormalState":
        """The same state in the frame of `NormalForm.turned`."""
        q, turn = self.attitude.q, _turn_about_n(axes)
        attitude = Quaternion(jnp.concatenate([q[:1], turn @ q[1:]]))
        return NormalState(attitude, turn @ self.omega, turn @ self.frame_rate)


class NormalForm(eqx.Module):
    """A controller's model of the plant, and the frame (x, y, n) of its two torques.

    The rows of `axes` are x, y and n in body axes. `to_command` converts a torque about x and y to
    the two commanded torques, about the directions of `NormalForm.of`.
    """

    model: RigidBody
    axes: Matrix = eqx.field(converter=as_float)
    to_command: Float[Array, "2 2"] = eqx.field(converter=as_float)

    @staticmethod
    def of(
        model: RigidBody, directions: ArrayLike | Float[np.ndarray, "3 2"] = BODY_XY
    ) -> "NormalForm":
        """The normal form of a model with a concrete inertia and two torques about `directions`.

        The directions are orthonormal.
        """
        directions = np.asarray(directions, dtype=float)
        axes, _ = normal_axes(np.asarray(model.spacecraft.inertia), directions)
        return NormalForm(model, axes, directions.T @ axes[:2].T)

    def turned(self, axes: Pair) -> "NormalForm":
        """The same plant in the frame turned about n, by an angle given as (cos, sin).

        Its reduced inertia is no longer diagonal.
        """
        turn = _turn_about_n(axes)
        return dataclasses.replace(
            self, axes=turn @ self.axes, to_command=self.to_command @ turn[:2, :2].T
        )

    @property
    def inertia(self) -> Matrix:
        """J along (x, y, n), kg m²."""
        _, axes, inertia = numpy_if_known(self.axes, self.model.spacecraft.inertia)
        return as_float(axes @ inertia @ axes.T)

    @property
    def lean(self) -> Pair:
        """(ε1, ε2): n·ω = s + ε1 p1 + ε2 p2."""
        _, inertia = numpy_if_known(self.inertia)
        third = inertia[2]
        return as_float(-third[:2] / third[2])

    @property
    def reduced_inertia(self) -> Float[Array, "2 2"]:
        """S, the inertia against torques about x and y at constant h, kg m².

        S is diag(S1, S2) for the inertia of the frame's construction.
        """
        _, inertia = numpy_if_known(self.inertia)
        side = inertia[:2, 2]
        return as_float(inertia[:2, :2] - side[:, None] * side[None, :] / inertia[2, 2])

    @property
    def moments(self) -> Vector:
        """S1, S2 and n·Jn, which take the place of J1, J2 and J3, kg m²."""
        reduced = self.reduced_inertia
        xp, reduced, inertia = numpy_if_known(self.reduced_inertia, self.inertia)
        return as_float(xp.stack([reduced[0, 0], reduced[1, 1], inertia[2, 2]]))

    @property
    def coupling(self) -> RealScalar:
        """c = (S1 - S2) / n·Jn: ds/dt = c p1 p2 + ..."""
        _, (first, second, third) = numpy_if_known(self.moments)
        return as_float((first - second) / third)

    @property
    def other_products(self) -> Float[Array, "6"]:
        """The remaining factors of ds/dt: of p1 p2, p1² - p2², p2 s, p1 s, p1² + p2² and s²."""
        lean, zero = self.lean, jnp.zeros_like(self.lean[0])
        off_diagonal = -self.reduced_inertia[0, 1] / self.inertia[2, 2]
        return jnp.stack([zero, off_diagonal, -lean[0], lean[1], zero, zero])

    @property
    def orbit_rate(self) -> Vector:
        """Angular velocity of the orbit frame along (x, y, n) at the target attitude, rad/s."""
        return -self.model.orbit.rate * self.axes[:, 1]

    @property
    def gradient_rate(self) -> Vector:
        """√3 ω0 times the direction to the Earth's centre along (x, y, n) at the target attitude,
        rad/s, see `ThirdAxisEstimator`."""
        _, axes, rate = numpy_if_known(self.axes, self.model.orbit.rate)
        return as_float(math.sqrt(3) * rate * axes[:, 2])

    @property
    def rest(self) -> Vector:
        """(p1, p2, s) at rest in the orbit frame in the target attitude, rad/s."""
        return self.slow(self.orbit_rate)

    def slow(self, rate: Vector) -> Vector:
        """(p1, p2, s) of an angular velocity along (x, y, n), rad/s."""
        return leaned(rate, self.lean)

    def seen(self, state: PlantState) -> NormalState:
        """A state of the plant in this frame."""
        q = state.attitude.as_quaternion().q
        attitude = Quaternion(jnp.concatenate([q[:1], self.axes @ q[1:]]))
        omega = self.slow(self.axes @ state.omega)
        frame_rate = self.axes @ self.model.orbit.frame_rate(state.attitude)
        return NormalState(attitude, omega, frame_rate)

    def gyroscopic_torque(self, omega: Vector) -> Pair:
        """The gyroscopic torque about x and y, N m, which adds to the torques in S dp/dt."""
        p1, p2, s = omega
        lean, third = self.lean, self.inertia[2, 2]
        about_n = s + lean[0] * p1 + lean[1] * p2
        h1, h2 = self.reduced_inertia @ omega[:2] - third * s * lean
        h3 = third * s
        change = p2 * h1 - p1 * h2
        direct = jnp.stack([about_n * h2 - p2 * h3, p1 * h3 - about_n * h1])
        return direct + change * lean

    def torque(self, omega: Vector, acceleration: Pair) -> Pair:
        """The torque about x and y that gives (p1, p2) this derivative (rad/s²), N m."""
        return self.reduced_inertia @ acceleration - self.gyroscopic_torque(omega)

    def command(self, torque: Pair) -> Pair:
        """The two commanded torques, N m, for a torque about x and y."""
        return self.to_command @ torque


def _turn_about_n(axes: Pair) -> Matrix:
    """The matrix into a frame turned about n by an angle given as (cos, sin)."""
    cosine, sine = axes
    zero, one = jnp.zeros_like(cosine), jnp.ones_like(cosine)
    return jnp.stack(
        [
            jnp.stack([cosine, sine, zero]),
            jnp.stack([-sine, cosine, zero]),
            jnp.stack([zero, zero, one]),
        ]
    )


def leaned(rate: Vector, lean: Pair) -> Vector:
    """(p1, p2, s) of an angular velocity along (x, y, n), rad/s, by `NormalForm.lean`."""
    return rate.at[2].add(-jnp.sum(lean * rate[:2]))


def tracking_torque(
    form: NormalForm, omega: Vector, reference: Pair, reference_derivative: Pair, gain: RealScalar
) -> Pair:
    """S [dω_d/dt - gain (ω - ω_d)] minus the gyroscopic torque, N m.

    With it the rate error η = ω - ω_d of (p1, p2) obeys dη/dt = -gain η.
    """
    return form.torque(omega, reference_derivative - gain * (omega[:2] - reference))


def clipped(torque: Pair, limit: RealScalar) -> Pair:
    """Each torque clipped to ± `limit`."""
    return jnp.clip(torque, -limit, limit)
