"""Flying parts of a closed loop, estimator, law and actuator commands, as functions of trees."""

from collections import namedtuple
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.control.navigation.estimator import AbstractEstimator
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude, Quaternion
from jaxsat.core.declaration.laws import value_of
from jaxsat.core.errors import ArgumentError, JaxsatError, foreign_exceptions
from jaxsat.core.once import once
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.distribution import AbstractDistribution
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.steering import AbstractSteering
from jaxsat.spacecraft.wheels import WheelMomenta, wheel_momentum

UNITS = {
    "attitude": "1",
    "omega": "rad/s",
    "rate": "rad/s",
    "wheel_momentum": "N m s",
    "magnetometer": "T",
    "sun_sensor": "1",
    "horizon_sensor": "1",
    "torque": "N m",
    "thrust": "N m",
    "wheel_torque": "N m",
    "dipole": "A m2",
    "valve_on": "s",
    "valve_off": "s",
    "level": "1",
}
"""Units of the fields of inputs and `SampleCommands`, where they have one."""


class CannotExport(JaxsatError):
    """A closed loop has a part without flight code; the message names it."""


def flight_loop(loop: AbstractLoop, start: PlantState, begin: float = 0.0) -> AbstractLoop:
    """Return the loop with the law that flight code has for a `start` at the time `begin` (s).

    Raises `CannotExport` if no plan from the start arrives, for a law that follows one.
    """
    if not isinstance(loop, SampledLoop):
        return loop
    try:
        law = loop.controller.flight_law(start, begin)
    except ArgumentError as error:
        raise CannotExport(f"initial: {error}") from None
    return eqx.tree_at(lambda x: x.controller, loop, law)


class Seen(NamedTuple):
    """Input of the law: attitude relative to the orbit frame, inertial angular velocity in body
    axes (rad/s), and the momentum of each wheel (N m s) if there are wheels."""

    attitude: AbstractAttitude
    omega: Vector
    wheel_momentum: Float[Array, " wheels"] | None = None

    @staticmethod
    def of(state: PlantState) -> "Seen":
        """Return the input for an estimate of the plant's state."""
        return Seen(state.attitude, state.omega, wheel_momentum(state))

    def as_state(self) -> PlantState:
        """Return the state of a plant with these numbers, as laws take it."""
        momentum = self.wheel_momentum
        states = None if momentum is None else (WheelMomenta(momentum),)
        return PlantState(self.attitude, self.omega, states)


class Input(NamedTuple):
    """One sample: its number, from any number on, and its measurements."""

    sample: IntScalar
    measured: PyTree


class State(NamedTuple):
    """Memory of the controller between samples; `begin_sample` is the number of the sample at which
    it began, from which it counts."""

    law: PyTree
    estimator: PyTree = None
    modulation: PyTree = None
    begin_sample: IntScalar | None = None


class SampleCommands(NamedTuple):
    """Commands of one sample.

    `torque` is the law's command (N m) about the first two body axes, or about all three. `thrust`
    is the torque of each thruster (N m); `wheel_torque` that of each motor on the body (N m);
    `dipole` that of each magnetorquer (A m²). `valve_on` and `valve_off` are the instants (s from
    the sample) at which each valve opens and closes, row by row, none where off is not later than
    on; `level` is the thrust meanwhile over the full one. `mode` is the active part of the law.
    """

    torque: Float[Array, " torques"]
    mode: IntScalar
    thrust: Float[Array, " m"] | None = None
    wheel_torque: Float[Array, " wheels"] | None = None
    valve_on: Float[Array, "p m"] | None = None
    valve_off: Float[Array, "p m"] | None = None
    level: Float[Array, "p m"] | None = None
    dipole: Float[Array, " k"] | None = None


