"""Modulation of duties into pulses: opening and closing times of valves in a period.

Every modulator runs once a period. Schmitt triggers and pulse widths after Wie, Space Vehicle
Dynamics and Control (2nd ed., 2008), section 9.4.
"""

import abc
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import concrete, positive, require_counts


class Pulses(NamedTuple):
    """Valve commands of a period: open from `on` to `off` (s from the sample), at `level`.

    Rows are a thruster's pulses in ascending order; one with `off` no later than `on` is void. The
    level is 1 for on-off valves, less for a throttle.
    """

    on: Float[Array, "p m"]
    off: Float[Array, "p m"]
    level: Float[Array, "p m"]


class AbstractModulation(eqx.Module):
    """Map from duties (mean fractions of full thrust over a period) to pulses."""

    @abc.abstractmethod
    def init(self, count: int) -> PyTree:
        """Return the modulator's initial memory for `count` thrusters."""

    @abc.abstractmethod
    def __call__(
        self,
        duty: Float[Array, " m"],
        memory: PyTree,
        period: RealScalar,
        min_on_time: Float[Array, " m"],
    ) -> tuple[Pulses, PyTree]:
        """Return the pulses of the period that begins now, and the next memory."""

    @abc.abstractmethod
    def edges(self, between: int, count: int) -> int:
        """Return the largest total number of valve switchings strictly inside a period.

        At most `between` thrusters of `count` have a duty between 0 and 1.
        """

    def counts_openings(self) -> bool:
        """Whether valves open and shut, so that openings are countable."""
        return True


def _one_pulse(width: Float[Array, " m"]) -> Pulses:
    """Return pulses of these widths (s) from the begin of the period."""
    return Pulses(jnp.zeros_like(width)[None], width[None], jnp.ones_like(width)[None])


class IdealThrottle(AbstractModulation):
    """A throttle without modulation: thrust equal to the duty for the whole period."""

    def init(self, count: int) -> None:
        """Return None: a throttle has no memory."""
        return

    def __call__(self, duty, memory, period, min_on_time):
        """Return one pulse over the whole period, with the duty as its level."""
        pulses = _one_pulse(jnp.zeros_like(duty) + period)
        return pulses._replace(level=duty[None]), memory

    def edges(self, between: int, count: int) -> int:
        """Return the number of valve switchings inside a period: zero."""
        return 0

    def counts_openings(self) -> bool:
        """Whether openings are countable: not for a throttle."""
        return False


class PulseWidth(AbstractModulation):
    """Pulse-width modulation: one pulse as long as its duty, none below the minimum on-time."""

    def init(self, count: int) -> None:
        """Return None: pulse-width modulation has no memory."""
        return

    def __call__(self, duty, memory, period, min_on_time):
        """Return one pulse, from the begin of the period."""
        width = duty * period
        return _one_pulse(jnp.where(width >= min_on_time, width, 0.0)), memory

    def edges(self, between: int, count: int) -> int:
        """Return the largest number of valve switchings: one for each duty between 0 and 1."""
        return between


class DeltaSigma(AbstractModulation):
    """ΔΣ modulation: accumulated on-time is released in multiples of the minimum on-time.

    One that fills a period is released whole. The rest stays, so the mean thrust has no dead zone.
    """

    def init(self, count: int) -> Float[Array, " m"]:
        """Return the accumulated on-time at the start (s): zero."""
        return jnp.zeros(count)

    def __call__(self, duty, memory, period, min_on_time):
        """Return one pulse, from the begin of the period."""
        owed = memory + duty * period
        whole = jnp.floor(owed / min_on_time * (1 + 1e-12))
        width = jnp.where(owed >= period * (1 - 1e-12), period, whole * min_on_time)
        return _one_pulse(width), jnp.minimum(owed - width, period)

    def edges(self, between: int, count: int) -> int:
        """Return the largest number of valve switchings: any thruster may shut once."""
        return count


