"""The fine stage: oscillate until all is small, then the orbital regulator, with hysteresis."""

import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.checks import as_float, require_positive
from jaxsat.control.estimators import EstimatorMemory, ThirdAxis, ThirdAxisEstimator
from jaxsat.control.normal_form import NormalForm, NormalState
from jaxsat.control.oscillatory import Oscillation, Oscillator, Slow, wanted_turn
from jaxsat.control.rate_tracking import clipped
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.terminal import OrbitalRegulator
from jaxsat.control.tilt import Tilt, tilt_of
from jaxsat.dynamics import PlantState

RealScalar = Float[Array, ""]


BALANCED = 0.01
"""Share of a drift of s below which the wanted turn has taken it away."""

HOLDING = 0.9
"""Share of the holder's largest ds/dt that may be needed against a drift."""


class FineMode(enum.IntEnum):
    """The modes of the fine stage; a supervisor's earlier phases are 1 and 2."""

    OSCILLATING = 3
    REGULATING = 4


class Handover(eqx.Module):
    """When the regulator takes over and when it hands back.

    It takes over when |w| and |ẑ| are below `enter_angle`, the slow rate |s| is below
    `enter_slow_rate` and |p1|, |p2| less their values at rest are below `enter_rate`; it hands back
    when |w| exceeds `leave_tilt`, |z| exceeds `leave_turn` or s exceeds its value at rest by
    `leave_rate` (rad, rad/s).
    """

    enter_slow_rate: RealScalar = eqx.field(converter=as_float)
    enter_rate: RealScalar = eqx.field(converter=as_float)
    enter_angle: RealScalar = eqx.field(converter=as_float, default=0.03)
    leave_tilt: RealScalar = eqx.field(converter=as_float, default=0.04)
    leave_turn: RealScalar = eqx.field(converter=as_float, default=0.045)
    leave_rate: RealScalar = eqx.field(converter=as_float, default=1e-3)

    def __check_init__(self):
        for name in ("enter_slow_rate", "enter_rate", "enter_angle"):
            require_positive(name, getattr(self, name))
        for name in ("leave_tilt", "leave_turn", "leave_rate"):
            require_positive(name, getattr(self, name))

    def __call__(
        self,
        regulating: Bool[Array, ""],
        tilt: Tilt,
        slow: Slow,
        excess: Float[Array, "3"],
    ) -> Bool[Array, ""]:
        """Whether the regulator is to work now, given whether it did.

        `excess` is (p1, p2, s) less its value at rest, rad/s.
        """
        enter = (
            (tilt.size < self.enter_angle)
            & (jnp.abs(slow.turn) < self.enter_angle)
            & (jnp.abs(slow.rate) < self.enter_slow_rate)
            & (jnp.abs(excess[0]) < self.enter_rate)
            & (jnp.abs(excess[1]) < self.enter_rate)
        )
        leave = (
            (tilt.size > self.leave_tilt)
            | (jnp.abs(tilt.turn) > self.leave_turn)
            | (jnp.abs(excess[2]) > self.leave_rate)
        )
        return jnp.where(regulating, ~leave, enter)


class FineMemory(NamedTuple):
    """The oscillation asked for last, and whether the regulator works."""

    oscillation: Oscillation
    regulating: Bool[Array, ""]


