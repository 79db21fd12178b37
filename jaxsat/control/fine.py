"""The fine stage: a large oscillation until all is small, then a small one that stays."""

import dataclasses
import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.control.coasting import ENOUGH, NEAR_AIM, Coast, Hold
from jaxsat.control.estimators import EstimatorMemory, ThirdAxis, ThirdAxisEstimator
from jaxsat.control.leaks import USED, Aid
from jaxsat.control.normal_form import NormalForm, NormalState
from jaxsat.control.oscillatory import MorinSamson, Oscillation, Oscillator, Slow
from jaxsat.control.rate_tracking import clipped
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.tilt import Tilt, tilt_of
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

RealScalar = Float[Array, ""]

HOLDING_TURN = 0.01
"""Turn (rad) at which the end game asks for its largest amplitude."""

SURE_SHARE, LEAST_SHARE = 0.7, 0.2
"""Of the end game's largest ds/dt: what can be relied on, as the orbit takes some of it, and the
least that counts as left to stop the slow rate where a drift takes the rest."""


class FineMode(enum.IntEnum):
    """The modes of the fine stage; a supervisor's earlier phases are 1 and 2."""

    OSCILLATING = 3
    HOLDING = 4


class RippleSlack(eqx.Module):
    """What of a slow rate counts for nothing, as it may be ripple that is not known yet.

    `enter` (rad/s) when the end game takes over; when it hands back at first `stay`, and less and
    less until the time `known` (s), when the ripple is.
    """

    enter: RealScalar = eqx.field(converter=as_float)
    stay: RealScalar = eqx.field(converter=as_float)
    known: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        for name in ("enter", "stay", "known"):
            require_positive(name, getattr(self, name))

    def to_enter(self, slow: Slow) -> Slow:
        """What the end game takes over by."""
        return _less(slow, self.enter)

    def to_stay(self, slow: Slow, clock: RealScalar | float) -> Slow:
        """What it hands back by, `clock` (s) after the beginning of the stage."""
        return _less(slow, self.stay * jnp.clip(1 - clock / self.known, 0.0, 1.0))


def _less(slow: Slow, slack: RealScalar) -> Slow:
    size = jnp.maximum(jnp.abs(slow.rate) - slack, 0.0)
    return Slow(jnp.sign(slow.rate) * size, slow.turn)


class Handover(eqx.Module):
    """When the end game takes over and when it hands back.

    It takes over when |w|, the slow turn and the turn at which the end game will have stopped the
    slow rate are below `enter_angle`, the same turns from the wanted attitude are below
    `enter_turn`, and |p1|, |p2| less their values at rest below `enter_rate`; it hands back when
    |w| exceeds `leave_tilt` or one of the turns from the wanted attitude `leave_turn` (rad, rad/s).
    If it `coasts`, a hold begins against a drift that the end game cannot balance, and ends only
    when the turn itself exceeds `leave_turn` (see `Coast`): each hand-back takes rates far above
    those of the end game. The first one is judged, as it begins before the drift is known.
    `slack` is what of the slow rate counts for nothing, None for nothing of it.
    """

    enter_rate: RealScalar = eqx.field(converter=as_float)
    enter_angle: RealScalar = eqx.field(converter=as_float, default=0.03)
    enter_turn: RealScalar = eqx.field(converter=as_float, default=0.04)
    leave_tilt: RealScalar = eqx.field(converter=as_float, default=0.04)
    leave_turn: RealScalar = eqx.field(converter=as_float, default=0.045)
    coasts: bool = eqx.field(static=True, default=False)
    slack: RippleSlack | None = None

    def __check_init__(self):
        for name in ("enter_rate", "enter_angle", "enter_turn", "leave_tilt", "leave_turn"):
            require_positive(name, getattr(self, name))

    def __call__(
        self,
        late: Bool[Array, ""],
        tilt: Tilt,
        slow: Slow,
        excess: Float[Array, "3"],
        deceleration: RealScalar,
        held: RealScalar,
        coast: Coast | None = None,
        clock: RealScalar | float = 0.0,
    ) -> Bool[Array, ""]:
        """Whether the end game is to work now, given whether it did.

        `excess` is (p1, p2, s) less its value at rest (rad/s), `deceleration` that of the slow rate
        of which the end game is capable (rad/s²), `held` the turn about n from the wanted attitude
        to the one that is held (rad), from which the slow turn counts, and `clock` the time since
        the stage began (s).
        """
        begun = lasting = slow
        if self.slack is not None:
            begun, lasting = self.slack.to_enter(slow), self.slack.to_stay(slow, clock)
        from_held, from_wanted = _farthest(begun, held, deceleration)
        leave = _farthest(lasting, held, deceleration)[1] > self.leave_turn
        wanted = Slow(slow.rate, slow.turn + held)
        if coast is not None:
            short = jnp.where(coast.drifts, ~coast.lasts(wanted, self.leave_turn, ENOUGH), leave)
            leave = (jnp.abs(wanted.turn) > self.leave_turn) | (short & coast.judged)
            from_held, from_wanted = _farthest(slow, held, coast.deceleration(deceleration))
            from_held = jnp.where(coast.drifts, 0.0, from_held)
        enter = (
            (tilt.size < self.enter_angle)
            & (from_held < self.enter_angle)
            & (from_wanted < self.enter_turn)
            & (jnp.abs(excess[0]) < self.enter_rate)
            & (jnp.abs(excess[1]) < self.enter_rate)
        )
        if coast is not None:
            enter = enter & coast.lasts(wanted, self.leave_turn, NEAR_AIM)
        leave = leave | (tilt.size > self.leave_tilt)
        return jnp.where(late, ~leave, enter)


