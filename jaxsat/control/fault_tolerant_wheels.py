"""A law that diagnoses its reaction wheels and flies by what is left of them."""

import dataclasses
import enum
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.control.controller import LawContext, WheelContext
from jaxsat.control.diagnosis import (
    MOST_RETURNS,
    Diagnosis,
    DiagnosisMemory,
    Reading,
    Stage,
    WheelFilter,
)
from jaxsat.control.diagnosis.wheel_filter import LEAST_NOISE
from jaxsat.control.quaternion_feedback import QuaternionFeedback, QuaternionFeedbackMemory
from jaxsat.control.reconfiguration import Left
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.two_wheels import TwoWheels
from jaxsat.control.wheel_allocation import WheelAllocation, Wheeled
from jaxsat.core.checks import as_array, as_float, require_positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.three_torques import FAULT_TOLERANT_WHEELS
from jaxsat.spacecraft import wheel_momentum
from jaxsat.spacecraft.dynamics import PlantState

RealScalar = Float[Array, ""]
OfEach = Float[Array, " m"]

PROBE_INTERVAL = 2.0
"""Over the natural frequency: a failed wheel is given a test pulse so often."""

UNLOADING = 0.2
"""Times the natural frequency: rate at which momentum without effect on the body is taken out."""

TURNING, SLOWLY = 2e-3, 0.5
"""Times the natural frequency: with two wheels, the rate that momentum about the axis without a
wheel leaves, above which no attitude is asked for; and below which part of that one is again."""

SMOOTHING = 1.0
"""Times the natural frequency: how fast the estimate of that rate follows at rest."""

SMALLEST = 1e-30
"""Keeps a quotient of two zeros finite."""


class WheelMode(enum.IntEnum):
    """What the law does."""

    THREE_AXES = 0
    ALARM = 1
    REALLOCATED = 2
    TWO_WHEELS = 3
    DAMPING = 4


class WheelLawMemory(NamedTuple):
    """Memories of all parts, what is left, and the `WheelMode`.

    `command` (N m) is that of the last sample, `impulse` (N m s) what was commanded since. `probe`
    (s) is the time since the last test pulse, `sign` that of the next one. `turning` (rad/s) is the
    rate about the axis without a wheel that two wheels would leave, and `rests` tells whether that
    counts as none.
    """

    diagnosis: DiagnosisMemory
    healthy: QuaternionFeedbackMemory
    wheeled: Wheeled
    command: OfEach
    impulse: OfEach
    probe: RealScalar
    sign: RealScalar
    turning: RealScalar
    rests: Bool[Array, ""]
    mode: Int[Array, ""]


