"""Supervisor of the fastest settling: stop, slew, then the fine stage."""

import enum
import math
from typing import Annotated, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.estimators import EstimatorMemory, ThirdAxis, ThirdAxisEstimator
from jaxsat.control.fine import Aid, FineMemory, FineMode, FineStage, wanted_push
from jaxsat.control.finite_time_rate import FiniteTimeRate, Signs
from jaxsat.control.normal_form import NormalForm, NormalState, clipped, tilt_of
from jaxsat.control.oscillatory import Slow, turned
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.slews import Leg, Slewing, SlewPlanner
from jaxsat.core.array_types import BoolScalar, IntScalar, Pair, RealScalar
from jaxsat.core.checks import positive
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

SINE_OF_SQUARE = 4 / math.pi
"""Amplitude of the sine in a square wave of amplitude 1."""

STOPPED = 1.5
"""|ω3| below which it counts as stopped, relative to the rate law's dead zone."""


class Phase(enum.IntEnum):
    """The phases, of which the last, the fine stage, has two modes."""

    STOPPING = 1
    SLEWING = 2
    OSCILLATING = FineMode.OSCILLATING.value
    HOLDING = FineMode.HOLDING.value


class SettlingMemory(NamedTuple):
    """The phase except `HOLDING`, the memories of its parts, and the begin of the phase (s).

    `samples` counts from the begin of the law, the origin of all its times. `lost` is true after a
    fine stage has ended without success, and `slew_axes` are (cos, sin) of the angle about n from x
    and y to the axes of the slews, None where these stay x and y.
    """

    phase: Annotated[IntScalar, Phase]
    signs: Signs
    slewing: Slewing
    fine: FineMemory
    since: RealScalar
    estimator: EstimatorMemory
    reference: Pair
    samples: IntScalar
    push: RealScalar | None
    lost: BoolScalar
    slew_axes: Pair | None


