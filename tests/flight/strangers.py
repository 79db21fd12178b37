"""Laws written after docs/your-own-law.md by one who has not read the exporter."""

import enum
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from jaxsat import AbstractSampledController, LawDeclaration, RigidBody
from jaxsat.core.declaration import number


class RiccatiMemory(NamedTuple):
    """The cost-to-go, a history of errors and how many samples there were."""

    cost: jax.Array
    errors: jax.Array
    count: jax.Array


class RecedingRiccati(AbstractSampledController):
    """A regulator whose gain is a few Riccati iterations better at every sample."""

    declaration = LawDeclaration(
        summary="receding Riccati regulator",
        keys=(
            number("period_s", "Time between samples", "s", above=0, default=0.5),
            number("weight", "Weight of the torque", "1", above=0, tunable=True),
            number("leak", "Share of the mean error that is added", "1", at_least=0, default=0.05),
        ),
        torques=3,
    )

    model: RigidBody
    period: jax.Array
    weight: jax.Array
    leak: jax.Array

    @classmethod
    def from_table(cls, values, context):
        numbers = (jnp.asarray(values[name]) for name in ("period_s", "weight", "leak"))
        return cls(context.model, *numbers)

    def init(self, state):
        return RiccatiMemory(jnp.eye(6), jnp.zeros((4, 6)), jnp.array(0))

    def step(self, t, state, memory):
        q = state.attitude.as_quaternion().q
        rate = self.model.relative_rate(state)
        error = jnp.concatenate([jnp.where(q[0] < 0, -2.0, 2.0) * q[1:], rate])
        inertia = self.model.spacecraft.inertia
        zero, one = jnp.zeros((3, 3)), jnp.eye(3)
        a = jnp.block([[one, self.period * one], [zero, one]])
        b = self.period * jnp.concatenate([zero, _inverse(inertia)])

        def iteration(cost, decay):
            gain = _inverse(self.weight * one + b.T @ cost @ b) @ (b.T @ cost @ a)
            better = a.T @ cost @ (a - b @ gain) + decay * jnp.eye(6)
            return 0.5 * (better + better.T), jnp.trace(gain @ gain.T)

        cost, sizes = jax.lax.scan(iteration, memory.cost, 1.0 / (1.0 + jnp.arange(3.0)))
        gain = _inverse(self.weight * one + b.T @ cost @ b) @ (b.T @ cost @ a)
        errors = jax.lax.dynamic_update_slice(
            memory.errors, error[None], (memory.count % 4, jnp.array(0))
        )
        mean = jax.lax.fori_loop(0, 4, lambda i, s: s + errors[(3 * i) % 4], jnp.zeros(6)) / 4
        torque = -gain @ (error + self.leak * mean)
        torque = torque / jnp.sqrt(1.0 + 1e-6 * jnp.max(sizes) + jnp.sum(torque**2))
        return torque, RiccatiMemory(cost, errors, memory.count + 1)


def _inverse(matrix):
    """Of a 3 x 3 matrix, by its cofactors."""
    rows = [jnp.cross(matrix[(i + 1) % 3], matrix[(i + 2) % 3]) for i in range(3)]
    return jnp.stack(rows, axis=1) / jnp.dot(matrix[0], rows[0])


class Mode(enum.IntEnum):
    """What the law is at."""

    DETUMBLE = 0
    SPIN = 1
    POINT = 2


class Memory(NamedTuple):
    """The mode, since when (s), the estimated disturbance torque (N m), the phase and last rate."""

    mode: jax.Array
    since: jax.Array
    torque: jax.Array
    last: jax.Array
    phase: jax.Array
    rate: jax.Array


