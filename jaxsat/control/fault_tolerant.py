"""A law that diagnoses its thrusters and flies by what is left of them."""

import enum
from typing import ClassVar, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.control.diagnosis import (
    Diagnosis,
    DiagnosisMemory,
    Reading,
    Stage,
    ThrusterFilter,
    ThrusterModel,
)
from jaxsat.control.leaks import LeakMemory, Leaks
from jaxsat.control.least_squares import Fit
from jaxsat.control.pulse_rounding import PulseRounding
from jaxsat.control.quaternion_feedback import QuaternionFeedback, QuaternionFeedbackMemory
from jaxsat.control.reconfiguration import Ability, Left, Reconfiguration
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.supervisor import Phase, SettlingMemory, ThreeSlewSettling
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.three_torques import FAULT_TOLERANT
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

RealScalar = Float[Array, ""]

PROBE_INTERVAL = 2.0
"""Over the natural frequency: a failed thruster is given a test pulse so often, whose effect would
show that it works."""

TEST_PERIODS = 3
"""Control periods from the test pulse of one thruster to that of the next, during an alarm."""

QUIET_SIGMAS = 4.0
"""A rate about a thruster's torque within so many sigmas of the noise is not damped."""


class TolerantMode(enum.IntEnum):
    """What the law does; the last four but one are the phases of the law of two torques."""

    THREE_AXES = 0
    ALARM = 1
    REALLOCATED = 2
    STOPPING = 3
    SLEWING = 4
    OSCILLATING = 5
    HOLDING = 6
    DAMPING = 7


FIRST_PHASE = TolerantMode.STOPPING - Phase.STOPPING


class TolerantMemory(NamedTuple):
    """Memories of all parts, what is left, and the `TolerantMode`.

    `on_time` (s) is what was commanded of each thruster since the last sample, `spill` (s) what of
    that reaches into the next period, `probe` (s) the time since the last test pulse. `owed`
    (N m s) is what whole pulses have left out so far.
    """

    diagnosis: DiagnosisMemory
    healthy: QuaternionFeedbackMemory
    settling: SettlingMemory | None
    leaking: LeakMemory
    modulation: PyTree
    on_time: Float[Array, " m"]
    spill: Float[Array, " m"]
    probe: RealScalar
    owed: Float[Array, "3"]
    ability: Ability
    mode: Int[Array, ""]


class SettlingLaws(eqx.Module):
    """Laws of two torques, one for each plane that failures leave.

    The arrays of `laws` have a leading axis. `of_set` (sets,) is the number of the law of each
    failed set, `directions` (laws, 3, 2) are the axes about which the laws command.
    """

    laws: ThreeSlewSettling
    of_set: Int[Array, " sets"]
    directions: Float[Array, "laws 3 2"] = eqx.field(converter=as_float)
    leaks: Leaks

    def at(self, number: Int[Array, ""]) -> tuple[ThreeSlewSettling, Float[Array, "3 2"], Leaks]:
        """The law of a failed set, and its directions."""
        place = self.of_set[number]
        law, leaks = jax.tree.map(lambda x: x[place], (self.laws, self.leaks))
        return law, self.directions[place], leaks


