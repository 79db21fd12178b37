"""Fault-tolerant control: diagnosis of the actuators, and a law for those that still work."""

import dataclasses
import enum
import math
from typing import Annotated, ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import Diagnosis, DiagnosisMemory, false_alarm_rate
from jaxsat.control.diagnosis.residual import Reading, believed
from jaxsat.control.diagnosis.rod_fit import Outside
from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.control.quaternion_feedback import QuaternionFeedback, QuaternionFeedbackMemory
from jaxsat.control.reconfiguration import Rank
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.third_axis_band import BandMemory, ThirdAxisBand
from jaxsat.control.tolerant_actuators import (
    AbstractTolerantActuators,
    Instead,
    Sample,
    TolerantMemory,
    TolerantMode,
)
from jaxsat.control.tolerant_magnetic import (
    MagneticFlight,
    TolerantMagnetic,
    TolerantMagneticMemory,
)
from jaxsat.control.tolerant_mix import Mix, MixMemory, Unloading
from jaxsat.control.tolerant_rods import RodMemory, TolerantRods, about
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.three_torques import FAULT_TOLERANT
from jaxsat.core.quotients import root
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import wheel_momentum

DISPLACED, DISPLACED_MORE = 0.005, 0.05
"""Attitude error (rad) that torques which unload wheels may cause: a constant, and a part of the
attitude's distance from its target."""

NEGLIGIBLE = math.radians(0.02)
"""Attitude error (rad) by pulses against a steady torque of which twice is left, and four times
is corrected."""

PARALLEL = 1e-6
"""Singular value of unit axes below which a direction counts as not driven."""


class FaultTolerantMemory(NamedTuple):
    """Memory of the fault-tolerant law, of each kind of actuator, and the mode.

    `healthy` is that of the law of three axes, `mix` that of several kinds together, `rods` that of
    magnetorquers, `band` that of the axis no wheel drives, `magnetic` that of magnetorquers with at
    most one axis of wheels; each is None where that part is absent.
    """

    healthy: QuaternionFeedbackMemory
    actuators: tuple[TolerantMemory, ...]
    mix: MixMemory | None
    mode: Annotated[IntScalar, TolerantMode]
    rods: RodMemory | None = None
    band: BandMemory | None = None
    magnetic: TolerantMagneticMemory | None = None


Kinds = list[tuple[AbstractTolerantActuators, TolerantMemory]]
"""Actuators of each kind with their memory at this sample."""


class _Joint(NamedTuple):
    """Capability of all `kinds`: whether `three` axes are driven, and the `axis` (unit vector) that
    magnetorquers hold, zero where other actuators make all torques.

    `undriven` is the normal of two wheels that nothing drives, or zero: magnetorquers then unload
    body and wheels. `excess` is the momentum (N m s) of the wheels in use beyond their bias, `rods`
    the memory of magnetorquers. These four are None without magnetorquers.
    """

    kinds: Kinds
    three: BoolScalar
    axis: Vector | None = None
    undriven: Vector | None = None
    excess: Vector | None = None
    rods: RodMemory | None = None


def _missing(kinds: Kinds) -> Vector:
    """Return the unit axis about which one kind makes no torque, or zero."""
    return sum((one.missing(now) for one, now in kinds), jnp.zeros(3))


