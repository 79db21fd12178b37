"""Attitude by two wheels about any axes, on a body of any inertia, in the form of (40)-(42).

With n the normal of both wheel axes no wheel changes n·Jω. Without momentum about n it is zero, so
ω is perpendicular to e3 = Jn / |Jn|: in a frame with that third axis the third rate is zero, as in
Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53, whatever the inertia. Torques J e1, J e2 are
perpendicular to n: the two wheels can produce them.

As in (40) one part of the reference pulls the tilt w and the other, perpendicular to it, steers the
turn z. But the tilt is pulled to a size ρ that shrinks with |z|, instead of to zero: the turn
equals the area that w encloses, and a tilt that vanishes before the turn can no longer steer it.
Remaining momentum about n makes a third rate, which adds to the steered turn.

With the total momentum H in the axes of the target, the attitude C and the momentum β of unused
wheels, fixed in the body, n·Jω = n·(C H - β). Rest requires n·C H = n·β: the angle between n and
the momentum must be arccos(n·β / |H|). The smallest rotation of the body to such an attitude turns
n in the plane of n and H.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.core.array_types import BoolScalar, Matrix, Pair, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.quotients import SMALLEST, length, share_within
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class HeldAttitude(NamedTuple):
    """The attitude nearest to the target at which two wheels hold the body at rest.

    `attitude` is relative to the target, at an `angle` (rad) from it. `exists` is false if momentum
    about n remains at every attitude.
    """

    attitude: Quaternion
    angle: RealScalar
    exists: BoolScalar


def nearest_held(
    momentum: Vector, coasting: Vector, normal: Vector, error: RealScalar
) -> HeldAttitude:
    """The held attitude for the `momentum` H at the target attitude, without the part that the
    target's rate needs, the momentum of `coasting` wheels, and the unit vector n, all in body axes.

    H is known to within an `error`, all in the same unit: well below it, the attitude is the
    target.
    """
    unit = length(momentum) + SMALLEST
    momentum, coasting, error = momentum / unit, coasting / unit, error / unit
    across = jnp.cross(normal, momentum)
    size, along = jnp.sqrt(jnp.sum(across**2)), normal @ momentum
    whole = jnp.sqrt(size**2 + along**2)
    goal = normal @ coasting
    beside = jnp.sqrt(jnp.maximum(whole**2 - goal**2, 0.0))
    turn = jnp.arctan2(size, along) - jnp.arctan2(beside, goal)
    least = jnp.eye(3)[jnp.argmin(jnp.abs(normal))]  # n along H: any axis across
    other = jnp.cross(normal, least)
    axis = jnp.where(size > 1e-9 * whole + SMALLEST, across, other)
    axis = axis / jnp.sqrt(jnp.sum(axis**2) + SMALLEST)
    turn = turn * whole**4 / (whole**4 + error**4 + SMALLEST)
    half = turn / 2
    attitude = Quaternion(jnp.concatenate([jnp.cos(half)[None], jnp.sin(half) * axis]))
    return HeldAttitude(attitude, jnp.abs(turn), jnp.abs(goal) <= whole)


def relative_to(attitude: Quaternion, frame: Quaternion) -> Quaternion:
    """An `attitude` relative to that of another frame, both relative to the target: q'⁻¹ q."""
    scalar, vector = frame.q[0], -frame.q[1:]
    own, part = attitude.q[0], attitude.q[1:]
    product = scalar * part + own * vector + jnp.cross(vector, part)
    return Quaternion(jnp.concatenate([(scalar * own - vector @ part)[None], product]))


TILT_GAIN, TURN_GAIN, RATE_GAIN = 1.0, 0.4, 3.0
"""Gains on the tilt, the turn and rate errors, over the natural frequency."""

AREA, MOST_TILT = 0.4, 0.5
"""ρ² over |z|, and the largest ρ."""

NO_TURN = 0.01
"""Turn, rad, below which no tilt is needed."""

NO_TILT = 0.01
"""Size of the tilt below which its direction fades."""


class TwoWheels(eqx.Module):
    """Attitude by two wheels, with little momentum about their common normal.

    `model` is the law's model of the plant.
    """

    model: RigidBody

    def frame(self, normal: Vector, inertia: Matrix) -> Matrix:
        """Rows e1, e2, e3 in body axes; no wheel turns about the unit vector `normal`."""
        along = inertia @ normal / self.model.spacecraft.momentum_unit
        third = along / jnp.sqrt(jnp.sum(along**2) + SMALLEST)
        across = jnp.eye(3)[jnp.argmin(jnp.abs(third))]
        first = jnp.cross(across, third)
        first = first / jnp.sqrt(jnp.sum(first**2) + SMALLEST)
        return jnp.stack([first, jnp.cross(third, first), third])

    def torque(
        self,
        state: PlantState,
        normal: Vector,
        inertia: Matrix,
        natural_frequency: RealScalar,
        max_rate: RealScalar,
        rest_attitude: Quaternion,
    ) -> Vector:
        """The torque on the body (N m) of an `inertia` (kg m²), without gyroscopic torque.

        `natural_frequency` (rad/s) sets all gains, reference rates are at most `max_rate` (rad/s).
        The attitude to reach is `rest_attitude`, relative to the target.
        """
        frame = self.frame(normal, inertia)
        orbit = frame @ self.model.orbit.frame_rate(state.attitude)
        quaternion = relative_to(state.attitude.as_quaternion(), rest_attitude).q
        attitude = Quaternion(jnp.concatenate([quaternion[:1], frame @ quaternion[1:]]))
        relative = frame @ state.omega - orbit

        def reference_rate(attitude):
            rate = natural_frequency * reference(attitude, relative[2] / natural_frequency)
            size = jnp.sqrt(jnp.sum(rate**2) + SMALLEST)
            return rate * share_within(max_rate, size)

        rate, change = jax.jvp(reference_rate, (attitude,), (attitude.rate(relative),))
        pull = RATE_GAIN * natural_frequency * (relative[:2] - rate)
        return inertia @ (frame[:2].T @ (change - pull))


def reference(attitude: Quaternion, third: RealScalar) -> Pair:
    """The reference rates about the first two axes for a given `third` rate, all over the natural
    frequency."""
    wz = attitude.as_wz()
    z = wz.z + third / TURN_GAIN
    w, turn = wz.w, jnp.abs(z)
    square = jnp.sum(w**2)
    beyond = jnp.maximum(turn - NO_TURN, 0.0)
    size = jnp.sqrt(AREA) * beyond / jnp.sqrt(beyond + NO_TURN)  # ρ
    size = size / jnp.sqrt(1 + (size / MOST_TILT) ** 2)
    directed = w + jnp.stack([NO_TILT * size, 0.0 * size])  # defined without tilt
    direction = directed / jnp.sqrt(jnp.sum(directed**2) + NO_TILT**2)
    pull = TILT_GAIN * (size * direction - w)
    steer = 2 * TURN_GAIN * z / (square + size**2 + NO_TILT**2)
    return pull + steer * jnp.stack([w[1], -w[0]])
