"""Laws whose names, texts and memories would be wrong in C if they were copied as they stand."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.checks import as_float


class AbstractHostile(AbstractSampledController):
    """Feedback of rates; `gain` is in N m s."""

    gain: Float[Array, "2"] = eqx.field(converter=as_float)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)


class Parts(NamedTuple):
    """Arrays without elements beside one that has some."""

    first: Float[Array, "0"]
    rows: Float[Array, "0 3"]
    rate: Float[Array, "3"]
    last: tuple


class PartlyEmpty(AbstractHostile):
    """Its memory has arrays of size 0, which functions of its own take and give back."""

    bias: Float[Array, "0"] = eqx.field(converter=as_float, default=())

    def init(self, state):
        """Nothing, twice, and a rate."""
        return Parts(jnp.zeros(0), jnp.zeros((0, 3)), state.omega, ())

    def step(self, t, state, memory):
        """The mean of two rates."""
        rate, rows = _joined(memory.rate, memory.rows)
        other, rows = _joined(state.omega, rows)
        total = rate + other + jnp.sum(self.bias) + memory.rows.T @ memory.first
        return -self.gain * total[:2], Parts(2 * memory.first, rows, other, ())


def _joined(rate, rows):
    """A rate, and the sum of no rows."""
    for k in range(25):
        rate = rate - 0.05 * rate**3 / (1.0 + k * rate**2)
    return rate + jnp.sum(rows, axis=0), 2 * rows


class Empty(AbstractHostile):
    """Its memory is one array of size 0."""

    def init(self, state):
        """Nothing."""
        return jnp.zeros(0)

    def step(self, t, state, memory):
        """Damps."""
        return -self.gain * (state.omega[:2] + jnp.sum(memory)), memory


class Forgetful(AbstractHostile):
    """It has no memory at all."""

    def init(self, state):
        """None."""

    def step(self, t, state, memory):
        """Damps."""
        return -self.gain * state.omega[:2], None


KEYS = (
    "int", "*/ int x; /*", "", " ", "a b", "a_b", "ω", "1", "time", "sample", "begin_time",
    "unused", "key " * 40, "??/", "\\", "\n", "*\x01/", "//", "state", "next", "NULL", "errno",
)  # fmt: skip
"""Keys of a memory: its fields have names made of them, and comments with them."""


class Worded(AbstractHostile):
    'Damps */ int x; /* ??/ \\ // \x01 *\x01/ ?\x01?/ \u202e ∫ω² \U0001f6f0 %s %d " \t\n#error \\'

    def init(self, state):
        """A dictionary of keys that are no names."""
        return dict.fromkeys(KEYS, state.omega[:1])

    def step(self, t, state, memory):
        """Two functions of any words."""
        rate = größe(memcpy(state.omega)) + 0.1 * größe(memcpy(2 * state.omega))
        new = {key: 0.5 * value + rate[:1] for key, value in memory.items()}
        return -self.gain * (rate[:2] + sum(memory.values())), new


def größe(x):
    "*\x00/ #error ??/\n\n    Not the first paragraph */"
    for k in range(12):
        x = x - 0.05 * jnp.sin(x) / (1.0 + k * x**2)
    return x


def memcpy(main):
    "Ends with a stroke \\"
    for int32_t in range(12):
        main = main - 0.05 * main / (1.0 + int32_t * main**2)
    return main