class FaultTolerant(AbstractSampledController):
    """Quaternion feedback with diagnosis of the actuators, and the best law for those still
    working.

    Each actuator gets its own command: duties of thrusters, torques (N m) of wheels on the body,
    dipoles (A m²) of magnetorquers. Inputs are estimates of attitude and rate, tachometers of
    wheels and the law's own commands. With torques about three axes quaternion feedback goes on;
    with torques in a plane each kind settles by its own law, see `AbstractTolerantActuators`; else
    rates are damped. With several kinds, see `Mix`, wheels make what they can of a torque and
    thrusters the rest; thrusters also unload full wheels. Magnetorquers, `rods`, unload wheels all
    the time while three axes are driven. Within a `band` the axis that no wheel drives coasts.
    """

    declaration: ClassVar[LawDeclaration] = FAULT_TOLERANT
    modes: ClassVar[type[enum.IntEnum]] = TolerantMode

    healthy: QuaternionFeedback
    diagnosis: Diagnosis
    actuators: tuple[AbstractTolerantActuators, ...]
    period: RealScalar = eqx.field(converter=as_float)
    rods: TolerantRods | None = None
    band: ThirdAxisBand | None = None
    magnetic: TolerantMagnetic | None = None

    def __check_init__(self):
        require_positive("period", self.period)
        if not self.actuators and self.rods is None:
            raise ValueError("Argument `actuators` must have at least one kind, but has none.")

    def init(self, state: PlantState) -> FaultTolerantMemory:
        """Return the memory at the start: all actuators work but those known to have failed."""
        reading = _reading(state)
        memories = tuple(
            one.init(state, reading, self.diagnosis.init(one.watch, reading))
            for one in self.actuators
        )
        mode = jnp.array(int(TolerantMode.THREE_AXES))
        mix = MixMemory.begin() if len(self.actuators) > 1 else None
        rods = None if self.rods is None else self.rods.begin(state.omega)
        band = None if self.band is None else BandMemory.begin()
        magnetic = None if self.magnetic is None else self.magnetic.init(state)
        healthy = self.healthy.init(state)
        return FaultTolerantMemory(healthy, memories, mix, mode, rods, band, magnetic)

    def step(
        self, t: RealScalar, state: PlantState, memory: FaultTolerantMemory
    ) -> tuple[Float[Array, " m"], FaultTolerantMemory]:
        """Return the command of each actuator, kind by kind, and the next memory."""
        if self.rods is None or memory.rods is None:
            return self._acting(t, state, memory)
        rods = self._watched(t, state, memory, memory.rods)
        working_rods = self.rods.diagnosed(rods)
        magnetic = None if self.magnetic is None else self.magnetic.diagnosed(working_rods)
        law = dataclasses.replace(self, rods=working_rods, magnetic=magnetic)
        return law._acting(t, state, memory._replace(rods=rods))

    def _acting(
        self, t: RealScalar, state: PlantState, memory: FaultTolerantMemory
    ) -> tuple[Float[Array, " m"], FaultTolerantMemory]:
        """Return commands and memory with the magnetorquers that work, by their diagnosis."""
        by_rods = None
        if self.rods is not None and memory.rods is not None:
            by_rods = self.rods.torque(memory.rods)
        reading = _reading(state, by_rods)
        sample = Sample(t, state, reading, self.healthy)
        kinds = [
            (one, one.able(sample, self._diagnosed(one, reading, before), before))
            for one, before in zip(self.actuators, memory.actuators, strict=True)
        ]
        mix = self._mix(sample, kinds)
        three = mix.spans(memory.mix)
        joint = self._joint(sample, kinds, three, memory.rods)
        flight = self._magnetic(sample, joint, memory.magnetic)
        slowed = sample._replace(law=self._slowed(sample, joint))
        torque, healthy = self._feedback(slowed, joint, memory.healthy)
        dipoles, rod_torque, rods = self._rods(sample, joint, torque, flight)
        whole, axis = three, joint.axis
        if rod_torque is not None and axis is not None:
            torque, whole = torque - rod_torque, three | jnp.any(axis != 0)
            torque = torque - axis * jnp.sum(axis * torque)
        torque, mix, besides, band = self._coasting(sample, joint, torque, mix, memory.band)
        following, unloading = self._unloading(sample, joint, mix, memory.mix)
        commands, memories = [], []
        demands, unmade = mix.demands(torque, unloading, whole)
        demands = [one._replace(besides=own) for one, own in zip(demands, besides, strict=True)]
        if flight is not None:
            demands = [
                demand._replace(instead=_instead(flight, one, now))
                for demand, (one, now) in zip(demands, kinds, strict=True)
            ]
        following = None if following is None else following._replace(unmade=unmade)
        for (one, now), before, demand in zip(kinds, memory.actuators, demands, strict=True):
            command, after = one.act(slowed, demand, before, now)
            commands.append(command)
            memories.append(after)
        mode = self._mode(whole, axis, flight, memories)
        magnetic = None if flight is None else flight.memory
        memory = FaultTolerantMemory(
            healthy, tuple(memories), following, mode, rods, band, magnetic
        )
        return jnp.concatenate([*commands, *dipoles]), memory

    def _magnetic(
        self, sample: Sample, joint: _Joint, before: TolerantMagneticMemory | None
    ) -> MagneticFlight | None:
        """Return the flight of the law `magnetic`, active where nothing else settles, or None."""
        axis, undriven = joint.axis, joint.undriven
        if self.magnetic is None or before is None or axis is None or undriven is None:
            return None
        settled, flows = joint.three | jnp.any(axis + undriven != 0), jnp.array(False)
        for one, now in joint.kinds:
            settled, flows = settled | one.alone(now), flows | one.flows(now)
        each = (one.in_use(now) for one, now in joint.kinds)
        in_use = next((one for one in each if one is not None), None)
        body_dipole = None if self.rods is None else self.rods.body_dipole(joint.rods)
        return self.magnetic.act(sample, ~settled, flows, in_use, before, body_dipole)

    def _joint(
        self, sample: Sample, kinds: Kinds, three: BoolScalar, before: RodMemory | None
    ) -> _Joint:
        """Return the capability of all kinds."""
        if self.rods is None or before is None:
            return _Joint(kinds, three)
        bias, model = self.rods.bias, self.healthy.model
        normal, field = jnp.where(three, 0.0, _missing(kinds)), self.rods.field(sample)
        each = [one.unloadable(sample, now, bias, field, jnp.array(True)) for one, now in kinds]
        excess = sum(each, 0 * bias)
        coasting = cast(Vector, self._stored(sample.reading)) - bias - excess
        overloaded = self.rods.overloaded(sample, normal, excess, coasting, before)
        holds = self.rods.holds(model.spacecraft.inertia, normal) & ~overloaded
        axis = jnp.where(holds, normal, 0.0)
        others = [one.alone(now) for one, now in kinds if one.in_use(now) is None]
        undriven = jnp.where(jnp.any(jnp.stack([jnp.array(False), *others])), 0.0, normal - axis)
        rods = before._replace(overloaded=overloaded)
        return _Joint(kinds, three, axis, undriven, excess, rods)

    def _feedback(
        self, sample: Sample, joint: _Joint, before: QuaternionFeedbackMemory
    ) -> tuple[Vector, QuaternionFeedbackMemory]:
        """Return the torque (N m) of a law, slower about an axis, with gyroscopic compensation.

        The law reads the mean rate where pulses oppose a steady torque.
        """
        stored, law, slower = self._stored(sample.reading), sample.law, sample.law
        sample = self._of_mean_rate(sample, joint)
        if self.rods is not None and joint.axis is not None:
            law, slower = self.rods.slowed(sample, joint.axis, cast(Vector, stored))
        torque, after = law.step(sample.t, sample.state, before)
        if joint.axis is not None:
            slow, _ = slower.step(sample.t, sample.state, before)
            torque = about(law.model.spacecraft.inertia, joint.axis, torque, slow)
        if stored is not None:
            torque = torque + jnp.cross(sample.state.omega, stored)
        return torque, after

    def _of_mean_rate(self, sample: Sample, joint: _Joint) -> Sample:
        """Return the sample with the mean rate of a period, as far as pulses that begin it and
        oppose a steady torque would point the law off: by 2ζ a (T/2) / Ω for an acceleration a."""
        law, early, steady = sample.law, jnp.zeros(3), jnp.zeros(3)
        for one, now in joint.kinds:
            early, steady = (
                early + one.early(now, self.period),
                steady + one.steady(now, self.period),
            )
        inverse = law.model.spacecraft.inverse_inertia
        offset = law.damping * self.period / law.natural_frequency * (inverse @ steady)
        part = believed(jnp.sum((offset / NEGLIGIBLE) ** 2))
        rate = sample.state.omega + part * (inverse @ early)
        return sample._replace(state=dataclasses.replace(sample.state, omega=rate))

    def _stored(self, reading: Reading) -> Vector | None:
        """Return the momentum (N m s) that all kinds store; None where none can."""
        each = [one.stored(reading) for one in self.actuators]
        momenta = [one for one in each if one is not None]
        if not momenta:
            return None if self.rods is None else jnp.zeros(3)
        return sum(momenta[1:], momenta[0])

    def _rods(
        self,
        sample: Sample,
        joint: _Joint,
        torque: Vector,
        flight: MagneticFlight | None,
    ) -> tuple[list[Float[Array, " k"]], Vector | None, RodMemory | None]:
        """Return the dipoles of magnetorquers (A m²), their torque (N m) and memory, if there are
        any."""
        axis, undriven, extra, before = joint.axis, joint.undriven, joint.excess, joint.rods
        if self.rods is None or before is None or axis is None or undriven is None or extra is None:
            return [], None, None
        bias, field, holds = self.rods.bias, self.rods.field(sample), jnp.any(axis != 0)
        each = [one.unloadable(sample, now, bias, field, holds) for one, now in joint.kinds]
        excess = jnp.where(joint.three | holds, sum(each, 0 * bias), 0.0)
        stored = cast(Vector, self._stored(sample.reading))
        coasting, hurries = stored - bias - extra, jnp.any(undriven != 0)
        whole = self.rods.whole(sample, extra)
        excess = jnp.where(hurries, whole, excess)
        relief = self.rods.relief(sample, axis, excess, coasting, hurries)
        body_dipole = self.rods.known_dipole(before)
        dipoles = self.rods.beside_wheels(field, relief, torque, axis, body_dipole)
        if flight is not None:
            dipoles = jnp.where(flight.acts, flight.dipoles, dipoles)
        commands, torque_of_rods, after = self.rods.act(field, dipoles, self.period, before)
        return [commands], torque_of_rods, after

    def _coasting(
        self, sample: Sample, joint: _Joint, torque: Vector, mix: Mix, before: BandMemory | None
    ) -> tuple[Vector, Mix, list[Float[Array, " m"] | None], BandMemory | None]:
        """Let the axis of the `band` coast: return the torque (N m) and the mix without it, the
        duties of thrusters at the band's edges, and the band's memory."""
        besides: list[Float[Array, " m"] | None] = [None] * len(joint.kinds)
        if self.band is None or before is None:
            return torque, mix, besides, None
        flows = jnp.any(jnp.stack([one.flows(now) for one, now in joint.kinds]))
        axis = jnp.where(joint.three & ~flows, _missing(joint.kinds), 0.0)
        stored = cast(Vector, self._stored(sample.reading))
        limits = [one.thrust_limit(now) for one, now in joint.kinds]
        place, limit = next((n, one) for n, one in enumerate(limits) if one is not None)
        correction = self.band.correct(
            sample.state, self.healthy, axis, torque, stored, limit, before
        )
        besides[place] = correction.duty
        without = jnp.where(correction.memory.coasts, axis, 0.0)
        return correction.torque, mix.without(without), besides, correction.memory

    def _slowed(self, sample: Sample, joint: _Joint) -> QuaternionFeedback:
        """Limit the slew rate of the law of three axes to momentum that the actuators can hold.

        With help by other kinds, not all of it need fit.
        """
        for one, now in joint.kinds:
            law = sample.law
            holds = (now.ability.rank == Rank.THREE_AXES) | ~joint.three
            rate = jnp.where(holds, one.slowed(sample, now).max_rate, law.max_rate)
            sample = sample._replace(law=dataclasses.replace(law, max_rate=rate))
        return sample.law

    def _mix(self, sample: Sample, kinds: Kinds) -> Mix:
        """Return the joint capability of all kinds."""
        return Mix(
            tuple(one.reach(sample, now) for one, now in kinds),
            tuple(one.steady(now, self.period) for one, now in kinds),
            tuple(now.ability.rank == Rank.THREE_AXES for _, now in kinds),
            tuple(one.alone(now) for one, now in kinds),
            tuple(one.stored(sample.reading) is not None for one in self.actuators),
            tuple(one.momentum_price(sample, now) for one, now in kinds),
        )

    def _unloading(
        self, sample: Sample, joint: _Joint, mix: Mix, before: MixMemory | None
    ) -> tuple[MixMemory | None, Unloading]:
        """Return the mix's memory and the torques (N m) that unload momentum from other devices.

        During unloading, and while a failed device makes a constant torque, steady torques are
        opposed first: wheels would be full again at once.
        """
        unloads, flows, torque = jnp.array(False), jnp.array(False), jnp.zeros(3)
        if before is None:
            return None, Unloading(torque, torque)
        for one, now in joint.kinds:
            full, relief = one.overfull(sample, now, before.unloads)
            unloads, torque = unloads | full, torque + relief
            flows = flows | one.flows(now)
        steady = sum(mix.steady, jnp.zeros(3))
        first = jnp.where((unloads | flows) & joint.three, steady, 0.0)
        following = before._replace(three=joint.three, unloads=unloads & joint.three)
        relief = jnp.where(joint.three, torque, 0.0)
        return following, Unloading(first, relief, self._error(sample.state))

    def _error(self, state: PlantState) -> Matrix:
        """Return the matrix that scales unloading torques (N m) to their errors over those that
        displace the body by the tolerated angle."""
        law = self.healthy
        off = 2 * root(jnp.sum(state.attitude.as_quaternion().q[1:] ** 2))
        borne = (DISPLACED + DISPLACED_MORE * off) * law.natural_frequency**2
        return self.diagnosis.uncertainty / borne * law.model.spacecraft.inverse_inertia

    def _diagnosed(
        self, one: AbstractTolerantActuators, reading: Reading, memory: TolerantMemory
    ) -> DiagnosisMemory:
        """Update the diagnosis of actuators of one kind by one sample."""
        return self.diagnosis.step(
            one.watch, reading, memory.commanded, self.period, memory.diagnosis, one.needed(memory)
        )

    def _watched(
        self, t: RealScalar, state: PlantState, memory: FaultTolerantMemory, rods: RodMemory
    ) -> RodMemory:
        """Update the diagnosis of magnetorquers by one sample, beside thrusters."""
        if self.rods is None:
            return rods
        thrust, quiet = jnp.zeros(3), jnp.array(True)
        for one, before in zip(self.actuators, memory.actuators, strict=True):
            thrust = thrust + one.pushed(before, self.period)
            quiet = quiet & one.quiet(before)
        stored = cast(Vector, self._stored(_reading(state)))
        outside = Outside(thrust, quiet)
        return self.rods.watched(t, state, stored, outside, self.period, rods, self.diagnosis)

    def _mode(
        self,
        three: BoolScalar,
        axis: Vector | None,
        flight: MagneticFlight | None,
        memories: list[TolerantMemory],
    ) -> IntScalar:
        changed, alarmed = jnp.array(False), jnp.array(False)
        mode = jnp.array(int(FLYABLE["none"].modes[0]))
        for one, memory in zip(self.actuators, memories, strict=True):
            mode = jnp.where(one.alone(memory), one.mode_alone(memory), mode)
            changed = changed | one.changed(memory)
            alarmed = alarmed | memory.diagnosis.alarmed
        if flight is not None:
            mode = jnp.where(flight.flies, flight.mode, mode)
        before, after = FLYABLE["three torques"].modes
        whole = jnp.where(changed, int(after), int(before))
        if axis is not None:
            whole = jnp.where(jnp.any(axis != 0), int(FLYABLE["magnetic"].modes[0]), whole)
        mode = jnp.where(three, whole, mode)
        return jnp.where(alarmed, int(TolerantMode.ALARM), mode)

    @property
    def known(self) -> Bool[Array, " wheels"] | None:
        """Wheels known to have failed before the start; None without wheels."""
        each = [one.failed_before for one in self.actuators]
        return next((one for one in each if one is not None), None)

    def holds_by_rods(
        self, axes: Float[np.ndarray, "3 k"], rods: Bool[np.ndarray, " rods"]
    ) -> bool:
        """Whether these magnetorquers make the torques that wheels along these axes cannot."""
        directions, sizes, _ = np.linalg.svd(axes)
        rank = np.sum(sizes > PARALLEL)
        if self.magnetic is not None and rank < 2:
            return self.magnetic.holds_with(axes, rods)
        if self.rods is None or rank != 2:
            return False
        inertia = self.healthy.model.spacecraft.inertia
        return bool(self.rods.only(rods).holds(inertia, as_float(directions[:, 2])))

    def false_alarm_rate(self, reference: float, threshold: float) -> float:
        """Upper limit of false alarms per sample by all tests; both arguments in sigmas."""
        rate = sum(false_alarm_rate(one.watch, reference, threshold) for one in self.actuators)
        fit = None if self.rods is None else self.rods.fit
        if fit is None:
            return rate
        return rate + fit.false_alarm_rate(reference, threshold, float(self.period))

    def telemetry(self, memory: FaultTolerantMemory) -> dict[str, Array]:
        """Return verdict and detection statistic of each actuator, and whether an alarm is on; with
        several kinds also the torque (N m) about three axes that they fail to make, and with
        magnetorquers the part of its dipole that each makes."""
        fit = None if memory.rods is None else memory.rods.fit
        rods = {} if fit is None else {"diagnosed_dipole": fit.part}
        diagnoses = [one.diagnosis for one in memory.actuators]
        if not diagnoses:
            return rods
        nearest = jnp.concatenate([jnp.max(one.statistic, axis=0) for one in diagnoses])
        alarmed = jnp.any(jnp.stack([one.alarmed for one in diagnoses]))
        mix = {} if memory.mix is None else {"torque_unmade": memory.mix.unmade}
        verdicts = {
            "diagnosed_kind": as_float(jnp.concatenate([one.kind for one in diagnoses])),
            "detection_statistic": nearest / self.diagnosis.threshold,
            "alarm": jnp.where(alarmed, 1.0, 0.0),
        }
        return mix | rods | verdicts

    @property
    def tells_unmade(self) -> bool:
        """Whether `telemetry` has the torque that actuators fail to make: with several kinds."""
        return len(self.actuators) > 1

    def mode(self, memory: FaultTolerantMemory) -> IntScalar:
        """Return the `TolerantMode` at work."""
        return memory.mode


def _instead(
    flight: MagneticFlight, one: AbstractTolerantActuators, now: TolerantMemory
) -> Instead:
    """Return the commands of one kind while the law `magnetic` flies: zero for all but wheels."""
    idle = one.in_use(now) is None
    return Instead(flight.flies, jnp.zeros_like(now.commanded) if idle else flight.torques)


def _reading(state: PlantState, rods: Vector | None = None) -> Reading:
    """Return the measured rate and wheel momenta, and the mean torque of magnetorquers (N m)."""
    return Reading(state.omega, wheel_momentum(state), rods)