class ThreeSlewSettling(AbstractSampledController):
    """Settles all three axes in phases: finite-time rate law, three slews, fine stage.

    The slews begin when |ω3| is below 1.5 times the rate law's dead zone and |ω1|, |ω2| are below
    `stopped_rate` (rad/s), the fine stage after the third slew. All begins again when |z| exceeds
    `lost_turn` (rad) or s its value at rest by `lost_rate` (rad/s) in the fine stage. Every phase
    has a time limit: the slews also begin after `patience` (s) if |ω3| is below `slow_rate`
    (rad/s), otherwise the rate law brakes and begins again; the fine stage begins `patience` after
    the planned end of the slews. All begins again if the slews meet twice `slow_rate`, and after
    `patience` in the fine stage if |z| is still above `late_turn` (rad). After a restart from the
    fine stage, that demands no oscillation that the torque cannot produce (`made_amplitude`), and a
    law that `turns_slews` slews about the estimated axes of the reduced inertia. `torque_limit` (N
    m) clips the commands, `period` is in s.
    """

    modes: ClassVar[type[enum.IntEnum]] = Phase

    rate_law: FiniteTimeRate
    planner: SlewPlanner
    fine: FineStage
    estimator: ThirdAxisEstimator
    torque_limit: RealScalar = eqx.field(converter=positive("torque_limit"))
    stopped_rate: RealScalar = eqx.field(converter=positive("stopped_rate"))
    lost_rate: RealScalar = eqx.field(converter=positive("lost_rate"))
    period: RealScalar = eqx.field(converter=positive("period"))
    lost_turn: RealScalar = eqx.field(converter=positive("lost_turn"), default=1.0)
    patience: RealScalar = eqx.field(converter=positive("patience"), default=jnp.inf)
    slow_rate: RealScalar = eqx.field(converter=positive("slow_rate"), default=jnp.inf)
    late_turn: RealScalar = eqx.field(converter=positive("late_turn"), default=0.1)
    aided: bool = eqx.field(static=True, default=False)
    turns_slews: bool = eqx.field(static=True, default=False)

    @property
    def form(self) -> NormalForm:
        """The law's model of the plant, with its frame."""
        return self.planner.form

    def init(self, state: PlantState) -> SettlingMemory:
        """The memory of the first phase, without estimates."""
        omega = self.form.seen(state).omega
        return SettlingMemory(
            jnp.array(Phase.STOPPING),
            self.rate_law.init(state),
            self.planner.init(omega),
            self.fine.init(omega),
            jnp.zeros_like(omega[0]),
            self.estimator.init(omega),
            jnp.zeros(2, omega.dtype),
            jnp.array(0),
            jnp.zeros_like(omega[0]) if self.aided else None,
            jnp.array(False),
            _along_x(omega) if self.turns_slews else None,
        )

    @property
    def made_amplitude(self) -> RealScalar:
        """The largest amplitude (rad/s) of an oscillation that torques within the limit can
        produce.

        A rate ρ sin νt takes a torque of amplitude S ν ρ, and the sine in a square wave at the
        limit has 4/π of it. A larger demand is met late and with another mean product p1 p2, which
        for small c may turn the body about n for ever.
        """
        oscillator, (first, second, _) = self.fine.oscillator, self.form.moments
        largest = jnp.maximum(first, second * oscillator.ratio) * oscillator.frequency
        return SINE_OF_SQUARE * self.torque_limit / largest

    def clock(self, memory: SettlingMemory) -> RealScalar:
        """Time of the next sample since the law began, s."""
        return memory.samples * self.period

    def step(
        self, t: RealScalar, state: PlantState, memory: SettlingMemory
    ) -> tuple[Pair, SettlingMemory]:
        """Update the estimate, choose the phase, run the three parts and take the active one."""
        return self.in_phase(state, memory, jnp.zeros_like(memory.phase))

    def in_phase(
        self,
        state: PlantState,
        memory: SettlingMemory,
        prescribed: IntScalar,
        aid: Aid | None = None,
    ) -> tuple[Pair, SettlingMemory]:
        """As `step`, in the phase `prescribed`; 0 for a free choice."""
        t = self.clock(memory)
        view = self.form.seen(state)
        third, estimator = self.estimator.update(
            view.omega,
            memory.estimator,
            self.period,
            view.attitude,
            None if aid is None else aid.thrust,
        )
        view = view.relative_to(third.turn)
        axes, planner, slewed = self.slew_axes(memory, third), self.planner, view
        if axes is not None:
            planner, slewed = planner.about(axes), view.turned(axes)
        slewing = planner.advance(t, slewed, memory.slewing, self.period)
        chosen = self._phase(t, memory, view, third, slewing)
        phase = jnp.where(prescribed > 0, prescribed, chosen)
        begins = phase != memory.phase
        begins_fine = begins & (phase == Phase.OSCILLATING)
        again = begins & (phase == Phase.STOPPING)
        lost = memory.lost | (again & (memory.phase == Phase.OSCILLATING))
        plan = planner.plan(t, slewed)
        slewing = choose(begins & (phase == Phase.SLEWING), plan, slewing)
        signs = choose(again, self.rate_law.init(state), memory.signs)
        vain = (phase == Phase.STOPPING) & ~begins & (t - memory.since > self.patience)
        signs = signs._replace(most=jnp.where(vain, 0.0, signs.most))  # brakes, then chooses again
        fine = choose(begins_fine, self.fine.init(view.omega), memory.fine)
        since = jnp.where(begins | vain, t, memory.since)

        signs = self.rate_law.signs(third, view.omega, signs)
        tracking = self.rate_law.tracking(third, view.omega, signs)
        own = self.fine.oscillator.largest_amplitude
        largest = jnp.where(lost, jnp.minimum(self.made_amplitude, own), own)
        fine_torque, fine_reference, fine = self.fine.step(
            t - since, view, third, fine, aid, largest
        )
        push = None
        if aid is not None:
            slow = self.fine.oscillator.slow(
                t - since, tilt_of(view.attitude), third, fine.oscillation
            )
            fine_works = phase == Phase.OSCILLATING
            slow = choose(fine_works, slow, Slow(third.rate, jnp.zeros_like(third.rate)))
            push = wanted_push(slow, third.drift + aid.drift, aid.push)
        torque = _by_phase(
            phase,
            self.rate_law.torque(view.omega, tracking),
            _along_xy(axes, planner.torque(slewed.omega, slewing)),
            fine_torque,
        )
        slew_reference = _along_xy(axes, planner.references(slewing))
        reference = _by_phase(phase, tracking.rate, slew_reference, fine_reference)
        following = SettlingMemory(
            phase,
            signs,
            slewing,
            fine,
            since,
            estimator,
            reference,
            memory.samples + 1,
            push,
            lost,
            axes,
        )
        return self.form.command(clipped(torque, self.torque_limit)), following

    def rate_error(self, state: PlantState, memory: SettlingMemory) -> Pair:
        """ω - ω_d of the phase, zero in the end game, rad/s."""
        holding = self.mode(memory) == Phase.HOLDING
        return jnp.where(holding, 0.0, self.form.seen(state).omega[:2] - memory.reference)

    def mode(self, memory: SettlingMemory) -> IntScalar:
        """The active `Phase`."""
        holding = (memory.phase == Phase.OSCILLATING) & memory.fine.late
        return jnp.where(holding, Phase.HOLDING, memory.phase)

    def slew_axes(self, memory: SettlingMemory, third: ThirdAxis) -> Pair | None:
        """Axes of the current slews, or of slews that would begin now.

        After a lost fine stage these are the estimated axes of the reduced inertia: about others a
        rate p changes s by b p², which is large where c is small.
        """
        if memory.slew_axes is None:
            return None
        believed = jnp.where(memory.lost, third.axes, _along_x(third.axes))
        return jnp.where(memory.phase == Phase.SLEWING, memory.slew_axes, believed)

    def _phase(
        self,
        t: RealScalar,
        memory: SettlingMemory,
        state: NormalState,
        third: ThirdAxis,
        slewing: Slewing,
    ) -> IntScalar:
        phase, impatient = memory.phase, t - memory.since > self.patience
        still = jnp.max(jnp.abs(state.omega[:2])) < self.stopped_rate
        size = jnp.abs(third.rate)
        stopped = still & (size < STOPPED * self.rate_law.dead_zone)
        stopped = stopped | (impatient & (size < self.slow_rate))
        turn = jnp.abs(tilt_of(state.attitude).turn)
        slow = state.omega[2] - third.rest[2]
        lost = (turn > self.lost_turn) | (jnp.abs(slow) > self.lost_rate)
        lost = lost | (impatient & ~memory.fine.late & (turn > self.late_turn))
        slewed = (slewing.leg == Leg.SLEWED) | (t > slewing.end + self.patience)
        after_stopping = jnp.where(stopped, Phase.SLEWING, Phase.STOPPING)
        after_slewing = jnp.where(slewed, Phase.OSCILLATING, Phase.SLEWING)
        spinning = size > 2 * self.slow_rate
        after_slewing = jnp.where(spinning, Phase.STOPPING, after_slewing)
        after_fine = jnp.where(lost, Phase.STOPPING, Phase.OSCILLATING)
        otherwise = jnp.where(phase == Phase.SLEWING, after_slewing, after_fine)
        return jnp.where(phase == Phase.STOPPING, after_stopping, otherwise)


def _along_x(like: Float[Array, " n"]) -> Pair:
    """(cos, sin) of zero, in the precision of `like`."""
    return jnp.stack([jnp.ones_like(like[0]), jnp.zeros_like(like[0])])


def _along_xy(axes: Pair | None, pair: Pair) -> Pair:
    """Components along x and y of a pair along the axes of the slews."""
    return pair if axes is None else turned(axes, *pair)


def _by_phase(phase: IntScalar, stopping, slewing, fine):
    return jnp.where(
        phase == Phase.STOPPING, stopping, jnp.where(phase == Phase.SLEWING, slewing, fine)
    )
