"""Magnetorquers under the fault-tolerant law.

They unload wheels and make the torque about an axis that no other actuator drives.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import Diagnosis
from jaxsat.control.diagnosis.residual import believed
from jaxsat.control.diagnosis.rod_fit import Columns, Outside, RodFit, RodFitMemory, RodSample
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.rod_trial import trial_dipoles, trial_size
from jaxsat.control.tolerant_actuators import Sample
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.quotients import SMALLEST, root
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.magnetorquers import MagneticSteering

INSTANTS = 64
"""Positions in an orbit, and rotation angles of the Earth, over which a torque is averaged."""

FULL_AT = 0.25
"""Attitude error (rad) about the magnetorquers' axis at which they make their full torque."""

LEAST_PART = 0.1
"""Least mean square of the torque about a held axis, over its mean about any axis."""

LEAST_RATE = 2.0
"""Least natural frequency about a held axis, over the orbital rate."""

RELIEF = 0.5
"""Unloading rate of wheels beside a held axis, over the natural frequency about that axis."""

SHALLOW = 0.6
"""Sine of the angle between field and held axis below which torque about it is reduced: its part
across the axis would fill the wheels, and nothing would unload them."""

OVERLOAD, BEARABLE = 0.75, 0.15
"""Gyroscopic torque of all momentum, over the root mean square of the torque about a held axis,
above which magnetorquers unload body and wheels instead, and below which they hold it again."""

HURRY = 0.2
"""Unloading rate of body and wheels while nothing drives an axis, over the natural frequency."""


MOST_RODS = 4
"""Number of magnetorquers up to which they are diagnosed: each set of those that work is tabled."""


class RodMemory(NamedTuple):
    """Last command of each magnetorquer times the field (A m² T), `commanded`, and its mean until
    the next sample, `acting`, in part from earlier ones; whether momentum is too large to hold an
    axis, `overloaded`; the torque (N m) of the known dipole of the body, `pulled`; and the
    diagnosis, None without one."""

    commanded: Columns
    acting: Columns
    overloaded: BoolScalar
    pulled: Vector
    fit: RodFitMemory | None = None

    @staticmethod
    def begin(count: int, fit: RodFitMemory | None = None) -> "RodMemory":
        """Return the memory before the first dipole."""
        none = jnp.zeros((3, count))
        return RodMemory(none, none, jnp.array(False), jnp.zeros(3), fit)


class RodSets(NamedTuple):
    """For each set of magnetorquers that work, by its number Σ 2^i: `shares` and `power`."""

    shares: Float[Array, "sets k 3"]
    power: Float[Array, "sets 3 3"]