class FaultTolerantWheels(AbstractSampledController):
    """Quaternion feedback, diagnosis of the wheels, and the best law for those that are left.

    The command is the torque of each wheel on the body. The law sees estimates of attitude and
    rate, the wheels' tachometers and its own commands, nothing else. Wheels that make torque about
    three axes go on under quaternion feedback; two wheels settle all axes by `two_wheels` where no
    momentum about the third is left; else rates are damped, which takes energy out whatever is
    left. `known` tells which wheels had failed before the start. Commands act `delay` (s) late.
    """

    declaration: ClassVar[LawDeclaration] = FAULT_TOLERANT_WHEELS
    modes: ClassVar[type[enum.IntEnum]] = WheelMode

    healthy: QuaternionFeedback
    diagnosis: Diagnosis
    allocation: WheelAllocation
    two_wheels: TwoWheels
    known: Bool[Array, " m"]
    delay: RealScalar = eqx.field(converter=as_float)
    period: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        require_positive("period", self.period)
        require_positive("delay", self.delay, zero_allowed=True)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "FaultTolerantWheels":
        """The law of a table of a scenario."""
        wheels = cast(WheelContext, context.wheels)
        limit = np.asarray(wheels.wheels.torque_limit)
        least = LEAST_NOISE * values["period_s"] * limit
        noise = np.maximum(wheels.momentum_noise, least)
        if wheels.wheels.rotor_inertia is not None:  # of the part J_w a·ω of two samples
            rotors = np.asarray(wheels.wheels.rotor_inertia)
            noise = np.hypot(noise, np.sqrt(2) * rotors * wheels.rate_noise)
        watch = WheelFilter(
            wheels=wheels.wheels,
            momentum_noise=as_array(noise),
            uncertainty=values["torque_uncertainty"],
        )
        healthy = QuaternionFeedback.from_table(values, context)
        return cls(
            healthy=healthy,
            diagnosis=Diagnosis(
                watch,
                values["cusum_reference"],
                values["cusum_threshold"],
                values["isolation_margin"],
            ),
            allocation=WheelAllocation(watch),
            two_wheels=TwoWheels(context.model),
            known=as_array(np.asarray(wheels.failed)),
            delay=wheels.delay,
            period=values["period_s"],
        )

    def init(self, state: PlantState) -> WheelLawMemory:
        """All wheels work but those that are known to have failed."""
        momentum = cast(Array, wheel_momentum(state))
        diagnosis = self.diagnosis.init(Reading(state.omega, momentum))
        condition = diagnosis.condition
        condition = condition._replace(
            failed=self.known, part=jnp.where(self.known, 0.0, condition.part)
        )
        diagnosis = diagnosis._replace(
            condition=condition, returns=jnp.where(self.known, MOST_RETURNS, diagnosis.returns)
        )
        zero = jnp.zeros_like(momentum)
        return WheelLawMemory(
            diagnosis,
            self.healthy.init(state),
            self.allocation.find(condition, momentum),
            zero,
            zero,
            zero[0],
            zero[0] + 1,
            zero[0],
            zero[0] == 0,
            jnp.array(int(WheelMode.THREE_AXES)),
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: WheelLawMemory
    ) -> tuple[OfEach, WheelLawMemory]:
        """The torque of each wheel on the body, N m."""
        momentum = cast(Array, wheel_momentum(state))
        all_needed = jnp.ones_like(self.known)
        reading = Reading(state.omega, momentum)
        diagnosis = self.diagnosis.step(
            reading, memory.impulse, self.period, memory.diagnosis, all_needed
        )
        wheeled = self.allocation.find(diagnosis.condition, momentum, memory.wheeled)
        inertial = self._inertial_momentum(state, momentum)
        turning, rests = self._turning(state, inertial, wheeled, memory)
        torque, healthy = self._torque(t, state, inertial, wheeled, memory.healthy)
        unloading = UNLOADING * self.healthy.natural_frequency
        shared = self.allocation.torques(wheeled, torque, momentum, unloading)
        settles = (wheeled.left == Left.THREE_AXES) | ((wheeled.left == Left.PLANE) & rests)
        shared = jnp.where(settles, shared, self._damping(state, wheeled))
        pulse, probe = self._pulses(diagnosis, memory)
        shared = shared + jnp.where(jnp.abs(shared) < jnp.abs(pulse), pulse, 0.0)
        torques = self.allocation.commands(diagnosis.condition, momentum, shared)
        command = jnp.where(wheeled.working, torques, pulse)
        late = self.delay * memory.command + (self.period - self.delay) * command
        return command, WheelLawMemory(
            diagnosis,
            healthy,
            wheeled,
            command,
            late,
            probe,
            -memory.sign,
            turning,
            rests,
            self._mode(diagnosis, wheeled, rests),
        )

    def _inertial_momentum(self, state: PlantState, momentum: OfEach) -> OfEach:
        """h + J_w aᵀω (N m s): with the inertia of the body without rotors, which the model has, it
        makes up the total momentum, and motor and friction alone change it."""
        wheels = self.allocation.wheels
        if wheels.rotor_inertia is None:
            return momentum
        return momentum + wheels.rotor_inertia * (wheels.axes.T @ state.omega)

    def _torque(
        self, t, state: PlantState, momentum, wheeled: Wheeled, memory: QuaternionFeedbackMemory
    ) -> tuple[Float[Array, "3"], QuaternionFeedbackMemory]:
        """The torque (N m) about three axes, or in the plane of two wheels."""
        model, axes = self.healthy.model, self.allocation.wheels.axes
        stored = axes @ momentum
        turning = axes @ jnp.where(wheeled.working, momentum, 0.0)
        held = model.spacecraft.inertia @ state.omega + turning
        free = self.allocation.largest_momentum(wheeled, held)
        law, max_rate = self.healthy, self.healthy.max_rate
        if free is not None:
            size = jnp.sqrt(jnp.sum(model.spacecraft.inertia**2))
            max_rate = jnp.minimum(max_rate, free / size)
            law = dataclasses.replace(law, max_rate=max_rate)
        torque, healthy = law.step(t, state, memory)
        torque = torque + jnp.cross(state.omega, stored)
        turning = jnp.cross(state.omega, model.spacecraft.inertia @ state.omega + stored)
        by_two = self.two_wheels.torque(
            state, wheeled.normal, self.healthy.natural_frequency, max_rate
        )
        by_two = by_two + turning
        return jnp.where(wheeled.left == Left.PLANE, by_two, torque), healthy

    def _turning(
        self, state: PlantState, momentum, wheeled: Wheeled, memory: WheelLawMemory
    ) -> tuple[RealScalar, Bool[Array, ""]]:
        """The rate (rad/s) about the axis without a wheel that momentum would leave at the target
        attitude, and whether it is slow enough to settle there.

        With the total momentum H in the target's axes, n·Jω = n·(H - A h) of the wheels not in use.
        Jω is known to within the uncertainty of the inertia: H is learnt while the body is slow.
        """
        model, axes = self.healthy.model, self.allocation.wheels.axes
        normal, inertia = wheeled.normal, model.spacecraft.inertia
        total = inertia @ state.omega + axes @ momentum
        into_body = state.attitude.as_dcm().matrix
        coasting = axes @ jnp.where(wheeled.working, 0.0, momentum)
        unit = model.spacecraft.momentum_unit
        size = unit * jnp.sqrt(jnp.sum((inertia @ normal / unit) ** 2) + SMALLEST)
        now = normal @ (into_body.T @ total - coasting) / size
        limit = TURNING * self.healthy.natural_frequency
        own = jnp.sqrt(jnp.sum((inertia @ state.omega) ** 2)) / size
        certain = 1 / (1 + (self.diagnosis.filter.uncertainty * own / limit) ** 4)
        follows = jnp.minimum(SMOOTHING * self.healthy.natural_frequency * self.period, 1.0)
        changed = jnp.any(wheeled.working != memory.wheeled.working)
        follows = jnp.where(changed, 1.0, certain * follows)
        turning = memory.turning + follows * (now - memory.turning)
        limit = limit * jnp.where(memory.rests & ~changed, 1.0, SLOWLY)
        return turning, jnp.abs(turning) < limit

    def _damping(self, state: PlantState, wheeled: Wheeled) -> OfEach:
        """Each wheel against the rate about its own axis (N m): none puts energy in."""
        axes = self.allocation.wheels.axes
        inverse = self.healthy.model.spacecraft.inverse_inertia
        inertia = 1 / jnp.sum(axes * (inverse @ axes), axis=0)
        pull = 2 * self.healthy.damping * self.healthy.natural_frequency
        wanted = -pull * inertia * (axes.T @ state.omega)
        return jnp.clip(wanted, -wheeled.usable, wheeled.usable)

    def _pulses(
        self, diagnosis: DiagnosisMemory, memory: WheelLawMemory
    ) -> tuple[OfEach, RealScalar]:
        """Test torques (N m), of either sign in turn, and the time since the last one (s).

        During an alarm they are of the wheels that explain the residuals; otherwise, now and then,
        of those that may work again, and of those that are braked and may not turn any more.
        """
        probe = memory.probe + self.period
        alarm = diagnosis.stage == Stage.ALARM
        due = (probe >= PROBE_INTERVAL / self.healthy.natural_frequency) & ~alarm
        braked = ~diagnosis.condition.failed & (diagnosis.condition.flow > 0)
        now_and_then = self.diagnosis.may_return(diagnosis) | braked
        tested = (now_and_then & due) | (diagnosis.rival & alarm)
        test = memory.sign * self.diagnosis.test_command(self.period, diagnosis)
        return jnp.where(tested, test, 0.0), jnp.where(due, 0.0, probe)

    def _mode(self, diagnosis: DiagnosisMemory, wheeled: Wheeled, rests) -> Int[Array, ""]:
        changed = jnp.any((diagnosis.kind >= 0) | self.known)
        mode = jnp.where(changed, int(WheelMode.REALLOCATED), int(WheelMode.THREE_AXES))
        plane = jnp.where(rests, int(WheelMode.TWO_WHEELS), int(WheelMode.DAMPING))
        mode = jnp.where(wheeled.left == Left.PLANE, plane, mode)
        mode = jnp.where(wheeled.left == Left.LESS, int(WheelMode.DAMPING), mode)
        return jnp.where(diagnosis.stage == Stage.ALARM, int(WheelMode.ALARM), mode)

    def telemetry(self, memory: WheelLawMemory) -> dict[str, Array]:
        """The verdict on each wheel, how near an alarm it is, and whether there is one."""
        diagnosis = memory.diagnosis
        return {
            "diagnosed_kind": diagnosis.kind,
            "detection_statistic": jnp.max(diagnosis.statistic, axis=0) / self.diagnosis.threshold,
            "alarm": jnp.where(diagnosis.stage == Stage.ALARM, 1.0, 0.0),
        }

    def mode(self, memory: WheelLawMemory) -> Int[Array, ""]:
        """The `WheelMode` at work."""
        return memory.mode
