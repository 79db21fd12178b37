"""Magnetorquers under the fault-tolerant law.

They take momentum out of wheels, and make the torque about an axis that no other actuator turns.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.tolerant_actuators import Sample
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.quotients import root
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.magnetorquers import MagneticSteering

INSTANTS = 64
"""Of an orbit, and as many turns of the Earth, over which a torque is averaged."""

FULL_AT = 0.25
"""rad; an error about the axis of magnetorquers for which they make all their torque."""

LEAST_PART = 0.1
"""Of the mean square of the torque about any axis: the least about one that magnetorquers hold."""

LEAST_RATE = 2.0
"""Times that of the orbit: the least natural frequency about such an axis."""

RELIEF = 0.5
"""Times that frequency: how fast momentum is taken out of the wheels beside such an axis."""

SHALLOW = 0.6
"""Sine of the angle between the field and such an axis below which less torque about it is made:
what this torque has across the axis would fill the wheels, and nothing would take it out again."""

SMALLEST = 1e-30
"""Keeps a quotient of two zeros finite; both have no unit."""


class RodMemory(NamedTuple):
    """The torque (N m) of the last dipoles, and what magnetorquers make until the next sample.

    The latter is the mean over a period, in part of dipoles that were commanded before.
    """

    commanded: Vector
    acting: Vector

    @staticmethod
    def begin() -> "RodMemory":
        """No dipole has been commanded."""
        return RodMemory(jnp.zeros(3), jnp.zeros(3))


class TolerantRods(eqx.Module):
    """Magnetorquers, whose command is the dipole of each, A m².

    They make the part across the Earth's field of the torque that takes momentum out of wheels;
    other actuators make up for it, so that the body feels nothing of it. Where wheels make all
    torques across an axis n and nothing makes those about it, magnetorquers do, with the dipole B ×
    n: quaternion feedback goes on, slower about Jn, and what their torque has across n the wheels
    make up for. The dipoles that are left take momentum out of these wheels, with no torque about
    n. `steering` has the axes and limits, the field, and how fast momentum beyond a bias is to be
    taken out. n · `power` n (N² m²) is the mean square of the largest torque about n at rest in the
    orbit frame. Commands act `delay` (s) late. Nothing tells whether they work: no failure of
    theirs is diagnosed.
    """

    steering: MagneticSteering
    delay: RealScalar = eqx.field(converter=as_float)
    power: Matrix = eqx.field(converter=as_float)

    def __check_init__(self):
        require_positive("delay", self.delay, zero_allowed=True)

    @classmethod
    def of(cls, steering: MagneticSteering, delay: float) -> "TolerantRods":
        """With the mean over all places of the orbit and turns of the Earth."""
        axes, shares = np.asarray(steering.axes), np.asarray(steering.shares)
        working = np.any(shares != 0, axis=1)
        if np.linalg.matrix_rank(axes[:, working]) < 2:
            return cls(steering, delay, np.zeros((3, 3)))
        turns = np.arange(INSTANTS) * 2 * np.pi / INSTANTS
        along = turns / float(steering.field.circle.rate)
        fields = steering.field.sampled(along, turns[:, None])
        across = np.cross(fields[..., None, :], np.eye(3)).swapaxes(-1, -2)  # B × n of n
        across = np.asarray(steering.dipole_limit)[working].min() * axes @ shares @ across
        return cls(steering, delay, np.mean(across.swapaxes(-1, -2) @ across, axis=(0, 1)))

    def left(self, working: Bool[np.ndarray, " k"]) -> "TolerantRods":
        """Those that make what they are commanded, if the law knows which these are."""
        axes, asked = np.asarray(self.steering.axes), np.any(self.steering.shares != 0, axis=1)
        asked = np.asarray(asked) & working
        shares = np.zeros((len(asked), 3))
        shares[asked] = np.linalg.pinv(axes[:, asked])
        steering = dataclasses.replace(self.steering, shares=shares)
        return TolerantRods.of(steering, float(self.delay))

    @property
    def bias(self) -> Vector:
        """The momentum (N m s, body axes) that wheels are to keep."""
        return self.steering.bias

    def field(self, sample: Sample) -> Vector:
        """The Earth's field (T, body axes) at the attitude that the law is given."""
        return self.steering.field.in_body(sample.t, sample.state.attitude)

    def natural_frequency(self, inertia: Matrix, axis: Vector) -> RealScalar:
        """The largest (rad/s) about J n, for an `axis` n and an inertia J (kg m²)."""
        unit = jnp.trace(inertia)
        square = jnp.sum((inertia @ axis / unit) ** 2) + SMALLEST
        square = jnp.sum(axis * (self.power @ axis)) / unit**2 / square
        return root(root(square) / FULL_AT)

    def holds(self, inertia: Matrix, axis: Vector) -> BoolScalar:
        """Whether magnetorquers can make what torques are needed about an `axis`, not about zero.

        The field must turn across it in the orbit, and they must be stronger than the gravity
        gradient of the body (kg m²).
        """
        most = jnp.trace(self.power) / 2
        enough = jnp.sum(axis * (self.power @ axis)) > LEAST_PART * most
        least = LEAST_RATE * self.steering.field.circle.rate
        return enough & (self.natural_frequency(inertia, axis) > least)

    def slowed(
        self, sample: Sample, axis: Vector, stored: Vector
    ) -> tuple[QuaternionFeedback, QuaternionFeedback]:
        """The law across Jn and about it, for an `axis` n that may be zero: then it is unchanged.

        Slews are as slow as magnetorquers can oppose n · (ω × H), with H the momentum of the body
        and what is `stored` (N m s), and about Jn as they can brake them.
        """
        law, inertia = sample.law, sample.law.model.spacecraft.inertia
        most = root(jnp.sum(axis * (self.power @ axis)))
        momentum = inertia @ sample.state.omega + stored
        across = momentum - axis * jnp.sum(axis * momentum)
        unit = law.model.spacecraft.momentum_unit
        opposed = most / unit / jnp.sqrt(jnp.sum((across / unit) ** 2) + SMALLEST)
        rate = jnp.minimum(law.max_rate, jnp.where(jnp.any(axis != 0), opposed, jnp.inf))
        frequency = jnp.minimum(self.natural_frequency(inertia, axis), law.natural_frequency)
        braked = law.damping * frequency * FULL_AT
        slow = dataclasses.replace(
            law, natural_frequency=frequency, max_rate=jnp.minimum(rate, braked)
        )
        return dataclasses.replace(law, max_rate=rate), slow

    def relief(self, sample: Sample, axis: Vector, excess: Vector, coasting: Vector) -> Vector:
        """The torque (N m) that takes an `excess` of momentum (N m s) out of wheels.

        Beside an `axis` that magnetorquers hold it is as fast as they turn the body about that, and
        turns with the orbit frame what wheels hold that are not in use, `coasting` (N m s).
        """
        holds = jnp.any(axis != 0)
        model = sample.law.model
        fast = RELIEF * self.natural_frequency(model.spacecraft.inertia, axis)
        rate = jnp.maximum(self.steering.unloading, jnp.where(holds, fast, 0.0))
        turned = jnp.cross(model.orbit.frame_rate(sample.state.attitude), coasting)
        return jnp.where(holds, turned, 0.0) - rate * excess

    def beside_wheels(
        self,
        field: Vector,
        relief: Vector,
        torque: Vector,
        axis: Vector,
    ) -> Float[Array, " k"]:
        """Dipoles (A m²) that make the part about an `axis` of a `torque` (N m), and of the
        `relief` (N m) of wheels what is left, in a field (T).

        The axis is zero where others make all torques.
        """
        steering, reach = self.steering, self.steering.reach(field)
        turning = steering.shares @ jnp.cross(field, axis)
        each = reach.columns.T @ axis  # torque of each about n, of a dipole of 1
        square = jnp.maximum(jnp.sum(each * turning), SHALLOW**2 * jnp.sum(field**2))
        holding = turning * jnp.sum(axis * torque) / square
        beyond = jnp.max(jnp.abs(holding) / jnp.where(reach.high > 0, reach.high, jnp.inf))
        holding = holding / jnp.maximum(beyond, 1.0)
        unloading = steering.unlimited(field, relief)
        unloading = unloading - turning * jnp.sum(each * unloading) / square
        left = reach._replace(low=reach.low - holding, high=reach.high - holding)
        return holding + allocate(left, reach.columns @ unloading).use

    def act(
        self, field: Vector, dipoles: Float[Array, " k"], period: RealScalar, before: RodMemory
    ) -> tuple[Vector, RodMemory]:
        """The torque (N m) of dipoles (A m²) in a field (T), and the memory of the next sample."""
        made = self.steering.reach(field).columns @ dipoles
        late = self.delay * before.commanded + (period - self.delay) * made
        return made, RodMemory(made, late / period)


def about(inertia: Matrix, axis: Vector, torque: Vector, slow: Vector) -> Vector:
    """The torque whose part about an `axis` n is that of `slow`, and which turns the body of an
    inertia J (kg m²) as `torque` does across Jn, all in N m. For no axis it is the torque."""
    relative = inertia / jnp.trace(inertia)
    along = relative @ (relative @ axis)  # J⁻¹ times the difference is along Jn
    lacking = jnp.sum(axis * (torque - slow)) / (jnp.sum(axis * along) + SMALLEST)
    return torque - along * lacking
