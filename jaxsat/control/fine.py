"""Fine stage: a large oscillation until all errors are small, then a small one that holds."""

import dataclasses
import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.demands import MorinSamson, beyond
from jaxsat.control.estimators import EstimatorMemory, ThirdAxis, ThirdAxisEstimator
from jaxsat.control.handover import AIMED_TURN, Handover, HoldRecord, UnbalancedDrift
from jaxsat.control.normal_form import NormalForm, NormalState, clipped, tilt_of
from jaxsat.control.oscillatory import (
    SINE,
    FlatTop,
    Oscillation,
    Oscillator,
    Slow,
    twice_mean_square,
)
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import BoolScalar, IntScalar, Pair, RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

HOLDING_TURN = 0.01
"""Turn (rad) at which the end game demands its largest amplitude."""

SURE_SHARE, LEAST_SHARE = 0.7, 0.2
"""Shares of the end game's largest ds/dt: the dependable one, as the orbit takes some of it, and
the smallest deceleration of the slow rate where a drift takes the rest."""


USED = 0.5
"""Share of the possible acceleration that the control of the turn demands."""

CONTROLLED_TURN = 0.04
"""Turn, rad, at which it demands that share."""


class FineMode(enum.IntEnum):
    """The modes of the fine stage; a supervisor's earlier phases are 1 and 2."""

    OSCILLATING = 3
    HOLDING = 4


class Aid(NamedTuple):
    """Effect of thrusters about n beside the two torques.

    `thrust` (rad/s) is the thrusters' action in the last period, for the fit of leaks. `drift`
    (rad/s²) is the mean acceleration by the leaks of the torques in the plane, and `push` (rad/s²)
    the possible acceleration towards -n and n.
    """

    thrust: Float[Array, " k"]
    drift: RealScalar
    push: Pair


class FineMemory(NamedTuple):
    """The last oscillation, whether the end game is active, and its `HoldRecord`, `None` if holds
    do not coast."""

    oscillation: Oscillation
    late: BoolScalar
    hold: HoldRecord | None


class FineStage(eqx.Module):
    """Oscillator and end game, with the hand-over between them.

    The end game is the same oscillation with amplitudes up to `holding_amplitude` (rad/s).
    `fade_lean` reduces the correction of the turn for leaning axes as the tilt grows, by the factor
    max(0, 1 - |w|²). With a `flat_top` the waves of the end game are flat-topped.
    """

    oscillator: Oscillator
    holding_amplitude: RealScalar = eqx.field(converter=positive("holding_amplitude"))
    handover: Handover
    fade_lean: bool = eqx.field(static=True, default=False)
    flat_top: FlatTop | None = None

    @property
    def roundness(self) -> RealScalar | None:
        """q of the waves of the end game, `None` for sines."""
        if self.flat_top is None:
            return None
        return self.flat_top.roundness(self.holding_amplitude, self.oscillator.frequency)

    def largest_change(self, coupling: RealScalar) -> RealScalar:
        """The largest mean |ds/dt| (rad/s²) of the end game at a `coupling` c."""
        return coupling * self.holding_amplitude**2 / 2 * twice_mean_square(self.roundness)

    @property
    def early(self) -> Oscillator:
        """The large oscillation, of sines, in the form of the end game."""
        if self.flat_top is None:
            return self.oscillator
        return dataclasses.replace(self.oscillator, roundness=jnp.asarray(SINE))

    @property
    def end_game(self) -> Oscillator:
        """The oscillator of holds, with a critically damped demand that is largest at
        `HOLDING_TURN`."""
        most = self.largest_change(self.oscillator.form.coupling)
        return dataclasses.replace(
            self.oscillator,
            demand=MorinSamson(jnp.sqrt(most / HOLDING_TURN), 1.0),
            largest_amplitude=self.holding_amplitude,
            ratio=1.0,
            dead_zone=0.0,
            roundness=self.roundness,
        )

    def init(self, omega: Vector) -> FineMemory:
        """The initial memory: the stage oscillates, with zero amplitude."""
        hold = HoldRecord.none(omega) if self.handover.coasts else None
        return FineMemory(self.early.init(omega), jnp.array(False), hold)

    def step(
        self,
        clock: RealScalar,
        state: NormalState,
        third: ThirdAxis,
        memory: FineMemory,
        aid: Aid | None = None,
        largest: RealScalar | None = None,
    ) -> tuple[Pair, Pair, FineMemory]:
        """The torque about x and y before limiting (N m), the reference rates (rad/s), and the next
        memory. `largest` is the largest amplitude (rad/s), `None` for that of the oscillator."""
        tilt = tilt_of(state.attitude)
        if self.fade_lean:
            third = third._replace(lean=third.lean * jnp.maximum(0.0, 1 - tilt.size**2))
        slow = self.oscillator.slow(clock, tilt, third, memory.oscillation)
        lasting = third.drift
        if aid is not None:
            lasting, drift = (
                x - jnp.clip(x, -aid.push[1], aid.push[0]) for x in (lasting, lasting + aid.drift)
            )
            third = third._replace(drift=drift)
        most = self.largest_change(third.coupling)
        sure = SURE_SHARE * most
        along = jnp.abs(third.drift)
        if memory.hold is not None:
            along = jnp.sign(slow.rate) * third.drift
        deceleration = jnp.maximum(sure - along, LEAST_SHARE * most)
        if aid is not None:
            deceleration = jnp.maximum(deceleration, USED * jnp.min(aid.push))
        excess = state.omega - third.rest
        coast, hold, own_aim = None, memory.hold, self.handover.aimed_turn
        if hold is not None:
            turn = AIMED_TURN if own_aim is None else own_aim
            coast = UnbalancedDrift.of(hold, clock, self.oscillator.frequency, lasting, sure, turn)
        handover, held = self.handover.around(self.oscillator.form.axes, third.turn)
        late = handover(memory.late, tilt, slow, excess, deceleration, held, coast, clock)
        early, quiet = self.early, self.end_game
        if largest is not None:
            early = dataclasses.replace(early, largest_amplitude=largest)
        aim, slow_early, third_early, slow_late, third_late = None, slow, third, slow, third
        if hold is not None and coast is not None:
            hold = hold.after(late, clock, coast)
            from_wanted = Slow(slow.rate, slow.turn + held)
            aim = coast.aim(from_wanted.turn)
            slow_late = choose(coast.drifts, coast.opposed(from_wanted, HOLDING_TURN), slow)
            third_late = third._replace(drift=jnp.where(coast.drifts, 0.0, third.drift))
            if own_aim is not None:
                outside = beyond(from_wanted.turn, own_aim)
                slow_early = choose(coast.drifts, Slow(slow.rate, outside), slow)
                third_early = third_late

        # Both share all that follows from the chosen request, above all roots and quotients.
        if aid is not None:
            alone = jnp.min(aid.push) > 0
            slow_late = Slow(*(jnp.where(alone, 0.0, x) for x in slow_late))
        quiet_request = quiet.request(slow_late, third_late)
        request = choose(late, quiet_request, early.request(slow_early, third_early, aim))
        motion = request.granted(third.axes)
        tracking = early.tracking(clock, state, tilt, motion)
        return early.torque(state.omega, tracking), tracking.rate, FineMemory(motion, late, hold)