class FineStage(eqx.Module):
    """Oscillator and regulator with the hand-over between them.

    Where the wanted attitude can only be held against a drift of s, `holder` takes the regulator's
    place if it can make the opposite one by its oscillation.
    `fade_lean` takes the correction of the turn for leaning axes away as the tilt grows, by the
    factor max(0, 1 - |w|²).
    """

    oscillator: Oscillator
    end_game: OrbitalRegulator | Oscillator
    handover: Handover
    holder: Oscillator | None = None
    fade_lean: bool = eqx.field(static=True, default=False)

    def init(self, omega: Float[Array, "3"]) -> FineMemory:
        """At rest, oscillating."""
        return FineMemory(self.oscillator.init(omega), jnp.array(False))

    def step(
        self, clock: RealScalar, state: NormalState, third: ThirdAxis, memory: FineMemory
    ) -> tuple[Float[Array, "2"], Float[Array, "2"], FineMemory]:
        """The torque about x and y, not yet limited (N m), the rates asked for (rad/s), and the
        next memory."""
        tilt = tilt_of(state.attitude)
        if self.fade_lean:
            third = third._replace(lean=third.lean * jnp.maximum(0.0, 1 - tilt.size**2))
        slow = self.oscillator.slow(clock, tilt, third, memory.oscillation)
        wanted = self.oscillator.oscillation(slow, third)
        tracking = self.oscillator.tracking(clock, state, tilt, wanted)
        excess = state.omega - self.oscillator.form.rest
        regulating = self.handover(memory.regulating, tilt, slow, excess)
        lean = third.lean[0] * tilt.phi + third.lean[1] * tilt.theta
        turn = tilt.turn - lean - third.turn_ripple - wanted_turn(third)
        excess = excess.at[2].set(third.rate - third.rate_ripple)
        if isinstance(self.end_game, OrbitalRegulator):
            torque = self.end_game.torque(tilt, turn, excess)
            end = torque, state.omega[:2], self.oscillator.init(state.omega)
        else:
            end = _oscillated(self.end_game, clock, state, tilt, slow, third)
        if self.holder is not None:
            held = _oscillated(self.holder, clock, state, tilt, slow, third)
            drift, left = jnp.abs(third.drift), jnp.abs(slow.drift)
            able = HOLDING * jnp.abs(third.coupling) * self.holder.largest_amplitude**2 / 2
            holds = (left > BALANCED * drift) & (left < able)
            end = jax.tree.map(lambda one, other: jnp.where(holds, one, other), held, end)
        late, late_reference, late_wanted = end
        torque = jnp.where(regulating, late, self.oscillator.torque(state.omega, tracking))
        reference = jnp.where(regulating, late_reference, tracking.rate)
        kept = jax.tree.map(lambda end, x: jnp.where(regulating, end, x), late_wanted, wanted)
        return torque, reference, FineMemory(kept, regulating)


def _oscillated(
    oscillator: Oscillator,
    clock: RealScalar,
    state: NormalState,
    tilt: Tilt,
    slow: Slow,
    third: ThirdAxis,
) -> tuple[Float[Array, "2"], Float[Array, "2"], Oscillation]:
    """Torque (N m), rates asked for (rad/s) and oscillation of an end game that oscillates."""
    wanted = oscillator.oscillation(slow, third)
    tracking = oscillator.tracking(clock, state, tilt, wanted)
    return oscillator.torque(state.omega, tracking), tracking.rate, wanted


class OscillatorySettlingMemory(NamedTuple):
    """Memories of the stage and the estimator, and the rates asked for."""

    fine: FineMemory
    estimator: EstimatorMemory
    reference: Float[Array, "2"]


class OscillatorySettling(AbstractSampledController):
    """Oscillates from any start until all is small, then regulates: all three axes settle.

    `torque_limit` (N m) cuts the commands, `period` is in s.
    """

    modes: ClassVar[type[enum.IntEnum]] = FineMode

    fine: FineStage
    estimator: ThirdAxisEstimator
    torque_limit: RealScalar = eqx.field(converter=as_float)
    period: RealScalar = eqx.field(converter=as_float, default=0.1)

    def __check_init__(self):
        require_positive("torque_limit", self.torque_limit)
        require_positive("period", self.period)

    @property
    def form(self) -> NormalForm:
        """The plant that is believed, and its frame."""
        return self.fine.oscillator.form

    def init(self, state: PlantState) -> OscillatorySettlingMemory:
        """At rest, nothing estimated."""
        omega = self.form.seen(state).omega
        return OscillatorySettlingMemory(
            self.fine.init(omega), self.estimator.init(omega), jnp.zeros(2, omega.dtype)
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: OscillatorySettlingMemory
    ) -> tuple[Float[Array, "2"], OscillatorySettlingMemory]:
        """Estimate, then the fine stage."""
        seen = self.form.seen(state)
        third, estimator = self.estimator.update(seen.omega, memory.estimator, self.period)
        torque, reference, fine = self.fine.step(t, seen, third, memory.fine)
        command = self.form.command(clipped(torque, self.torque_limit))
        return command, OscillatorySettlingMemory(fine, estimator, reference)

    def rate_error(self, state: PlantState, memory: OscillatorySettlingMemory) -> Float[Array, "2"]:
        """ω - ω_d while oscillating, zero while regulating, rad/s."""
        omega = self.form.seen(state).omega
        return jnp.where(memory.fine.regulating, 0.0, omega[:2] - memory.reference)

    def mode(self, memory: OscillatorySettlingMemory) -> Int[Array, ""]:
        """The `FineMode` at work."""
        return jnp.where(memory.fine.regulating, FineMode.REGULATING, FineMode.OSCILLATING)
