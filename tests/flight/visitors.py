"""Three laws written after docs/your-own-law.md: tables, a bounded search, and filters."""

import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat import LawDeclaration
from jaxsat.core.declaration import choice, number, switch
from tests.flight.law_frame import PERIOD, AbstractVisitor, attitude_error


class Regime(enum.IntEnum):
    """How far the body is from its target."""

    FAR = 0
    NEAR = 1
    FINE = 2


class ScheduleMemory(NamedTuple):
    """The regime, samples in it, and the integral of the error."""

    regime: jax.Array
    samples: jax.Array
    integral: jax.Array


class ScheduledPD(AbstractVisitor):
    """PD with gains of a table over the error, and another law in each of three regimes."""

    declaration = LawDeclaration(
        summary="gain-scheduled PD",
        keys=(
            PERIOD,
            number("kp", "Gain on the attitude", "N m", above=0, tunable=True),
            number("kd", "Gain on the rate", "N m s", above=0, tunable=True),
            number("ki", "Gain on the integral", "N m/s", at_least=0, default=0.01),
            choice("table", "Between the gains", ("linear", "steps"), "linear"),
        ),
        torques=3,
    )
    modes: ClassVar[type[enum.IntEnum]] = Regime

    kp: jax.Array
    kd: jax.Array
    ki: jax.Array
    errors: jax.Array
    scales: jax.Array
    linear: bool = eqx.field(static=True)

    @classmethod
    def from_table(cls, values, context):
        errors = jnp.array([0.0, 0.02, 0.1, 0.3, 0.6, 1.0])
        scales = jnp.array([[2.0, 1.5, 1.2, 1.0, 0.8, 0.5], [1.0, 1.1, 1.2, 1.3, 1.5, 2.0]])
        return cls(context.model, *cls.numbers(values), errors, scales, values["table"] == "linear")

    def init(self, state):
        return ScheduleMemory(jnp.array(Regime.FAR), jnp.array(0), jnp.zeros(3))

    def mode(self, memory):
        return memory.regime

    def telemetry(self, memory):
        return {"integral": memory.integral}

    def step(self, t, state, memory):
        error = attitude_error(state)
        rate = self.model.relative_rate(state)
        size = jnp.linalg.norm(error)
        if self.linear:
            factors = jax.vmap(lambda row: jnp.interp(size, self.errors, row))(self.scales)
        else:
            place = jnp.clip(jnp.searchsorted(self.errors, size) - 1, 0, 5)
            factors = self.scales[:, place]
        regime = memory.regime
        regime = jnp.where((regime == Regime.FAR) & (size < 0.3), Regime.NEAR, regime)
        ready = (regime == Regime.NEAR) & (size < 0.03) & (memory.samples > 8)
        regime = jnp.where(ready, Regime.FINE, regime)
        regime = jnp.where((regime != Regime.FAR) & (size > 0.5), Regime.FAR, regime)
        kp, kd = self.kp * factors[0], self.kd * factors[1]

        def far(integral):
            speed = jnp.linalg.norm(rate)
            drive = jax.lax.cond(speed > 0.1, lambda x: 0.0 * x, lambda x: x, -kp * error)
            return drive - kd * rate, jnp.zeros_like(integral)

        def near(integral):
            return -kp * error - kd * rate, 0.9 * integral

        def fine(integral):
            more = jnp.clip(integral + self.period * error, -0.5, 0.5)
            return -kp * error - kd * rate - self.ki * more, more

        torque, integral = jax.lax.switch(regime, [far, near, fine], memory.integral)
        samples = jnp.where(regime == memory.regime, memory.samples + 1, 0)
        return torque, ScheduleMemory(regime, samples, integral)


class SlidingMemory(NamedTuple):
    """The width of the layer, crossings of the surface, its last sign, and how long none."""

    width: jax.Array
    crossings: jax.Array
    signs: jax.Array
    quiet: jax.Array