def _farthest(
    slow: Slow, held: RealScalar, deceleration: RealScalar
) -> tuple[RealScalar, RealScalar]:
    """The larger of the turn now and when the slow rate is stopped, from the attitude that is held
    and from the wanted one."""
    stopping = slow.rate * jnp.abs(slow.rate) / (2 * deceleration)
    from_held, from_wanted = (
        jnp.maximum(jnp.abs(turn), jnp.abs(turn + stopping))
        for turn in (slow.turn, slow.turn + held)
    )
    return from_held, from_wanted


class FineMemory(NamedTuple):
    """The oscillation asked for last, whether the end game works, and its `Hold`, `None` where
    holds do not coast."""

    oscillation: Oscillation
    late: Bool[Array, ""]
    hold: Hold | None


class FineStage(eqx.Module):
    """Oscillator and end game, with the hand-over between them.

    The end game is the same oscillation with amplitudes up to `holding_amplitude` (rad/s).
    `fade_lean` takes the correction of the turn for leaning axes away as the tilt grows, by the
    factor max(0, 1 - |w|²).
    """

    oscillator: Oscillator
    holding_amplitude: RealScalar = eqx.field(converter=as_float)
    handover: Handover
    fade_lean: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        require_positive("holding_amplitude", self.holding_amplitude)

    @property
    def end_game(self) -> Oscillator:
        """The oscillator that holds: its demand is critically damped and at its largest at
        `HOLDING_TURN`."""
        form, amplitude = self.oscillator.form, self.holding_amplitude
        most = form.coupling * amplitude**2 / 2  # of |ds/dt|, rad/s²
        return dataclasses.replace(
            self.oscillator,
            demand=MorinSamson(jnp.sqrt(most / HOLDING_TURN), 1.0),
            largest_amplitude=amplitude,
            ratio=1.0,
            dead_zone=0.0,
        )

    def init(self, omega: Float[Array, "3"]) -> FineMemory:
        """At rest, oscillating."""
        hold = Hold.none(omega) if self.handover.coasts else None
        return FineMemory(self.oscillator.init(omega), jnp.array(False), hold)

    def step(
        self,
        clock: RealScalar,
        state: NormalState,
        third: ThirdAxis,
        memory: FineMemory,
        aid: Aid | None = None,
    ) -> tuple[Float[Array, "2"], Float[Array, "2"], FineMemory]:
        """The torque about x and y, not yet limited (N m), the rates asked for (rad/s), and the
        next memory."""
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
        most = third.coupling * self.holding_amplitude**2 / 2
        sure = SURE_SHARE * most
        along = jnp.abs(third.drift)
        if memory.hold is not None:
            along = jnp.sign(slow.rate) * third.drift
        deceleration = jnp.maximum(sure - along, LEAST_SHARE * most)
        if aid is not None:
            deceleration = jnp.maximum(deceleration, USED * jnp.min(aid.push))
        excess = state.omega - third.rest
        coast, hold = None, memory.hold
        if hold is not None:
            coast = Coast.of(hold, clock, self.oscillator.frequency, lasting, sure)
        late = self.handover(
            memory.late, tilt, slow, excess, deceleration, third.turn[2], coast, clock
        )
        early, quiet = self.oscillator, self.end_game
        aim, slow_late, third_late = None, slow, third
        if hold is not None and coast is not None:
            hold = hold.after(late, clock, coast)
            from_wanted = Slow(slow.rate, slow.turn + third.turn[2])
            aim = coast.aim(from_wanted.turn)
            slow_late = choose(coast.drifts, coast.opposed(from_wanted, HOLDING_TURN), slow)
            third_late = third._replace(drift=jnp.where(coast.drifts, 0.0, third.drift))

        # Choosing what is small lets the two share the rest, roots and quotients above all.
        if aid is not None:
            alone = jnp.min(aid.push) > 0
            slow_late = Slow(*(jnp.where(alone, 0.0, x) for x in slow_late))
        quiet_request = quiet.request(slow_late, third_late)
        asked = choose(late, quiet_request, early.request(slow, third, aim))
        wanted = asked.granted(third.axes)
        tracking = early.tracking(clock, state, tilt, wanted)
        return early.torque(state.omega, tracking), tracking.rate, FineMemory(wanted, late, hold)