class FaultTolerant(AbstractSampledController):
    """Quaternion feedback, diagnosis of the thrusters, and the best law for those that are left.

    The command is the duty of each thruster. The law sees estimates of attitude and rate and its
    own commands, nothing else. Isolated thrusters are left out, and what they make all the time is
    fed forward. What is left decides: three axes go on under quaternion feedback; where torques of
    either sign are left in a plane, `settling` has the law of three slews in the normal form of
    that plane; else rates are damped by whatever thruster takes energy out. During an alarm the
    suspect and its rivals in turn give test pulses. Thrusters that have failed do every
    `PROBE_INTERVAL`, so that one that works again is found.
    """

    declaration: ClassVar[LawDeclaration] = FAULT_TOLERANT
    modes: ClassVar[type[enum.IntEnum]] = TolerantMode

    healthy: QuaternionFeedback
    diagnosis: Diagnosis
    reconfiguration: Reconfiguration
    rounding: PulseRounding
    settling: SettlingLaws | None
    period: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        require_positive("period", self.period)

    @property
    def thrusters(self) -> ThrusterModel:
        """What the law believes of its thrusters."""
        return cast(ThrusterFilter, self.diagnosis.filter).thrusters

    def init(self, state: PlantState) -> TolerantMemory:
        """All thrusters work."""
        thrusters = self.thrusters
        zero = jnp.zeros(thrusters.count, state.omega.dtype)
        return TolerantMemory(
            self.diagnosis.init(Reading(state.omega)),
            self.healthy.init(state),
            None if self.settling is None else self.settling.at(jnp.array(0))[0].init(state),
            LeakMemory.none(thrusters.count),
            thrusters.modulation.init(thrusters.count),
            zero,
            zero,
            zero[0],
            jnp.zeros(3, state.omega.dtype),
            Ability.whole(thrusters.count),
            jnp.array(TolerantMode.THREE_AXES),
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: TolerantMemory
    ) -> tuple[Float[Array, " m"], TolerantMemory]:
        """The duty of each thruster."""
        thrusters, period = self.thrusters, self.period
        needed = self.reconfiguration.needed(memory.diagnosis.condition.failed)
        diagnosis = self.diagnosis.step(
            Reading(state.omega), memory.on_time, period, memory.diagnosis, needed
        )
        condition = diagnosis.condition
        ability = self.reconfiguration.find(condition, memory.ability)
        number, left, limit = ability
        besides = cast(ThrusterFilter, self.diagnosis.filter).believed(condition, period)
        steady = -(thrusters.torque @ condition.flow + besides)
        torque, healthy = self.healthy.step(t, state, memory.healthy)
        settling, leaking = memory.settling, memory.leaking
        if self.settling is not None:
            changed = (number != memory.ability.number) | (left != memory.ability.left)
            begins = (left == Left.PLANE) & changed
            settling = cast(SettlingMemory, settling)
            law, directions, leaks = self.settling.at(number)
            begun = law.init(state)
            settling = choose(begins, begun, settling)
            leaking = choose(begins, LeakMemory.none(thrusters.count), leaking)
            aid = leaks.aid(leaking, condition.part * memory.on_time, settling.fine.late)
            given = jnp.zeros_like(settling.phase)
            command, settling = law.in_phase(state, settling, given, aid)
            fit = cast(Fit, settling.estimator.fit)
            leaking = jax.lax.cond(
                (left == Left.PLANE) & (fit.samples == 0),
                lambda: leaks.found(fit, limit, leaking),
                lambda: leaking,
            )
            torque = jnp.where(left == Left.PLANE, directions @ command, torque)
            to_oppose = self.reconfiguration.beside_plane(limit, steady, directions)
            steady = jnp.where(left == Left.PLANE, to_oppose, steady)
        three = left == Left.THREE_AXES
        owed = jnp.where(three, memory.owed, 0.0)
        thrust = self.reconfiguration.allocate(limit, torque + owed / period, steady)
        duty = thrust / jnp.where(limit > 0, limit, 1.0)
        whole = self.rounding(limit, duty, period)
        owed = period * (thrusters.torque @ (limit * (duty - whole)))
        duty = jnp.where(three, whole, duty)
        if self.settling is not None and settling is not None:
            leaks, fit = self.settling.at(number)[2], cast(Fit, settling.estimator.fit)
            wanted = cast(RealScalar, settling.push)
            pushed, leaking = leaks.push(fit, wanted, duty, limit, period, leaking)
            duty = jnp.where(left == Left.PLANE, pushed, duty)
        damping = jnp.where(condition.failed, 0.0, self._damping(state))
        duty = jnp.where(left == Left.LESS, damping, duty)
        probe = memory.probe + period
        interval = PROBE_INTERVAL / self.healthy.natural_frequency
        due = (probe >= interval) & (diagnosis.stage == Stage.QUIET)
        tested = (self.diagnosis.may_return(diagnosis) & due) | self._in_turn(diagnosis)
        duty = jnp.where(
            tested, jnp.maximum(duty, self.diagnosis.test_command(period, diagnosis)), duty
        )
        on_time, spill, modulation = thrusters.on_times(duty, memory.modulation, period)
        return duty, TolerantMemory(
            diagnosis,
            healthy,
            settling,
            leaking,
            modulation,
            memory.spill + on_time,
            spill,
            jnp.where(due, 0.0, probe),
            owed,
            ability,
            self._mode(diagnosis, left, settling),
        )

    def _in_turn(self, diagnosis: DiagnosisMemory) -> Bool[Array, " m"]:
        """During an alarm the suspect and each of its rivals in turn are tested, one by one."""
        rivals = jnp.arange(diagnosis.rival.shape[0]) != diagnosis.suspect
        rivals = rivals & diagnosis.rival
        place = jnp.cumsum(rivals) - 1
        sample = jnp.round(diagnosis.age / self.period).astype(int)
        test = sample // TEST_PERIODS
        turn = place == test // 2 % jnp.maximum(jnp.sum(rivals), 1)
        suspected = ~rivals & diagnosis.rival
        alone = ~jnp.any(rivals)
        tested = jnp.where((test % 2 == 0) | alone, suspected, rivals & turn)
        now = (diagnosis.stage == Stage.ALARM) & (sample % TEST_PERIODS == 0) & (test > 0)
        return now & tested

    def _damping(self, state: PlantState) -> Float[Array, " m"]:
        """Each thruster against the rate about its own torque: none puts energy in."""
        torque = self.reconfiguration.torque
        size = jnp.sqrt(jnp.sum(torque**2, axis=0))
        units = torque / size[None]
        inverse = self.healthy.model.spacecraft.inverse_inertia
        inertia = 1 / jnp.sum(units * (inverse @ units), axis=0)
        rate = -jnp.sum(units * state.omega[:, None], axis=0)
        above = jnp.maximum(rate - QUIET_SIGMAS * self.diagnosis.filter.noise[0], 0.0)
        pull = 2 * self.healthy.damping * self.healthy.natural_frequency
        return jnp.minimum(pull * inertia * above / size, 1.0)

    def _mode(self, diagnosis: DiagnosisMemory, left, settling) -> Int[Array, ""]:
        failed = jnp.any(diagnosis.condition.failed)
        mode = jnp.where(failed, TolerantMode.REALLOCATED, TolerantMode.THREE_AXES)
        if self.settling is not None:
            phase = self.settling.laws.mode(settling)
            mode = jnp.where(left == Left.PLANE, FIRST_PHASE + phase, mode)
        mode = jnp.where(left == Left.LESS, TolerantMode.DAMPING, mode)
        return jnp.where(diagnosis.stage == Stage.ALARM, TolerantMode.ALARM, mode)

    def telemetry(self, memory: TolerantMemory) -> dict[str, Array]:
        """The verdict on each thruster, how near an alarm it is, and whether there is one."""
        diagnosis = memory.diagnosis
        statistic = jnp.max(diagnosis.statistic, axis=0) / self.diagnosis.threshold
        alarm = jnp.where(diagnosis.stage == Stage.ALARM, 1.0, 0.0)
        return {
            "diagnosed_kind": diagnosis.kind,
            "detection_statistic": statistic,
            "alarm": alarm,
        }

    def mode(self, memory: TolerantMemory) -> Int[Array, ""]:
        """The `TolerantMode` at work."""
        return memory.mode
