"""Laws written after docs/your-own-law.md, each odd in another way: whole numbers of all types,
remainders, arrays set in loops, tables, names of the C library and texts that are no comments."""

import enum
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxsat import AbstractSampledController, LawDeclaration, RigidBody
from jaxsat.core.declaration import number

KEYS = (
    number("period_s", "Time between samples", "s", above=0, default=0.5),
    number("gain", "Gain on the rates, 100% of it */ \\ ", "N m s", above=0, tunable=True),
)


class AbstractOdd(AbstractSampledController):
    """A law with one gain."""

    model: RigidBody
    period: Array
    gain: Array

    @classmethod
    def from_table(cls, values, context):
        return cls(context.model, jnp.asarray(values["period_s"]), jnp.asarray(values["gain"]))


class Ring(NamedTuple):
    """A ring of rates; `head` is unsigned."""

    head: jax.Array
    rates: jax.Array
    seen: jax.Array
    nothing: jax.Array
    total: jax.Array


class RingBuffer(AbstractOdd):
    """Median of a ring, whose index is an unsigned remainder ("a % b") /* nested */ %s %n ??/."""

    declaration = LawDeclaration(summary="ring buffer", keys=KEYS, torques=3)

    def init(self, state):
        """Nothing was seen."""
        return Ring(
            jnp.uint32(0), jnp.zeros((5, 3)), jnp.zeros(5, bool), jnp.zeros((0, 4)), jnp.uint8(0)
        )

    def step(self, t, state, memory):
        rate = self.model.relative_rate(state)
        place = memory.head % 5
        rates = memory.rates.at[place].set(rate)
        seen = memory.seen.at[place].set(True)
        middle = qsort(rates, seen)
        turn = memory.head % jnp.uint32(7)
        kick = jnp.where(turn == 0, 0.9, jnp.where(turn > 3, 1.0, 1.1))
        even = memory.head % 2 == 0
        size = abs_(middle)
        total = memory.total + jnp.clip(jnp.floor(size * 1e3), 0, 255).astype(jnp.uint8)
        wrapped = (memory.total % 3).astype(float) / 3.0
        torque = -self.gain * kick * jnp.where(even, rate, middle) * (1.0 - 0.1 * wrapped)
        return torque, Ring(memory.head + 1, rates, seen, 2 * memory.nothing, total)