class OscillatorySettlingMemory(NamedTuple):
    """Memories of the stage and the estimator, the rates asked for, and how many samples there
    were."""

    fine: FineMemory
    estimator: EstimatorMemory
    reference: Float[Array, "2"]
    samples: Int[Array, ""]


class OscillatorySettling(AbstractSampledController):
    """Oscillates from any start until all is small, then less: all three axes settle.

    `torque_limit` (N m) cuts the commands, `period` is in s.
    """

    modes: ClassVar[type[enum.IntEnum]] = FineMode

    fine: FineStage
    estimator: ThirdAxisEstimator
    torque_limit: RealScalar = eqx.field(converter=as_float)
    period: RealScalar = eqx.field(converter=as_float)

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
            self.fine.init(omega),
            self.estimator.init(omega),
            jnp.zeros(2, omega.dtype),
            jnp.array(0),
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: OscillatorySettlingMemory
    ) -> tuple[Float[Array, "2"], OscillatorySettlingMemory]:
        """Estimate, then the fine stage, whose clock begins with the law."""
        del t
        clock = memory.samples * self.period
        seen = self.form.seen(state)
        third, estimator = self.estimator.update(
            seen.omega, memory.estimator, self.period, seen.attitude
        )
        seen = seen.relative_to(third.turn)
        torque, reference, fine = self.fine.step(clock, seen, third, memory.fine)
        command = self.form.command(clipped(torque, self.torque_limit))
        return command, OscillatorySettlingMemory(fine, estimator, reference, memory.samples + 1)

    def rate_error(self, state: PlantState, memory: OscillatorySettlingMemory) -> Float[Array, "2"]:
        """ω - ω_d while oscillating, zero in the end game, rad/s."""
        omega = self.form.seen(state).omega
        return jnp.where(memory.fine.late, 0.0, omega[:2] - memory.reference)

    def mode(self, memory: OscillatorySettlingMemory) -> Int[Array, ""]:
        """The `FineMode` at work."""
        return jnp.where(memory.fine.late, FineMode.HOLDING, FineMode.OSCILLATING)
