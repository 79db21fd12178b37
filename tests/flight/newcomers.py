"""A law written after docs/your-own-law.md: sliding mode by a table, with a bisection."""

import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat import LawDeclaration
from jaxsat.core.declaration import number, switch
from tests.flight.law_frame import PERIOD, AbstractVisitor


class Phase(enum.IntEnum):
    """What the table law does."""

    RATE = 0
    SLEW = 1
    HOLD = 2
    SAFE = 9


class TableMemory(NamedTuple):
    """Phase, samples in it, the integral, a ring of errors with its head, and alarms."""

    phase: jax.Array
    samples: jax.Array
    integral: jax.Array
    ring: jax.Array
    head: jax.Array
    alarms: jax.Array


class Tabled(AbstractVisitor):
    """Sliding mode on a surface from a table of two axes, with a saturating integral.

    A bisection finds the largest share of the torque whose norm is allowed.
    """

    declaration = LawDeclaration(
        summary="sliding mode by a table",
        keys=(
            PERIOD,
            number("slope", "Slope of the surface", "1/s", above=0, tunable=True),
            number("gain", "Torque of the switch", "N m", above=0, tunable=True),
            number("ki", "Gain of the integral", "N m/s", at_least=0, default=0.01),
            number("most", "Largest norm of the torque", "N m", above=0, default=0.8),
            switch("unwind", "Stop the integral at its limit", default=True),
        ),
        torques=3,
    )
    modes: ClassVar[type[enum.IntEnum]] = Phase

    slope: jax.Array
    gain: jax.Array
    ki: jax.Array
    most: jax.Array
    table: jax.Array
    unwind: bool = eqx.field(static=True)

    @classmethod
    def from_table(cls, values, context):
        table = jnp.outer(jnp.array([1.0, 0.8, 0.6, 0.5]), jnp.array([1.0, 1.2, 1.5]))
        return cls(context.model, *cls.numbers(values), table, values["unwind"])

    def init(self, state):
        zero = jnp.zeros(3)
        count = jnp.array(0, jnp.int32)
        return TableMemory(
            jnp.array(Phase.RATE), count, zero, jnp.zeros((6, 3)), count, jnp.zeros(3, bool)
        )

    def mode(self, memory):
        return memory.phase

    def telemetry(self, memory):
        return {"integral": memory.integral}

    def step(self, t, state, memory):
        q = state.attitude.as_quaternion().q
        error = jnp.copysign(1.0, q[0]) * q[1:]
        rate = self.model.relative_rate(state)
        size, speed = jnp.linalg.norm(error), jnp.linalg.norm(rate)
        scale = _bilinear(self.table, 3 * size, 40 * speed)
        surface = rate + 2 * scale * self.slope * error
        ring = memory.ring.at[memory.head].set(error)
        head = (memory.head + 1) % 6
        spread = jnp.max(ring, axis=0) - jnp.min(ring, axis=0)
        alarms = jnp.where(spread > 0.5, True, memory.alarms & (spread > 0.1))
        phase = self._phase(memory, size, speed, alarms)
        integral = memory.integral + self.period * error
        if self.unwind:
            blocked = (jnp.abs(integral) > 1.0) & (integral * error > 0)
            integral = jnp.where(blocked, memory.integral, integral)
        integral = jax.lax.select(phase == Phase.HOLD, integral, 0.5 * memory.integral)
        width = jnp.select([phase == Phase.HOLD, phase == Phase.SLEW], [0.01, 0.03], 0.2)
        bent = jnp.arctan(surface / width) * (2 / jnp.pi)
        inertia = self.model.spacecraft.inertia
        gyric = jnp.cross(state.omega, inertia @ state.omega)
        torque = gyric - self.gain * bent - self.ki * integral
        torque = jax.lax.switch(
            jnp.minimum(phase, 3),
            [
                lambda u: u - 0.5 * rate,
                lambda u: u,
                lambda u: u - jnp.where(jnp.abs(rate) < 1e-4, 0.0, 0.2 * rate),
                lambda u: -0.3 * rate,
            ],
            torque,
        )
        samples = jnp.where(phase == memory.phase, memory.samples + 1, 0)
        made = TableMemory(phase, samples, integral, ring, head, alarms)
        return self._limited(torque), made

    def _phase(self, memory, size, speed, alarms):
        """Return the phase, with hysteresis between all of them."""
        settled = (size < 0.05) & (speed < 0.005)
        lasted = memory.samples > 4
        after_rate = jnp.where(speed < 0.1, Phase.SLEW, Phase.RATE)
        after_slew = jnp.where(settled & lasted, Phase.HOLD, Phase.SLEW)
        after_slew = jnp.where(speed > 0.2, Phase.RATE, after_slew)
        after_hold = jnp.where((size > 0.15) | (speed > 0.03), Phase.SLEW, Phase.HOLD)
        after_safe = jnp.where(jnp.any(alarms) | ~lasted, Phase.SAFE, Phase.RATE)
        phases = jnp.stack([after_rate, after_slew, after_hold])
        following = jnp.where(
            memory.phase == Phase.SAFE, after_safe, phases[jnp.clip(memory.phase, 0, 2)]
        )
        return jnp.where(jnp.all(alarms), Phase.SAFE, following)

    def _limited(self, torque):
        """Return the torque times the largest share that is allowed, found by bisection."""

        def allowed(share):
            return jnp.sum((share * torque) ** 2) <= self.most**2

        def goes_on(carry):
            low, high, count = carry
            return (high - low > 1e-3) & (count < 20)

        def halve(carry):
            low, high, count = carry
            middle = 0.5 * (low + high)
            fits = allowed(middle)
            return jnp.where(fits, middle, low), jnp.where(fits, high, middle), count + 1

        low, _, _ = jax.lax.while_loop(goes_on, halve, (0.0, 1.0, 0))
        return jnp.where(allowed(1.0), torque, low * torque)


def _bilinear(table, row, column):
    """Return the entry between entries of a table."""
    rows, columns = table.shape
    row = jnp.clip(row, 0.0, rows - 1.0)
    column = jnp.clip(column, 0.0, columns - 1.0)
    i = jnp.minimum(row.astype(int), rows - 2)
    j = jnp.minimum(column.astype(int), columns - 2)
    a, b = row - i, column - j
    block = jax.lax.dynamic_slice(table, (i, j), (2, 2))
    return jnp.array([1 - a, a]) @ block @ jnp.array([1 - b, b])