class SlidingMode(AbstractVisitor):
    """Sliding mode, whose boundary layer a bounded search widens until the torque is allowed."""

    declaration = LawDeclaration(
        summary="sliding mode",
        keys=(
            PERIOD,
            number("slope", "Slope of the surface", "1/s", above=0, tunable=True),
            number("gain", "Torque of the switch", "N m", above=0, tunable=True),
            number("most", "Largest norm of the torque", "N m", above=0, default=1.0),
            switch("adaptive", "Widen the layer after crossings", default=True),
        ),
        torques=3,
    )

    slope: jax.Array
    gain: jax.Array
    most: jax.Array
    adaptive: bool = eqx.field(static=True)

    @classmethod
    def from_table(cls, values, context):
        return cls(context.model, *cls.numbers(values), values["adaptive"])

    def init(self, state):
        zero = jnp.zeros(3, int)
        return SlidingMemory(jnp.full(3, 0.02), zero, zero, jnp.array(0))

    def step(self, t, state, memory):
        error = attitude_error(state)
        rate = self.model.relative_rate(state)
        surface = rate + 2 * self.slope * error
        inertia = self.model.spacecraft.inertia
        equivalent = jnp.cross(state.omega, inertia @ state.omega) - self.slope * inertia @ rate
        signs = jnp.sign(surface).astype(int)
        crossed = (signs * memory.signs) < 0
        crossings = jnp.where(crossed, memory.crossings + 1, memory.crossings)
        quiet = jnp.where(jnp.any(crossed), 0, memory.quiet + 1)
        crossings = jnp.where(quiet > 40, jnp.maximum(crossings - 1, 0), crossings)
        width = memory.width
        if self.adaptive:
            width = jnp.where(crossings > 6, jnp.minimum(1.5 * width, 0.5), width)
            width = jnp.where(crossings == 0, jnp.maximum(0.9 * width, 0.005), width)
            crossings = jnp.where(crossings > 6, 0, crossings)

        def torque(w):
            ratio = surface / w
            switched = jnp.where(jnp.abs(ratio) < 1, ratio, jnp.sign(ratio))
            return equivalent - self.gain * switched

        def goes_on(carry):
            tries, w = carry
            return (tries < 12) & (jnp.sum(torque(w) ** 2) > self.most**2)

        def wider(carry):
            tries, w = carry
            return tries + 1, 1.4 * w

        tries, used = jax.lax.while_loop(goes_on, wider, (jnp.array(0), width))
        command = torque(used)
        size = jnp.sqrt(jnp.sum(command**2))
        command = jnp.where((tries >= 12) & (size > self.most), command * self.most / size, command)
        return command, SlidingMemory(width, crossings, signs, quiet)


class FilterMemory(NamedTuple):
    """States of the sections (section, order, axis), and a window of rates with its place."""

    sections: jax.Array
    window: jax.Array
    place: jax.Array


class Notched(AbstractVisitor):
    """PD behind a cascade of second-order filters, and a median of the last rates."""

    declaration = LawDeclaration(
        summary="PD with notch filters",
        keys=(
            PERIOD,
            number("kp", "Gain on the attitude", "N m", above=0, tunable=True),
            number("kd", "Gain on the rate", "N m s", above=0, tunable=True),
            number("notch_rad_s", "Centre of the first notch", "rad/s", above=0, default=3.0),
        ),
        torques=3,
    )

    kp: jax.Array
    kd: jax.Array
    notch: jax.Array

    def init(self, state):
        return FilterMemory(jnp.zeros((3, 2, 3)), jnp.zeros((5, 3)), jnp.array(0))

    def step(self, t, state, memory):
        rate = self.model.relative_rate(state)
        window = memory.window.at[memory.place].set(rate)
        median = jnp.sort(window, axis=0)[2]
        filled = memory.place >= 4
        rate = jnp.where(filled & (jnp.abs(rate - median) > 0.05), median, rate)
        raw = -self.kp * attitude_error(state) - self.kd * rate
        centres = self.notch * jnp.array([1.0, 1.7, 2.6])

        def section(signal, given):
            centre, kept = given
            angle = jnp.minimum(centre * self.period, 3.0)
            c = jnp.cos(angle)
            a = jnp.array([[1.8 * c, -0.81], [1.0, 0.0]])
            b = jnp.array([1.0, 0.0])
            out = jnp.array([1.8 * c - 2.0 * c, 1.0 - 0.81])
            result = out @ kept + signal
            return result, a @ kept + b[:, None] * signal[None]

        torque, sections = jax.lax.scan(section, raw, (centres, memory.sections))
        gain = (1.81 - 1.8 * jnp.cos(centres * self.period)) / (
            2 - 2 * jnp.cos(centres * self.period)
        )
        torque = torque * jnp.prod(jnp.clip(gain, 0.2, 5.0))
        place = jnp.where(memory.place < 4, memory.place + 1, 0)
        return torque, FilterMemory(sections, window, place)