class FlightController(eqx.Module):
    """The parts of a sampled loop that a flight computer runs, in order."""

    law: AbstractSampledController
    distribution: AbstractDistribution
    effectors: tuple[AbstractEffector, ...]
    estimator: AbstractEstimator | None = None
    attitude_sigma: RealScalar | None = None

    @staticmethod
    def of(loop: object) -> "FlightController":
        """Return the parts of a loop; raises `CannotExport` for one that is not sampled."""
        if not isinstance(loop, SampledLoop):
            raise CannotExport(
                "control.law: must be a law that runs once a period to become flight code, got one "
                "in continuous time"
            )
        if loop.controller.no_flight_code is not None:
            law = loop.controller
            raise CannotExport(
                f"control.law: must be a law with flight code, got {value_of(type(law))}: "
                f"{law.no_flight_code}"
            )
        parts = (loop.controller, loop.distribution, loop.plant.effectors)
        navigation = loop.navigation
        if navigation is None:
            return FlightController(*parts)
        if navigation.body is not None:
            other = "estimator.torque_noise_N_m_sqrt_Hz: must be left out"
            rule = "gyro: must be given" if navigation.gyro is None else other
            raise CannotExport(
                f"{rule} for what becomes flight code, whose filter takes in the rates of a gyro"
            )
        return FlightController(*parts, navigation.estimator, navigation.attitude_sigma)

    def sample(self, now: Input, state: State) -> tuple[Any, State]:
        """Return the commands of a sample, counted from the first on, and the state after it.

        They are `SampleCommands`, with further fields for effectors of packages.
        """
        law_input, memory = now.measured, state.estimator
        if self.estimator is not None:
            law_input, memory = self.estimate(now, memory)
        command, mode, law = self.control(now.sample, law_input, state.law)
        commands, modulation = self.allocate(law_input, command, state.modulation, now.sample)
        return _commands_of(command, mode, commands), State(law, memory, modulation)

    def begin(self, attitude: Array, now: Input) -> State:
        """Return the state before the first sample, of which `now` is the input."""
        memory, law_input = None, now.measured
        if self.estimator is not None:
            memory = self.begin_estimator(attitude)
            law_input = self.estimate(now, memory)[0]
        return State(self.begin_law(law_input), memory, self.begin_modulation())

    def estimate(self, now: Input, memory: PyTree) -> tuple[Seen, PyTree]:
        """Return the input of the law, and the estimator's memory."""
        assert self.estimator is not None
        measured = now.measured
        estimate, memory = self.estimator.step(
            now.sample, self.law.period, measured.measurement(), memory
        )
        return Seen(estimate.attitude, estimate.omega, measured.wheel_momentum), memory

    @property
    def steering(self) -> tuple[AbstractSteering, ...]:
        """Steering of effectors besides the law, which depends on the time."""
        return getattr(self.distribution, "steering", ())

    def require_steered(self, law_input: Seen) -> None:
        """Raise `CannotExport` for a steering that needs more than the input of the law."""
        kinds = {one.kind: one for one in self.effectors}
        for one in self.steering:
            owner = kinds[one.kind]

            def commands(state, one=one, owner=owner):
                use, _ = one(jnp.zeros(()), state, jnp.zeros(3))
                return owner.flight_commands(use, None, self.law.period)[0]

            rule = f"{one.kind}: must be left out of what becomes flight code"
            try:
                names = jax.eval_shape(commands, law_input.as_state()).keys()
            except foreign_exceptions() as error:
                text = str(error).strip().partition("\n")[0]
                raise CannotExport(
                    f"{rule}, which has attitude, rates and momenta of wheels alone, got "
                    f"{type(one).__name__}: {text}"
                ) from error
            if not names or names & set(SampleCommands._fields[:2]):
                got = " and ".join(names) or "none"
                raise CannotExport(
                    f"{rule} without `flight_commands` with names of their own in "
                    f"{type(owner).__name__}, got {got}"
                )

    def control(
        self, sample: Array, law_input: Seen, memory: PyTree
    ) -> tuple[Array, Array, PyTree]:
        """Return the law's command (N m), its mode and its memory; sample 0 is at time 0."""
        command, memory = self.law.step(self._time(sample), law_input.as_state(), memory)
        return command, self.law.mode(memory), memory

    def _time(self, sample: Array) -> Array:
        """Return the time of a sample, s."""
        period = jnp.asarray(self.law.period)
        return jnp.asarray(sample, period.dtype) * period

    def allocate(
        self, law_input: Seen, command: Array, memory: PyTree, sample: Array | None = None
    ) -> tuple[dict[str, Array], PyTree]:
        """Return the effectors' commands by name, and the modulator's memory.

        Only steering needs the `sample`.
        """
        time = self._time(sample) if self.steering and sample is not None else jnp.zeros(())
        uses = self.distribution(time, law_input.as_state(), command, self.effectors).uses
        commands: dict[str, Array] = {}
        for one, use in zip(self.effectors, uses, strict=True):
            own, memory = one.flight_commands(use, memory, self.law.period)
            if shared := commands.keys() & own.keys():
                raise CannotExport(
                    f"{one.kind}: `flight_commands` must use names of its own, got "
                    f"{' and '.join(sorted(shared))}, used by another effector"
                )
            commands |= own
        return commands, memory

    def begin_law(self, law_input: Seen) -> PyTree:
        """Return the law's memory before the first sample."""
        return self.law.init(law_input.as_state())

    def begin_estimator(self, attitude: Array) -> PyTree:
        """Return the estimator's memory before the first sample, for a first quaternion."""
        assert self.estimator is not None
        assert self.attitude_sigma is not None
        return self.estimator.init(Quaternion(attitude), self.attitude_sigma)

    def begin_modulation(self) -> PyTree:
        """Return the modulator's memory before the first sample."""
        return modulator_of(self.effectors, [one.init_memory() for one in self.effectors])


def _commands_of(command: Array, mode: Array, others: dict[str, Array]) -> Any:
    """Return `SampleCommands`, with further fields for commands of effectors of packages."""
    if others.keys() <= set(SampleCommands._fields):
        return SampleCommands(command, mode, **others)
    return _with_commands(tuple(others))(command, mode, **others)


@once
def _with_commands(names: tuple[str, ...]) -> Any:
    own = SampleCommands._fields
    fields = (*own, *(name for name in names if name not in own))
    return namedtuple(SampleCommands.__name__, fields, defaults=[None] * (len(fields) - 2))


def modulator_of(effectors: Sequence[AbstractEffector], memories: Sequence[PyTree]) -> PyTree:
    """Return the part of the effectors' memories that is the modulator's; None without one."""
    each = (one.modulator(memory) for one, memory in zip(effectors, memories, strict=True))
    return next((one for one in each if one is not None), None)


def as_type(tree: PyTree, dtype: Any) -> PyTree:
    """Return the tree with all floats of this type; shared arrays stay shared.

    Whole numbers have 32 bits beside floats of 32 bits, as in a trace of these.
    """
    arrays: dict[int, Any] = {}
    shorter = {np.dtype(np.int64): np.int32, np.dtype(np.uint64): np.uint32}
    whole = shorter if np.dtype(dtype).itemsize == 4 else {}

    def one(x: Any) -> Any:
        if not eqx.is_array_like(x):
            return x
        floating = jnp.issubdtype(jnp.result_type(x), jnp.floating)
        new_type = dtype if floating else whole.get(getattr(x, "dtype", None))
        return x if new_type is None else arrays.setdefault(id(x), jnp.asarray(x, new_type))

    return jax.tree.map(one, tree)
