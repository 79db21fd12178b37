"""Sampled laws for tests of the export: one with much in it, one that cannot be exported."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft


class FilteredMemory(NamedTuple):
    """The last `rates` (rad/s) of each axis, and how many samples there were."""

    rates: Float[Array, "5 3"]
    samples: Array
    turned: Array


class Filtered(AbstractSampledController):
    """Feedback of rates filtered over some samples; `gain` is in N m s.

    It has what C must get right: */ in words, branches, bounded loops, arrays that are indexed by
    what is computed, whole numbers that wrap, elementary functions far from zero.
    """

    gain: Float[Array, "2"] = eqx.field(converter=as_float)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state: PlantState) -> FilteredMemory:
        """No rates yet."""
        return FilteredMemory(jnp.zeros((5, 3)), jnp.array(0), jnp.array(False))

    def step(self, t, state, memory):
        """The filtered feedback, bent by functions of all kinds."""
        rates = jnp.roll(memory.rates, 1, axis=0).at[0].set(state.omega)

        def weighted(total, number):
            place = (number * 7 + memory.samples) % 5
            return total + jnp.exp(-number / 3.0) * rates[place], None

        total = jax.lax.scan(weighted, jnp.zeros(3), jnp.arange(40))[0]
        total = jax.lax.cond(
            jnp.abs(state.omega[2]) > 0.01,
            lambda x: x + jnp.sin(1e6 * x) * jnp.cos(x) ** 2,
            lambda x: jnp.tanh(x) + jnp.arctan2(x, 1 + t),
            total,
        )

        def goes_on(carry):
            return (carry[0] < 30) & (carry[1] > 1e-3)

        _, left = jax.lax.while_loop(goes_on, lambda c: (c[0] + 1, c[1] * 0.7), (0, total[0] ** 2))
        mixed = memory.samples * 1103515245 + 12345
        bent = jnp.sign(total[:2]) * jnp.abs(total[:2]) ** 1.3 + left + (mixed % 7) * 1e-6
        turned = memory.turned ^ (jnp.max(total) > 0)
        command = -self.gain * jnp.clip(bent, -1.0, 1.0) * jnp.where(turned, 1.0, 0.5)
        return command, FilteredMemory(rates, memory.samples + 1, turned)


class Searching(Filtered):
    """A law whose loop goes on until it has found something."""

    def step(self, t, state, memory):
        """Halved until it is small enough."""
        found = jax.lax.while_loop(lambda x: x > 1e-3, lambda x: x / 2, state.omega[0] ** 2)
        return self.gain * found, memory


class SlicedMemory(NamedTuple):
    """Matrices whose rows are longer than what is read of them, or written into them at once."""

    square: Float[Array, "4 4"]
    powers: Float[Array, "2 4 4"]
    joined: Float[Array, "3 7"]


class Sliced(AbstractSampledController):
    """Feedback through products of parts of matrices: their rows have the length of the whole."""

    gain: Float[Array, "2"] = eqx.field(converter=as_float)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state: PlantState) -> SlicedMemory:
        """Matrices of which no two elements are alike."""
        numbers = jnp.arange(16.0).reshape(4, 4) / 16
        joined = 1 / (3.0 + jnp.arange(21.0).reshape(3, 7))
        return SlicedMemory(numbers, jnp.stack([numbers, numbers.T]), joined)

    def step(self, t, state, memory):
        """Parts of what is computed, remembered, handed over, and given back."""
        rates = state.omega / (0.1 + jnp.sqrt(jnp.sum(state.omega**2)))
        q = state.attitude.as_quaternion().q
        square = _shrunk(memory.square + jnp.outer(q, q)) @ memory.powers[0]
        seen = square[:, :3] @ rates
        first, one = _power(memory.powers[0] + square, rates)
        second, other = _power(memory.powers[1] + jnp.outer(q, q), seen[:3])
        left = _shrunk(memory.joined[:, :4]) @ square
        joined = jnp.concatenate([left, _gram(memory.joined[:, 1:4])], axis=1)
        command = -self.gain * (seen[:2] + one[2:] + other[:2] + joined[:2, 5])
        return command, SlicedMemory(square, jnp.stack([first, second]), joined)


def _shrunk(matrix):
    return matrix / jnp.sqrt(1.0 + jnp.sum(matrix**2))


def _power(matrix, x):
    """A product, and what it makes of a vector that is shorter than its rows."""
    power = _shrunk(matrix) @ matrix.T
    return power, power[:, :3] @ x


def _gram(rows):
    """A function of its own that is given a part of each row alone."""
    for _ in range(3):
        rows = _shrunk(rows @ rows.T)
    return rows


def loop_of(law: AbstractSampledController) -> SampledLoop:
    """A spacecraft under a law, told the truth."""
    plant = RigidBody(Spacecraft(as_float([449.5, 264.6, 312.5])), ExactOrbit(1.1e-3))
    axes = jnp.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    return SampledLoop(plant.with_effectors((Actuators(axes, jnp.eye(2), 2.0),)), law, substeps=1)


def start() -> PlantState:
    """A slow tumble."""
    return PlantState(Quaternion(as_float([0.5, 0.5, -0.5, 0.5])), as_float([0.01, -0.02, 0.015]))


class Clocked(AbstractSampledController):
    """It commands the time, and the time times a rate; its memory counts for nothing."""

    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state: PlantState) -> Array:
        """Nothing."""
        return jnp.zeros_like(state.omega[0])

    def step(self, t, state, memory):
        """Both."""
        return jnp.stack([t, t * state.omega[1]]), memory + t


class ScheduledMemory(NamedTuple):
    """How many samples there were."""

    samples: Array


class Scheduled(AbstractSampledController):
    """Feedback by rows of a table of gains, N m s: one by a count of samples, and all in turn."""

    gains: Float[Array, "20 2 3"] = eqx.field(converter=as_float)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state: PlantState) -> ScheduledMemory:
        """No sample yet."""
        return ScheduledMemory(jnp.array(0))

    def step(self, t, state, memory):
        """Feedback by one row, limited by what all rows together make of it."""

        def larger(most, gain):
            command = gain @ state.omega
            return jnp.where(jnp.abs(command) > most, jnp.abs(command), most), None

        most = jax.lax.scan(larger, jnp.zeros(2), self.gains)[0]
        row = jax.lax.dynamic_index_in_dim(self.gains, memory.samples, keepdims=False)
        command = jnp.clip(-row @ state.omega, -0.9 * most, 0.9 * most)
        return command, ScheduledMemory(memory.samples + 1)
