"""Attitude by two wheels about any axes, on a body of any inertia, in the form of (40)-(42).

With n the normal of both wheel axes no wheel changes n·Jω. Without momentum about n it is zero, so
ω is perpendicular to e3 = Jn / |Jn|: in a frame with that third axis the third rate is zero, as in
Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53, whatever the inertia. Torques J e1, J e2 are
perpendicular to n: the two wheels can produce them.

As in (40) one part of the reference pulls the tilt w and the other, perpendicular to it, steers the
turn z. But the tilt is pulled to a size ρ that shrinks with |z|, instead of to zero: the turn
equals the area that w encloses, and a tilt that vanishes before the turn can no longer steer it.
Remaining momentum about n makes a third rate, which adds to the steered turn.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.control.undriven_momentum import relative_to
from jaxsat.core.array_types import Matrix, Pair, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.quotients import SMALLEST, share_within
from jaxsat.spacecraft.dynamics import PlantState, RigidBody

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
        held: Quaternion,
    ) -> Vector:
        """The torque on the body (N m) of an `inertia` (kg m²), without gyroscopic torque.

        `natural_frequency` (rad/s) sets all gains, reference rates are at most `max_rate` (rad/s).
        The attitude to reach is `held`, relative to the target.
        """
        frame = self.frame(normal, inertia)
        orbit = frame @ self.model.orbit.frame_rate(state.attitude)
        quaternion = relative_to(state.attitude.as_quaternion(), held).q
        attitude = Quaternion(jnp.concatenate([quaternion[:1], frame @ quaternion[1:]]))
        relative = frame @ state.omega - orbit

        def wanted(attitude):
            rate = natural_frequency * reference(attitude, relative[2] / natural_frequency)
            size = jnp.sqrt(jnp.sum(rate**2) + SMALLEST)
            return rate * share_within(max_rate, size)

        rate, change = jax.jvp(wanted, (attitude,), (attitude.rate(relative),))
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