class PulseWidthPulseFrequency(AbstractModulation):
    """PWPF modulation: a Schmitt trigger behind a lag, with feedback of the thrust.

    With r the duty and y the valve, 0 or 1, the lag obeys df/dt = (`gain` (r - y) - f) /
    `time_constant`; the valve opens at f >= `on_level` and shuts at f <= `off_level`. Duties are
    held over a period, so f is exponential between switchings, whose instants are exact.
    `switchings` bounds their number in a period, see `of`. The mean thrust follows duties above
    `on_level` / `gain`.
    """

    gain: RealScalar = eqx.field(converter=positive("gain"))
    time_constant: RealScalar = eqx.field(converter=positive("time_constant"))
    on_level: RealScalar = eqx.field(converter=positive("on_level"))
    off_level: RealScalar = eqx.field(converter=positive("off_level"))
    switchings: int = eqx.field(static=True, default=4)

    def __check_init__(self):
        gain, high, low = (concrete(x) for x in (self.gain, self.on_level, self.off_level))
        if gain is not None and high is not None and low is not None and not low < high < gain:
            raise ValueError(
                "Arguments `off_level`, `on_level` and `gain` must ascend, but got "
                f"{low}, {high} and {gain}."
            )
        require_counts(switchings=self.switchings)

    @classmethod
    def of(
        cls, period: float, gain: float, time_constant: float, on_level: float, off_level: float
    ) -> "PulseWidthPulseFrequency":
        """Return the modulator with all switchings that a period (s) can have, duties in [0, 1]."""
        duties = np.linspace(on_level / gain, 1, 1001)[1:]
        discharge, charge = gain * (1 - duties), gain * duties
        pulse = np.log((on_level + discharge) / (off_level + discharge))
        pause = np.log((charge - off_level) / (charge - on_level))
        shortest = time_constant * float(np.min(pulse + pause)) * (1 - 1e-3)
        return cls(gain, time_constant, on_level, off_level, 2 * int(period / shortest) + 2)

    def init(self, count: int) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
        """Return the lag's output and the valves (1 open) at the start: zeros."""
        return jnp.zeros(count), jnp.zeros(count)

    def __call__(self, duty, memory, period, min_on_time):
        """Return the pulses of all switchings in a period, and the next memory."""
        was_open = memory[1]

        def switch(carry, _):
            now, output, valve = carry
            end = self.gain * (duty - valve)
            level = jnp.where(valve > 0, self.off_level, self.on_level)
            wait = self._wait(output, end, level, valve)
            switches = now + wait < period
            length = jnp.where(switches, wait, period - now)
            free = end + (output - end) * jnp.exp(-length / self.time_constant)
            output = jnp.where(switches, level, free)
            now = jnp.where(switches, now + length, period)
            return (now, output, jnp.where(switches, 1 - valve, valve)), now

        first = (jnp.zeros_like(duty), *memory)
        (_, *after), instants = jax.lax.scan(switch, first, length=self.switchings)
        return self._pulses(list(instants), was_open, period), tuple(after)

    def _wait(self, output, end, level, valve):
        """Return the time (s) until the lag's output reaches the level; infinite if never."""
        way = jnp.where(valve > 0, -1.0, 1.0)
        there = way * (output - level) >= 0
        comes = way * (end - level) > 0
        quotient = jnp.where(comes & ~there, (end - output) / (end - level), 1.0)
        wait = self.time_constant * jnp.log(quotient)
        return jnp.where(there, 0.0, jnp.where(comes, wait, jnp.inf))

    def _pulses(self, instants, was_open, period):
        """Return pulses between switchings; an open valve's first one begins with the period."""
        bounds = [jnp.zeros_like(was_open), *instants, jnp.zeros_like(was_open) + period]
        bounds.append(bounds[-1])
        on, off = [], []
        for first in range(0, len(bounds) - 2, 2):
            on.append(jnp.where(was_open > 0, bounds[first], bounds[first + 1]))
            off.append(jnp.where(was_open > 0, bounds[first + 1], bounds[first + 2]))
        begins, ends = jnp.stack(on), jnp.stack(off)
        return Pulses(begins, ends, jnp.ones_like(begins))

    def edges(self, between: int, count: int) -> int:
        """Return the largest number of switchings: a valve also switches as its lag decays."""
        return count * self.switchings
