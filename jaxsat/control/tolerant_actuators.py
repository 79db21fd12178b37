"""Interface of actuators of one kind under the fault-tolerant law."""

import abc
import enum
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control.diagnosis.diagnosis import DiagnosisMemory
from jaxsat.control.diagnosis.residual import AbstractResidualFilter, Reading
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.wheel_allocation import WheelsInUse
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.spacecraft.allocation import MomentumPrice
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach

PROBE_INTERVAL = 2.0
"""Interval of test pulses of failed actuators, over the natural frequency: their effect shows a
recovery."""


class TolerantMode(enum.IntEnum):
    """Mode of the fault-tolerant law; `STOPPING` to `HOLDING` are the phases of three slews."""

    THREE_AXES = 0
    ALARM = 1
    REALLOCATED = 2
    STOPPING = 3
    SLEWING = 4
    OSCILLATING = 5
    HOLDING = 6
    DAMPING = 7
    TWO_WHEELS = 8
    RODS = 9
    NEAREST = 10
    MAGNETIC_DAMPING = 11
    MAGNETIC_SLEWING = 12
    MAGNETIC_POINTING = 13


def tolerant_mode(mode: IntScalar, modes: type[enum.IntEnum], prefix: str = "") -> IntScalar:
    """Return the `TolerantMode` of another law's mode: that of its name, behind the prefix."""
    *others, last = modes
    tolerant = jnp.array(TolerantMode[prefix + last.name])
    for one in others:
        tolerant = jnp.where(mode == one, TolerantMode[prefix + one.name], tolerant)
    return tolerant


class TolerantMemory(NamedTuple):
    """Memory of actuators of one kind: diagnosis, ability, and last command.

    `ability` has an attribute `rank`, that of the remaining torques. `commanded` is the command
    since the last sample as the residual filter reads it, `probe` (s) the time since the last test
    pulse, `own` the memory of the kind.
    """

    diagnosis: DiagnosisMemory
    ability: Any
    commanded: Float[Array, " m"]
    probe: RealScalar
    own: PyTree


class Instead(NamedTuple):
    """Commands `use` of another law, which replace all else `when` it steers the actuators."""

    when: BoolScalar
    use: Float[Array, " m"]


class Demand(NamedTuple):
    """Demand on actuators of one kind: a `torque` on the body (N m), and `steady` (N m).

    `steady` comes first: it opposes constant torques. Where `three` is false, no torque about three
    axes exists, and each kind acts alone. `use` is the command of each actuator where the torque is
    shared among kinds, else None. `besides` is added to every command; `instead` replaces it where
    another law steers. Both may be None.
    """

    torque: Vector
    steady: Vector
    three: BoolScalar
    use: Float[Array, " m"] | None = None
    besides: Float[Array, " m"] | None = None
    instead: Instead | None = None


class Sample(NamedTuple):
    """Inputs of one sample: time (s), estimated `state`, sensor reading, and the `law` of three
    axes."""

    t: RealScalar
    state: PlantState
    reading: Reading
    law: QuaternionFeedback


