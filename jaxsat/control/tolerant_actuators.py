"""Actuators of one kind under the fault-tolerant law: watched, and used as far as they work."""

import abc
import enum
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control.diagnosis.diagnosis import DiagnosisMemory
from jaxsat.control.diagnosis.residual import AbstractResidualFilter, Reading
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.wheel_allocation import Wheeled
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach

PROBE_INTERVAL = 2.0
"""Over the natural frequency: a failed actuator is given a test pulse so often, whose effect would
show that it works."""


class TolerantMode(enum.IntEnum):
    """What the law does; those from `STOPPING` to `HOLDING` are the phases of three slews."""

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


class TolerantMemory(NamedTuple):
    """Of actuators of one kind: the diagnosis, what they can do, and what was commanded.

    `ability` has an attribute `left`, what they leave together. `commanded` is what they were to do
    since the last sample, as their filter has it, and `probe` (s) the time since the last test
    pulse. `own` is what one kind remembers besides.
    """

    diagnosis: DiagnosisMemory
    ability: Any
    commanded: Float[Array, " m"]
    probe: RealScalar
    own: PyTree


class Instead(NamedTuple):
    """What each actuator is to do in place of all else, `when` another law steers it."""

    when: BoolScalar
    use: Float[Array, " m"]


class Demand(NamedTuple):
    """What actuators of one kind are asked for: a `torque` on the body (N m), and `steady` (N m).

    The latter comes first; it makes up for what acts all the time. Where `three` is false no torque
    about three axes can be had, and they do what they can do alone. `use` is what each is to do for
    the torque where that is shared with other actuators, None where it is not. `besides` is what
    each is to do anyway, and `instead` what it does where another law steers it, None for nothing.
    """

    torque: Vector
    steady: Vector
    three: BoolScalar
    use: Float[Array, " m"] | None = None
    besides: Float[Array, " m"] | None = None
    instead: Instead | None = None


class Sample(NamedTuple):
    """What is known at a sample: the time (s), the estimate of the `state`, what is read, and the
    `law` of three axes with its gains, period and model."""

    t: RealScalar
    state: PlantState
    reading: Reading
    law: QuaternionFeedback


class AbstractTolerantActuators(eqx.Module):
    """What the fault-tolerant law knows of actuators of one kind, and how it uses them."""

    @property
    def failed_before(self) -> Bool[Array, " m"] | None:
        """Which are known to have failed before the start; None where that is never known."""

    @property
    @abc.abstractmethod
    def watch(self) -> AbstractResidualFilter:
        """The filter of what is read of them."""

    @abc.abstractmethod
    def init(
        self, state: PlantState, reading: Reading, diagnosis: DiagnosisMemory
    ) -> TolerantMemory:
        """The memory at the start."""

    @abc.abstractmethod
    def needed(self, memory: TolerantMemory) -> Bool[Array, " m"]:
        """Of which actuators a dead one is told from a weak one before it is given up."""

    @abc.abstractmethod
    def able(
        self, sample: Sample, diagnosis: DiagnosisMemory, before: TolerantMemory
    ) -> TolerantMemory:
        """The memory with the verdicts of this sample, and what is left by them."""

    @abc.abstractmethod
    def steady(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """What makes up for the torque (N m) that acts all the time."""

    @abc.abstractmethod
    def act(
        self, sample: Sample, demand: Demand, before: TolerantMemory, now: TolerantMemory
    ) -> tuple[Float[Array, " m"], TolerantMemory]:
        """The command of each, and the memory of the next sample; `before` is that of the last."""

    @abc.abstractmethod
    def damping(self, sample: Sample, memory: TolerantMemory) -> Float[Array, " m"]:
        """Commands that damp the rate, of which none puts energy in."""

    @abc.abstractmethod
    def alone(self, memory: TolerantMemory) -> tuple[BoolScalar, IntScalar]:
        """Whether they settle with torques in a plane alone, and the `TolerantMode` of that."""

    @abc.abstractmethod
    def reach(self, sample: Sample, memory: TolerantMemory) -> Reach:
        """What each can do to the body for a while, and what that costs."""

    def changed(self, memory: TolerantMemory) -> BoolScalar:
        """Whether something has failed."""
        return jnp.any(memory.diagnosis.condition.failed)

    def missing(self, memory: TolerantMemory) -> Vector:
        """The unit vector about which they make no torque, but all across it; or zero."""
        return jnp.zeros(3)

    def wheeled(self, memory: TolerantMemory) -> Wheeled | None:
        """What wheels are left; None for what is no wheel."""

    def flows(self, memory: TolerantMemory) -> BoolScalar:
        """Whether one that has failed makes a torque on the spacecraft all the time."""
        return jnp.zeros_like(memory.diagnosis.alarmed)

    def thrust_limit(self, memory: TolerantMemory) -> Float[Array, " m"] | None:
        """The part of its thrust that each makes; None for what is no thruster."""

    def stored(self, reading: Reading) -> Vector | None:
        """The momentum (N m s) that they hold; None for none ever."""

    def unloadable(
        self, sample: Sample, memory: TolerantMemory, bias: Vector, field: Vector, held: BoolScalar
    ) -> Vector:
        """The momentum (N m s) beyond a `bias` that they hold, and can do without alone: against
        a torque that takes it out across the Earth's `field` (T), they make all torques. Where the
        axis about which they make none is `held`, it may be more than that."""
        return jnp.zeros_like(bias)

    def overfull(
        self, sample: Sample, memory: TolerantMemory, unloads: BoolScalar
    ) -> tuple[BoolScalar, Vector]:
        """Whether other actuators are to take momentum out, as they do or not, and by what torque
        (N m)."""
        return jnp.zeros_like(unloads), jnp.zeros_like(sample.state.omega)

    def slowed(self, sample: Sample, memory: TolerantMemory) -> QuaternionFeedback:
        """The law with the rate at which a slew gives them no more momentum than they can hold."""
        return sample.law

    def probing(self, sample: Sample, memory: TolerantMemory) -> tuple[BoolScalar, RealScalar]:
        """Whether test pulses of failed actuators are due, and the time since the last (s)."""
        probe = memory.probe + sample.law.period
        interval = PROBE_INTERVAL / sample.law.natural_frequency
        due = (probe >= interval) & ~memory.diagnosis.alarmed
        return due, jnp.where(due, 0.0, probe)