class Moody(AbstractSampledController):
    """Detumbles, then spins for a while, then points, and learns the disturbance meanwhile."""

    declaration = LawDeclaration(
        summary="three modes and a disturbance estimate",
        keys=(
            number("period_s", "Time between samples", "s", above=0, default=0.25),
            number("kp", "Gain on the attitude", "N m", above=0, tunable=True),
            number("kd", "Gain on the rate", "N m s", above=0, tunable=True),
        ),
        torques=3,
    )
    modes: ClassVar[type[enum.IntEnum]] = Mode

    model: RigidBody
    period: jax.Array
    kp: jax.Array
    kd: jax.Array

    @classmethod
    def from_table(cls, values, context):
        numbers = (jnp.asarray(values[name]) for name in ("period_s", "kp", "kd"))
        return cls(context.model, *numbers)

    def init(self, state):
        zero = jnp.zeros(3)
        start = jnp.zeros_like(state.omega[0])
        return Memory(jnp.array(Mode.DETUMBLE), start, zero, zero, start, state.omega)

    def mode(self, memory):
        return memory.mode

    def step(self, t, state, memory):
        q = state.attitude.as_quaternion().q
        omega = state.omega
        inertia = self.model.spacecraft.inertia
        momentum = inertia @ omega
        change = inertia @ (omega - memory.rate) / self.period
        seen = change + jnp.cross(omega, momentum) - memory.last
        blend = 1.0 - jnp.exp(-self.period / 20.0)
        torque = memory.torque + blend * (jnp.clip(seen, -0.1, 0.1) - memory.torque)
        size = jnp.sqrt(jnp.sum(omega**2))
        lasted = t - memory.since
        after = jnp.array([Mode.SPIN, Mode.POINT, Mode.POINT])[memory.mode]
        due = jnp.array([size < 0.02, lasted > 15.0, False])[memory.mode]
        lost = (memory.mode == Mode.POINT) & (size > 0.2)
        mode = jnp.where(lost, Mode.DETUMBLE, jnp.where(due, after, memory.mode))
        phase = jnp.mod(memory.phase + self.period * jnp.arctan2(omega[1], omega[0]), 2 * jnp.pi)

        def detumble(omega):
            return -self.kd * omega * (1.0 + jnp.tanh(20.0 * size))

        def spin(omega):
            wanted = 0.01 * jnp.stack([jnp.cos(phase), jnp.sin(phase), jnp.ones_like(phase)])
            return self.kd * (wanted - omega)

        def point(omega):
            angle = 2.0 * jnp.arctan2(jnp.sqrt(jnp.sum(q[1:] ** 2)), jnp.abs(q[0]))
            axis = jnp.sign(q[0]) * q[1:] / jnp.maximum(jnp.sin(0.5 * angle), 1e-6)
            return -self.kp * angle * axis - self.kd * omega

        command = jax.lax.switch(mode, [detumble, spin, point], omega)
        early = torque * jnp.log1p(lasted) / 2
        command = jax.lax.cond(lasted > 5.0, lambda x: x - torque, lambda x: x - early, command)
        since = jnp.where(mode == memory.mode, memory.since, t)
        return command, Memory(mode, since, torque, command, phase, omega)


class PartlyNew(AbstractSampledController):
    """Damps the rates, the third one filtered: it remembers an array of which one entry is new."""

    declaration = LawDeclaration(
        summary="damping with a filtered third rate",
        keys=(
            number("period_s", "Time between samples", "s", above=0, default=0.5),
            number("kd", "Gain on the rates", "N m s", above=0, tunable=True),
        ),
        torques=3,
    )

    model: RigidBody
    kd: jax.Array
    period: jax.Array

    @classmethod
    def from_table(cls, values, context):
        return cls(context.model, *(jnp.asarray(values[name]) for name in ("kd", "period_s")))

    def init(self, state):
        return jnp.zeros(3)

    def step(self, t, state, memory):
        rate = _third_filtered(self.model.relative_rate(state), memory)
        return -self.kd * rate, rate


def _third_filtered(rate, before):
    """The first two rates pass through; long enough to be a function of its own."""
    third = rate[2]
    for k in range(25):
        third = third - 0.05 * (third - before[2]) / (1.0 + k * third**2)
    return rate.at[2].set(third)