class AbstractTolerantActuators(eqx.Module):
    """Actuators of one kind under the fault-tolerant law: diagnosis, ability and commands."""

    @property
    def failed_before(self) -> Bool[Array, " m"] | None:
        """Actuators known to have failed before the start; None if this is never known."""

    @property
    @abc.abstractmethod
    def watch(self) -> AbstractResidualFilter:
        """The residual filter of their measurements."""

    @abc.abstractmethod
    def init(
        self, state: PlantState, reading: Reading, diagnosis: DiagnosisMemory
    ) -> TolerantMemory:
        """Return the memory at the start."""

    @abc.abstractmethod
    def needed(self, memory: TolerantMemory) -> Bool[Array, " m"]:
        """Actuators to be given up only if dead, not if weak."""

    @abc.abstractmethod
    def able(
        self, sample: Sample, diagnosis: DiagnosisMemory, before: TolerantMemory
    ) -> TolerantMemory:
        """Update the memory by the verdicts of this sample and the capability they leave."""

    @abc.abstractmethod
    def steady(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return the torque (N m) that opposes constant disturbances."""

    @abc.abstractmethod
    def act(
        self, sample: Sample, demand: Demand, before: TolerantMemory, now: TolerantMemory
    ) -> tuple[Float[Array, " m"], TolerantMemory]:
        """Return the commands and the next memory; `before` is the memory of the last sample."""

    @abc.abstractmethod
    def damping(self, sample: Sample, memory: TolerantMemory) -> Float[Array, " m"]:
        """Return commands that damp the rate, none of which adds energy."""

    @abc.abstractmethod
    def alone(self, memory: TolerantMemory) -> BoolScalar:
        """Whether they settle alone with torques in a plane."""

    @abc.abstractmethod
    def mode_alone(self, memory: TolerantMemory) -> IntScalar:
        """Return the `TolerantMode` in which they do."""

    @abc.abstractmethod
    def reach(self, sample: Sample, memory: TolerantMemory) -> Reach:
        """Return the range of torques of each actuator for a while, and their price."""

    def changed(self, memory: TolerantMemory) -> BoolScalar:
        """Whether an actuator has failed."""
        return jnp.any(memory.diagnosis.condition.failed)

    def missing(self, memory: TolerantMemory) -> Vector:
        """Return the unit vector about which alone they make no torque, or zero."""
        return jnp.zeros(3)

    def in_use(self, memory: TolerantMemory) -> WheelsInUse | None:
        """Return the remaining wheels; None for other kinds."""

    def flows(self, memory: TolerantMemory) -> BoolScalar:
        """Whether a failed actuator makes a constant torque on the spacecraft."""
        return jnp.zeros_like(memory.diagnosis.alarmed)

    def pushed(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return the mean torque (N m) on body and wheels since the last sample, as expected."""
        return jnp.zeros(3)

    def early(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return the momentum (N m s) that the mean over the last period has beyond its end, by
        pulses at the start of the period against a constant torque.

        These leave a rate at each sample, although its mean is zero.
        """
        return jnp.zeros(3)

    def quiet(self, memory: TolerantMemory) -> BoolScalar:
        """Whether `pushed` is as expected: nothing is suspected that makes torques from outside."""
        return jnp.array(True)

    def thrust_limit(self, memory: TolerantMemory) -> Float[Array, " m"] | None:
        """Return the fraction of its thrust that each thruster makes; None for other kinds."""

    def stored(self, reading: Reading) -> Vector | None:
        """Return the stored momentum (N m s); None for actuators that store none."""

    def unloadable(
        self, sample: Sample, memory: TolerantMemory, bias: Vector, field: Vector, held: BoolScalar
    ) -> Vector:
        """Return the momentum (N m s) beyond a `bias` that magnetorquers can unload across the
        Earth's `field` (T) while these actuators make all torques; more where the axis that they
        lack is `held`."""
        return jnp.zeros_like(bias)

    def overfull(
        self, sample: Sample, memory: TolerantMemory, unloads: BoolScalar
    ) -> tuple[BoolScalar, Vector]:
        """Whether other actuators should unload momentum (hysteresis by `unloads`), and the torque
        (N m)."""
        return jnp.zeros_like(unloads), jnp.zeros_like(sample.state.omega)

    def momentum_price(self, sample: Sample, memory: TolerantMemory) -> MomentumPrice:
        """Return the price of momentum that other actuators make them store."""
        count = memory.commanded.shape[0]
        return MomentumPrice(jnp.zeros((count, 3)), jnp.zeros(count))

    def slowed(self, sample: Sample, memory: TolerantMemory) -> QuaternionFeedback:
        """Return the law with the slew rate limited to the momentum that they can store."""
        return sample.law

    def probing(self, sample: Sample, memory: TolerantMemory) -> tuple[BoolScalar, RealScalar]:
        """Whether test pulses of failed actuators are due, and the time since the last (s)."""
        probe = memory.probe + sample.law.period
        interval = PROBE_INTERVAL / sample.law.natural_frequency
        due = (probe >= interval) & ~memory.diagnosis.alarmed
        return due, jnp.where(due, 0.0, probe)