def qsort(rates, seen):
    'Insertion sort of columns: "rates" that were `seen`; the others count as inf.'
    column = jnp.where(seen[:, None], rates, jnp.inf)

    def outer(i, x):
        def inner(j, x):
            k = i - j
            swap = (k > 0) & (x[k] < x[jnp.maximum(k - 1, 0)])
            low = jnp.where(swap, x[k], x[jnp.maximum(k - 1, 0)])
            high = jnp.where(swap, x[jnp.maximum(k - 1, 0)], x[k])
            y = x.at[k].set(high).at[jnp.maximum(k - 1, 0)].set(low)
            return jnp.where(k > 0, y, x)

        return jax.lax.fori_loop(0, 5, inner, x)

    column = jax.lax.fori_loop(1, 5, outer, column)
    count = jnp.sum(seen.astype(jnp.int32))
    return column[(count - 1) // 2]


def abs_(x):
    return jnp.sqrt(jnp.sum(x * x))


class Quantised(AbstractSampledController):
    """Rates as whole counts of an encoder: casts of doubles to int32, int16, uint8 and back.

    Not printed.
    """

    declaration = LawDeclaration(
        summary="quantised",
        keys=(*KEYS, number("levels", "Levels", "1", above=0, default=500.0, tunable=True)),
        torques=3,
    )
    model: RigidBody
    period: Array
    gain: Array
    levels: Array

    @classmethod
    def from_table(cls, values, context):
        return cls(
            context.model,
            *(jnp.asarray(values[key]) for key in ("period_s", "gain", "levels")),
        )

    def init(self, state):
        return {
            "int": jnp.zeros(3, jnp.int32), "short": jnp.zeros(3, jnp.int16),
            "long": jnp.zeros((), int), "bits": jnp.zeros((), jnp.uint32),
        }  # fmt: skip

    def step(self, t, state, memory):
        counts = lround(state.omega * self.levels)
        small = jnp.clip(counts, -128, 127).astype(jnp.int8)
        short = (state.omega * 2**15).astype(jnp.int16)
        change = counts - memory["int"]
        wide = memory["long"] + jnp.sum(change.astype(int) ** 2)
        bits = (memory["bits"] << 1) | (change[0] > 0).astype(jnp.uint32)
        bits = jnp.where(jax.lax.population_count(bits) % 4 == 0, bits ^ 0x5A5A, bits >> 1)
        history = random(bits)
        size = jnp.sum(jnp.abs(small).astype(jnp.int32)) // 3
        scale = jnp.where(size > 20, 1.5, jnp.where(size % 2 == 1, 1.0, 0.75))
        fine = (short - memory["short"]).astype(float) / 2**15
        part = (wide % 1000).astype(float) * 1e-6
        torque = -self.gain * scale * (counts / self.levels + 0.1 * fine) - part * history
        sixth = jnp.remainder(counts, 6) - 3
        torque = torque - 1e-4 * jnp.sign(sixth) * jnp.round(state.omega * 7.0)
        later = {"int": counts, "short": short, "long": wide, "bits": bits}
        return torque, later


def lround(x):
    """Rounds "half away" -- {braces}, `ticks`, <tags>, $\\frac{1}{2}$ and a tab\t."""
    return jnp.where(x < 0, jnp.ceil(x - 0.5), jnp.floor(x + 0.5)).astype(jnp.int32)


def random(seed):
    """Linear congruence, 8 times; @return three numbers"""

    def body(x, _):
        x = x * jnp.uint32(1664525) + jnp.uint32(1013904223)
        return x, (x >> 8).astype(float) / 2**24

    _, numbers = jax.lax.scan(body, seed, None, length=8)
    return numbers[:3] - numbers[3:6] * numbers[6]


class Phase(enum.IntEnum):
    """Of the law, with words of C."""

    default = 0
    switch = 7
    volatile = -2


class Lookups(NamedTuple):
    """Phase, table, covariance of the rates ((rad/s)²), how many samples there were, and in which
    the rates were large."""

    phase: jax.Array
    table: jax.Array
    covariance: jax.Array
    count: jax.Array
    large: jax.Array


class Tabulated(AbstractOdd):
    """A gain by table look-up, a Kalman filter with loops, and roots that may be NaN."""

    declaration = LawDeclaration(summary="tabulated", keys=KEYS, torques=3)
    modes: ClassVar[type[enum.IntEnum]] = Phase

    def init(self, state):
        table = jnp.linspace(0.5, 2.0, 9) ** 2
        count = jnp.zeros((), int)
        return Lookups(jnp.array(Phase.default), table, jnp.eye(3) * 0.1, count, jnp.zeros(3, int))

    def mode(self, memory):
        return memory.phase

    def step(self, t, state, memory):
        omega = state.omega
        q = state.attitude.as_quaternion().q
        size = jnp.linalg.norm(omega)
        gain = interpolate(size * 40.0, memory.table)
        covariance = cholesky(
            memory.covariance + 1e-3 * jnp.outer(omega, omega) + 1e-6 * jnp.eye(3)
        )
        direction = jnp.where(size > 1e-3, omega / size, 0.0)
        angle = jnp.where(jnp.abs(q[0]) < 1.0, 2.0 * jnp.arccos(q[0]), 0.0)
        log = jnp.where(
            angle > 0.1, jnp.log(angle - 0.1), jnp.where(size > 0, jnp.log(size), -40.0)
        )

        def upper(x):
            return jax.lax.cond(
                x[0] > 0,
                lambda x: jax.lax.cond(x[1] > 0, lambda x: x * 2.0, lambda x: x / 3.0, x),
                lambda x: jax.lax.cond(x[2] > x[1], lambda x: x[::-1], lambda x: -x, x),
                x,
            )

        turned = upper(direction)
        phase = jnp.where(
            size > 0.05,
            Phase.switch,
            jnp.where(memory.count % 10 == 9, Phase.volatile, memory.phase),
        )
        table = memory.table.at[memory.count % 9].add(1e-3 * jnp.tanh(log))
        solved = substitute(covariance, turned)
        torque = -self.gain * (gain * omega + 1e-3 * jnp.clip(solved, -1, 1) + 0.01 * angle * q[1:])
        torque = jnp.where(phase == Phase.volatile, 0.5 * torque, torque)
        p = covariance @ covariance.T
        turn = (memory.count - 3) // 5 % jnp.where(memory.large[0] > 9, memory.large[0], 3)
        large = memory.large.at[turn].add(size > 0.02)
        return torque, Lookups(phase, table, 0.9 * p, memory.count + 1, large)


def interpolate(x, y):
    """Linear, between entries of a table; x = NaN gives the first."""
    index = jnp.clip(jnp.nan_to_num(x, nan=0.0), 0, y.shape[0] - 2)
    low = index.astype(int)
    part = index - jnp.floor(index)
    return (1 - part) * y[low] + part * jax.lax.dynamic_index_in_dim(y, low + 1, keepdims=False)


def cholesky(a):
    """L of a = L Lᵀ by loops that set an array."""
    n = a.shape[0]

    def column(j, lower):
        def row(i, lower):
            rest = a[i, j] - jnp.sum(jnp.where(jnp.arange(n) < j, lower[i] * lower[j], 0.0))
            root = jnp.sqrt(jnp.maximum(rest, 1e-12))
            value = jnp.where(i == j, root, jnp.where(i > j, rest / lower[j, j], 0.0))
            return lower.at[i, j].set(jnp.where(i < j, 0.0, value))

        return jax.lax.fori_loop(0, n, row, lower)

    return jax.lax.fori_loop(0, n, column, jnp.zeros((n, n)))


def substitute(lower, b):
    """Forward substitution in a while loop with a bound."""

    def condition(carry):
        i, x = carry
        return (i < 3) & (jnp.sum(jnp.abs(x)) < 1e6)

    def body(carry):
        i, x = carry
        rest = b[i] - jnp.sum(jnp.where(jnp.arange(3) < i, lower[i] * x, 0.0))
        return i + 1, x.at[i].set(rest / lower[i, i])

    return jax.lax.while_loop(condition, body, (0, jnp.zeros(3)))[1]


class Long(AbstractOdd):
    """A filter over 40 samples whose coefficients are set in a loop; more than any unrolling."""

    declaration = LawDeclaration(summary="long", keys=KEYS, torques=3)

    def init(self, state):
        return (jnp.zeros((40, 3)), jnp.zeros((), jnp.int32))

    def step(self, t, state, memory):
        history, count = memory
        size = jnp.sqrt(jnp.sum(state.omega**2))

        def fill(i, window):
            before = window[jnp.maximum(i - 1, 0)]
            return window.at[i].set(
                jnp.where(i == 0, 1.0, before * (0.9 + 0.05 * jnp.cos(size * i)))
            )

        window = jax.lax.fori_loop(0, 40, fill, jnp.zeros(40))
        history = history.at[count % 40].set(state.omega)

        def gather(i, total):
            return total + window[i] * history[(count - i) % 40]

        mean = jax.lax.fori_loop(0, 40, gather, jnp.zeros(3)) / jnp.sum(window)

        def bubble(i, x):
            low, high = jnp.minimum(x[i], x[i + 1]), jnp.maximum(x[i], x[i + 1])
            return x.at[i].set(low).at[i + 1].set(high)

        sizes = jnp.sqrt(jnp.sum(history**2, axis=1))
        ordered = jax.lax.fori_loop(0, 39, bubble, sizes)
        worst = ordered[39]
        chosen = jnp.take(window, jnp.argmax(sizes))
        return -self.gain * (mean + 0.1 * state.omega) / (1.0 + worst + chosen), (
            history,
            count + 1,
        )