class OscillatorySettlingMemory(NamedTuple):
    """Memories of the stage and the estimator, the reference rates, and the number of samples."""

    fine: FineMemory
    estimator: EstimatorMemory
    reference: Pair
    samples: IntScalar


class OscillatorySettling(AbstractSampledController):
    """Oscillates from any start until all errors are small, then less: all three axes settle.

    `torque_limit` (N m) clips the commands, `period` is in s.
    """

    modes: ClassVar[type[enum.IntEnum]] = FineMode

    fine: FineStage
    estimator: ThirdAxisEstimator
    torque_limit: RealScalar = eqx.field(converter=positive("torque_limit"))
    period: RealScalar = eqx.field(converter=positive("period"))

    @property
    def form(self) -> NormalForm:
        """The law's model of the plant, with its frame."""
        return self.fine.oscillator.form

    def init(self, state: PlantState) -> OscillatorySettlingMemory:
        """The initial memory: no oscillation, no estimate."""
        omega = self.form.seen(state).omega
        return OscillatorySettlingMemory(
            self.fine.init(omega),
            self.estimator.init(omega),
            jnp.zeros(2, omega.dtype),
            jnp.array(0),
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: OscillatorySettlingMemory
    ) -> tuple[Pair, OscillatorySettlingMemory]:
        """Update the estimate, then the fine stage, whose clock begins with the law."""
        clock = memory.samples * self.period
        view = self.form.seen(state)
        third, estimator = self.estimator.update(
            view.omega, memory.estimator, self.period, view.attitude
        )
        view = view.relative_to(third.turn)
        torque, reference, fine = self.fine.step(clock, view, third, memory.fine)
        command = self.form.command(clipped(torque, self.torque_limit))
        return command, OscillatorySettlingMemory(fine, estimator, reference, memory.samples + 1)

    def rate_error(self, state: PlantState, memory: OscillatorySettlingMemory) -> Pair:
        """ω - ω_d while oscillating, zero in the end game, rad/s."""
        omega = self.form.seen(state).omega
        return jnp.where(memory.fine.late, 0.0, omega[:2] - memory.reference)

    def mode(self, memory: OscillatorySettlingMemory) -> IntScalar:
        """The active `FineMode`."""
        return jnp.where(memory.fine.late, FineMode.HOLDING, FineMode.OSCILLATING)


def wanted_push(slow: Slow, drift: RealScalar, push: Pair) -> RealScalar:
    """The acceleration (rad/s²) about n that the control of the turn demands.

    Critically damped, with compensation of `drift` (rad/s²); with one sign alone no more than that.
    """
    least = jnp.min(push)
    square = USED * least / CONTROLLED_TURN
    acceleration = -square * slow.turn - 2 * jnp.sqrt(square) * slow.rate
    acceleration = jnp.where(least > 0, acceleration, 0.0)
    return jnp.clip(acceleration - drift, -push[0], push[1])