class TolerantRods(eqx.Module):
    """Magnetorquers, whose command is the dipole of each, A m².

    They unload wheels by torques across the Earth's field, which other actuators compensate, so
    that the body feels nothing. Where wheels drive all axes but n, magnetorquers make the torque
    about n with the dipole B × n: quaternion feedback goes on, slower about Jn, and wheels
    compensate the part of that torque across n. Remaining dipoles unload these wheels, with no
    torque about n. `steering` has axes, limits, field and unloading rate. n · `power` n (N² m²) is
    the mean square of the largest torque about n at rest in the orbit frame. Commands act `delay`
    (s) late. `fit` diagnoses them, and `sets` are those that may be left; both may be None.
    """

    steering: MagneticSteering
    delay: RealScalar = eqx.field(converter=as_float)
    power: Matrix = eqx.field(converter=as_float)
    fit: RodFit | None = None
    sets: RodSets | None = None

    def __check_init__(self):
        require_positive("delay", self.delay, zero_allowed=True)

    @classmethod
    def of(
        cls, steering: MagneticSteering, delay: float, fit: RodFit | None = None
    ) -> "TolerantRods":
        """Build with `power` averaged over the orbit and the Earth's rotation."""
        axes, usable = np.asarray(steering.axes), np.any(np.asarray(steering.shares) != 0, axis=1)
        turns = np.arange(INSTANTS) * 2 * np.pi / INSTANTS
        along = turns / float(steering.field.circle.rate)
        fields = steering.field.sampled(along, turns[:, None])
        across = np.cross(fields[..., None, :], np.eye(3)).swapaxes(-1, -2)  # B × n of n

        def power(shares: np.ndarray) -> np.ndarray:
            working = np.any(shares != 0, axis=1)
            if np.linalg.matrix_rank(axes[:, working]) < 2:
                return np.zeros((3, 3))
            torque = np.asarray(steering.dipole_limit)[working].min() * axes @ shares @ across
            return np.mean(torque.swapaxes(-1, -2) @ torque, axis=(0, 1))

        whole = cls(steering, delay, power(np.asarray(steering.shares)), fit)
        if fit is None:
            return whole
        subsets = np.arange(2 ** len(usable))[:, None] >> np.arange(len(usable)) & 1
        shares = np.stack([_shares(axes, usable & (one > 0)) for one in subsets])
        sets = RodSets(as_float(shares), as_float(np.stack([power(one) for one in shares])))
        return dataclasses.replace(whole, sets=sets)

    def only(self, working: Bool[np.ndarray, " k"]) -> "TolerantRods":
        """Return a copy with the working magnetorquers alone, if the law knows which these are."""
        axes, usable = np.asarray(self.steering.axes), np.any(self.steering.shares != 0, axis=1)
        shares = _shares(axes, np.asarray(usable) & working)
        steering = dataclasses.replace(self.steering, shares=shares)
        return TolerantRods.of(steering, float(self.delay))

    def begin(self, rate: Vector) -> RodMemory:
        """Return the memory at the start, with the body at a rate (rad/s)."""
        fit = None if self.fit is None else self.fit.init(rate)
        return RodMemory.begin(self.steering.axes.shape[1], fit)

    def watched(
        self,
        t: RealScalar,
        state: PlantState,
        stored: Vector,
        outside: Outside,
        period: RealScalar,
        memory: RodMemory,
        diagnosis: Diagnosis,
    ) -> RodMemory:
        """Return the memory with the diagnosis after a sample; `stored` (N m s) is in wheels."""
        if self.fit is None or memory.fit is None:
            return memory
        model, field = self.fit.model, self.steering.field.in_body(t, state.attitude)
        momentum = model.spacecraft.inertia @ state.omega + stored
        model_torque = model.disturbance_torque(t, state)
        sample = RodSample(state.omega, momentum, field, memory.acting, model_torque, outside)
        return memory._replace(fit=self.fit.step(sample, period, memory.fit, diagnosis))

    def diagnosed(self, memory: RodMemory) -> "TolerantRods":
        """Return a copy with what the magnetorquers still make, by its verdicts, and their turned
        axes. Of shares S that map a dipole to those along axes, one step of Newton's method for an
        inverse makes those along turned ones."""
        if self.sets is None or self.fit is None or memory.fit is None:
            return self
        part = memory.fit.part
        works = part != 0
        number = jnp.sum(jnp.where(works, 2 ** jnp.arange(part.shape[0]), 0))
        limit = self.steering.dipole_limit * jnp.where(works, jnp.abs(part), 1.0)
        axes, shares = self.fit.axes + self.fit.turns(memory.fit), self.sets.shares[number]
        shares = shares @ (2 * jnp.eye(3) - axes @ shares)
        steering = dataclasses.replace(self.steering, axes=axes, shares=shares, dipole_limit=limit)
        return dataclasses.replace(self, steering=steering, power=self.sets.power[number])

    def torque(self, memory: RodMemory) -> Vector:
        """Return the mean torque (N m) of all, and of the known dipole, since the last sample."""
        effective = memory.acting if memory.fit is None else memory.acting * memory.fit.part[None]
        return jnp.sum(jnp.cross(self.steering.axes, effective, axis=0), axis=1) + memory.pulled

    def body_dipole(self, memory: RodMemory | None) -> tuple[Vector, Vector] | None:
        """Return the dipole (A m²) of body and stuck magnetorquers, and its standard deviations."""
        if self.fit is None or memory is None or memory.fit is None:
            return None
        return self.fit.body_dipole(memory.fit)

    def known_dipole(self, memory: RodMemory) -> Vector:
        """Return what stands out of its noise of the dipole (A m²) of body and stuck ones."""
        estimate = self.body_dipole(memory)
        if estimate is None:
            return jnp.zeros(3)
        dipole, sigma = estimate
        return believed(jnp.sum((dipole / sigma) ** 2)) * dipole

    @property
    def bias(self) -> Vector:
        """The momentum (N m s, body axes) that wheels shall keep."""
        return self.steering.bias

    def field(self, sample: Sample) -> Vector:
        """Return the Earth's field (T, body axes) at the estimated attitude."""
        return self.steering.field.in_body(sample.t, sample.state.attitude)

    def natural_frequency(self, inertia: Matrix, axis: Vector) -> RealScalar:
        """Return the largest natural frequency (rad/s) about J n, for an `axis` n."""
        unit = jnp.trace(inertia)
        square = jnp.sum((inertia @ axis / unit) ** 2) + SMALLEST
        square = jnp.sum(axis * (self.power @ axis)) / unit**2 / square
        return root(root(square) / FULL_AT)

    def holds(self, inertia: Matrix, axis: Vector) -> BoolScalar:
        """Whether magnetorquers can make the torques needed about an `axis`; false for zero.

        The field must turn across the axis in the orbit, and they must exceed the gravity-gradient
        torque of the body of this inertia (kg m²).
        """
        most = jnp.trace(self.power) / 2
        enough = jnp.sum(axis * (self.power @ axis)) > LEAST_PART * most
        least = LEAST_RATE * self.steering.field.circle.rate
        return enough & (self.natural_frequency(inertia, axis) > least)

    def slowed(
        self, sample: Sample, axis: Vector, stored: Vector
    ) -> tuple[QuaternionFeedback, QuaternionFeedback]:
        """Return the laws across Jn and about Jn for an `axis` n.

        For zero the first is unchanged, and `about` has no use for the second. Slew rates are
        limited so that magnetorquers can oppose n · (ω × H), H the momentum of the body and what is
        `stored` (N m s), and, about Jn, brake the slew.
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

    def whole(self, sample: Sample, excess: Vector) -> Vector:
        """Return the momentum (N m s) of the body and of the `excess` of wheels."""
        model = sample.law.model
        return excess + model.spacecraft.inertia @ model.relative_rate(sample.state)

    def overloaded(
        self, sample: Sample, axis: Vector, excess: Vector, coasting: Vector, before: RodMemory
    ) -> BoolScalar:
        """Whether momentum is too large for magnetorquers to hold an `axis` n, false for zero.

        The orbit frame turns at ω0: with the momentum E of the body and an `excess` of wheels (N m
        s) the gyroscopic torque about n is up to ω0 |E|. What opposes it fills the wheels, and
        leaves nothing to unload them. Once true, it stays until E is small near the target. It is
        false where idle wheels have more momentum, `coasting`: the body takes that along.
        """
        unit = sample.law.model.spacecraft.momentum_unit
        size = jnp.sum((self.whole(sample, excess) / unit) ** 2)
        gyroscopic = jnp.sum((coasting / unit) ** 2) * sample.law.model.orbit.rate**2
        most = jnp.sum(axis * (self.power @ axis)) / unit**2
        part = jnp.where(before.overloaded, BEARABLE, OVERLOAD)
        over = size * sample.law.model.orbit.rate**2 > part**2 * most
        far = jnp.sum(sample.state.attitude.as_quaternion().q[1:] ** 2) > (FULL_AT / 2) ** 2
        little = gyroscopic < BEARABLE**2 * most
        return (over | (before.overloaded & far)) & little & jnp.any(axis != 0)

    def relief(
        self, sample: Sample, axis: Vector, excess: Vector, coasting: Vector, hurries: BoolScalar
    ) -> Vector:
        """Return the torque (N m) that takes an `excess` of momentum (N m s) out.

        Beside a held `axis` it acts as fast as attitude about that axis, and `hurries` where
        nothing drives an axis. In both cases it turns the `coasting` momentum (N m s) of idle
        wheels with the orbit frame.
        """
        holds = jnp.any(axis != 0)
        model = sample.law.model
        fast = RELIEF * self.natural_frequency(model.spacecraft.inertia, axis)
        fast = jnp.where(hurries, HURRY * sample.law.natural_frequency, jnp.where(holds, fast, 0.0))
        rate = jnp.maximum(self.steering.unloading, fast)
        gyroscopic = jnp.cross(model.orbit.frame_rate(sample.state.attitude), coasting)
        return jnp.where(holds | hurries, gyroscopic, 0.0) - rate * excess

    def beside_wheels(
        self, field: Vector, relief: Vector, torque: Vector, axis: Vector, body_dipole: Vector
    ) -> Float[Array, " k"]:
        """Return dipoles (A m²) that oppose a known `body_dipole`, make what is left of a
        `torque` (N m) about an `axis`, and then the `relief` (N m) of wheels, in a field (T).

        The axis is zero where other actuators make all torques. These hold for a while what is not
        opposed. So where the known dipole is beyond the limits, its torque is only added to the
        relief: opposed before all else, it would leave nothing to take momentum out.
        """
        limit, none = self.steering.dipole_limit, jnp.all(axis == 0)
        opposing = -self.steering.turned(field, body_dipole)
        joint = none & jnp.any(jnp.abs(opposing) > limit)
        opposing = jnp.where(joint, 0.0, self.steering.shortened(opposing))
        torque = torque - jnp.cross(body_dipole + self.steering.axes @ opposing, field)
        rest = jnp.maximum(limit - jnp.abs(opposing), SMALLEST)
        steering = dataclasses.replace(self.steering, dipole_limit=rest)
        reach = steering.reach(field)
        turning = steering.shares @ jnp.cross(field, axis)
        each = reach.columns.T @ axis  # torque of each about n, of a dipole of 1
        square = jnp.maximum(jnp.sum(each * turning), SHALLOW**2 * jnp.sum(field**2))
        holding = steering.shortened(turning * jnp.sum(axis * torque) / square)
        unloading = steering.shares @ jnp.cross(field, relief) / jnp.sum(field**2)
        unloading = unloading - turning * jnp.sum(each * unloading) / square
        whole = steering.unlimited(field, relief - jnp.cross(body_dipole, field))
        unloading = jnp.where(joint, whole, unloading)
        room = reach._replace(low=reach.low - holding, high=reach.high - holding)
        return opposing + holding + allocate(room, reach.columns @ unloading).use

    def act(
        self, field: Vector, dipoles: Float[Array, " k"], period: RealScalar, before: RodMemory
    ) -> tuple[Float[Array, " k"], Vector, RodMemory]:
        """Return the commands (A m²) for dipoles (A m²) in a field (T), their torque (N m) with
        that of the known dipole of the body, and the next memory."""
        columns, part, test = self.steering.reach(field).columns, 1.0, 0.0
        if before.fit is not None:
            part, sense = before.fit.part, before.fit.sense
            dipoles = dipoles + trial_dipoles(self.steering, field, dipoles, sense)
            test = jnp.where(before.fit.tested, sense * trial_size(self.steering), 0.0)
        commands = jnp.where(part == 0, test, dipoles / jnp.where(part == 0, 1.0, part))
        along_field = field[:, None] * commands[None]
        late = self.delay * before.commanded + (period - self.delay) * along_field
        pull = jnp.cross(self.known_dipole(before), field)
        after = before._replace(commanded=along_field, acting=late / period, pulled=pull)
        return commands, columns @ dipoles + pull, after


def _shares(
    axes: Float[np.ndarray, "3 k"], working: Bool[np.ndarray, " k"]
) -> Float[np.ndarray, "k 3"]:
    """Return what maps a dipole to those of the working magnetorquers along axes."""
    shares = np.zeros((len(working), 3))
    shares[working] = np.linalg.pinv(axes[:, working])
    return shares


def about(inertia: Matrix, axis: Vector, torque: Vector, slow: Vector) -> Vector:
    """Combine torques (N m): about an `axis` n as `slow`, across Jn with the acceleration of
    `torque`, for an inertia J (kg m²). Without an axis (zero) it is `torque`."""
    relative = inertia / jnp.trace(inertia)
    along = relative @ (relative @ axis)  # J⁻¹ times the difference is along Jn
    lacking = jnp.sum(axis * (torque - slow)) / (jnp.sum(axis * along) + SMALLEST)
    return torque - along * lacking
