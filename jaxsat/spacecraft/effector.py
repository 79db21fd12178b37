"""The interface of every kind of effector: a device that acts on the body or stores momentum.

The method is back-substitution (Allard, Schaub and others, J. Aerospace Information Systems 15(12),
2018). With J the inertia of the body with all effectors locked and h the momentum that each stores
relative to the body, an effector gives, before dω/dt is known, its torque τ on the body and a
correction D of the inertia. The body solves

    (J + Σ D) dω/dt = -ω × (J ω + Σ h) + Σ τ

once, and returns dω/dt, from which the effector has the derivative of its own state. A wheel
has D = -J_w a aᵀ, τ = a c and dh/dt = -c - J_w aᵀdω/dt, a magnetorquer D = 0, τ = m × B and no
state. An instantaneous failure is the same with an impulse for τ and a change of ω for dω/dt.

An effector has six properties. Its *state* is integrated. Its *command* is held between samples or
comes from a continuous law. Its *mode* is how it moves (a wheel rests, or is at its limit) and
may depend on dω/dt. Its *piece* follows from mode and command, and determines the torque until the
mode changes. Its *failures* turn it into another effector that does not fail. Its *reach* is the
set of its possible torques now, all that allocation and controllability know of it.
"""

import abc
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.spacecraft.dispersible import Dispersible
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField, AbstractPlace
from jaxsat.spacecraft.environment.sensed_vectors import AbstractSensedVector
from jaxsat.spacecraft.held_effector import AbstractHeldEffector
from jaxsat.spacecraft.spacecraft import PlantState


class Effect(NamedTuple):
    """A torque on the body (N m), or an impulse (N m s), and the correction D of its inertia
    (kg m²), None for none."""

    torque: Vector
    inertia: Matrix | None = None


class EffectorContext(NamedTuple):
    """Inputs from a scenario for an effector besides its own tables.

    `field` is the magnetic field along the orbit, `sunlight` the direction to the Sun with its
    shadow, in the reference frame of the attitude. `failures` in flight are pairs of the number of
    the device, from 0, and its checked table `[[failure]]`.
    """

    field: AbstractMagneticField
    sunlight: AbstractSensedVector
    failures: tuple[tuple[int, Any], ...]

    @property
    def place(self) -> AbstractPlace:
        """The orbit."""
        return self.field.orbit


class Reach(NamedTuple):
    """Possible torques of devices now: `columns` @ use, each use from `low` to `high`.

    The use of a device is its command: for a reaction wheel a torque (N m), for a gimbal a rate
    (rad/s); its column is the torque on the body per unit of use. `price` is the cost of a unit, in
    kg/s of propellant, None for zero. A device that does not obey has `low` equal to `high`.
    """

    columns: Float[Array, "3 n"]
    low: Float[Array, " n"]
    high: Float[Array, " n"]
    price: Float[Array, " n"] | None = None

    @staticmethod
    def none() -> "Reach":
        """Return the reach of an effector that makes no torque."""
        return Reach(jnp.zeros((3, 0)), jnp.zeros(0), jnp.zeros(0))


class Storage(NamedTuple):
    """Rotor inertia (kg m²) about the column of the reach, zero for a rotor that does not turn
    freely, and largest momentum (N m s) of each device that stores momentum."""

    rotors: Float[Array | np.ndarray, " n"]
    capacity: Float[Array | np.ndarray, " n"]


class Dipoles(NamedTuple):
    """Devices that make the torque of a dipole along unit `axes` (body axes), up to their `limits`
    (A m²), in the Earth's magnetic `field`."""

    axes: Float[Array, "3 k"]
    limits: Float[Array, " k"]
    field: AbstractMagneticField


class AbstractEffector(AbstractHeldEffector):
    """A set of `count` devices of one `kind`, each commanded by one number.

    Thrusters may share a command of two or three torques instead: see `command_size`.

    A kind defines only the properties that it has of state, modes, edges and corners. A kind for
    scenarios is declared in `jaxsat.core.declaration`, and has a class method
    `from_tables(tables, context)`, which returns the effector and its initial state from checked
    tables and an `EffectorContext`.
    """

    kind: ClassVar[str]
    """Name of a device, used for commands and failures."""

    columns_change: ClassVar[bool] = False
    """Whether the columns of the reach change with time, attitude or the effector's state."""

    dispersible: ClassVar[Mapping[str, Dispersible]] = MappingProxyType({})
    """Effects of the quantities that the declaration lists as dispersible."""

    even: ClassVar[bool] = False
    """Whether the torque depends on command and time alone, and changes evenly in a hold."""

    blows: ClassVar[bool] = False
    """Whether a failure may give the body an impulse: see `blow`."""

    mild_corners: ClassVar[bool] = False
    """Whether steps may pass the corners, see `event_functions`, with little loss of accuracy."""

    failures: eqx.AbstractVar[Any]
    """The kind's `AbstractFailures`, None without failures in flight."""

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """Number of devices."""

    @property
    def command_size(self) -> int:
        """Number of components of the command: one for each device."""
        return self.count

    # State and command.

    def init(self) -> PyTree:
        """Return the state at rest; None for a kind without a state."""
        return None

    def idle(self) -> Float[Array, " size"]:
        """Return the command for zero torque."""
        return jnp.zeros(self.command_size)

    def with_momenta(self, state: PyTree, change: Callable[[Array], Array]) -> PyTree:
        """Return the state, its rate or its error with `change` applied to each momentum, N m s.

        A similar body that is k times as heavy has k times the momenta, and all else the same.
        """
        return state

    def momentum(self, state: PyTree) -> Vector | None:
        """Return the momentum relative to the body, body axes, N m s; None for kinds without."""
        return None

    def storage(self) -> Storage | None:
        """Return each device's storage, unbounded by default; None for kinds without momentum."""
        if self.momentum(self.init()) is None:
            return None
        return Storage(jnp.zeros(self.count), jnp.full(self.count, jnp.inf))

    def dipoles(self) -> Dipoles | None:
        """Return the dipoles of magnetic devices; None for other kinds."""
        return None

    def free_inertia(self) -> Matrix | None:
        """Return D with all devices free to move, kg m²; None for kinds without a correction."""
        return None

    def unmade(self, use: Float[Array, " size"]) -> Vector | None:
        """Return the commanded torque beyond the limits that the allocator knows, N m; None for a
        kind that is not commanded a torque, or does not compute it."""
        return None

    # Failures in flight.

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """Time of each failure, s; empty if failures divide a plan into holds."""
        return jnp.zeros(0) if self.failures is None else self.failures.at

    def last_drawn_kind(self, sampled: bool) -> AbstractFailureKind | None:
        """Return the last kind of failure that a study may draw, under a `sampled` law or a
        continuous one; None for all kinds of the declaration."""
        return None

    def blow(self, state: PyTree, struck: Bool[Array, " f"]) -> Effect:
        """Return the impulse on the body at the instant when these failures strike."""
        return Effect(jnp.zeros(3), self.free_inertia())

    def blown(self, state: PyTree, struck: Bool[Array, " f"], change: Vector) -> PyTree:
        """Return the state after a blow that changed the body's ω by `change` (rad/s).

        By default it changes as `derivative` does with dω/dt, which is linear in it.
        """
        if self.free_inertia() is None:
            return state
        piece = self.piece(self.mode(state), self.idle())
        plant = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), jnp.zeros(3))
        after, before = (self.derivative(piece, plant, state, x) for x in (change, 0 * change))
        return jax.tree.map(lambda x, a, b: x + (a - b), state, after, before)

    @abc.abstractmethod
    def driven(
        self, state: PyTree, command: PyTree, struck: Bool[Array, " f"]
    ) -> "tuple[AbstractEffector, PyTree]":
        """Return the effector after these failures, which fails no more, and its command.

        It makes the modes and pieces of a hold. `effect` and `derivative` of the effector itself
        then receive these pieces, so that all that a failure changes of them is in the piece.
        """

    def reach(
        self,
        t: RealScalar,
        plant: PlantState,
        state: PyTree,
        struck: Bool[Array, " f"],
        span: RealScalar,
    ) -> Reach:
        """Return the reach at time `t` (s) after the failures that have struck.

        The reach can be sustained for `span` seconds; zero gives the instantaneous reach.
        """
        return Reach.none()

    # Motion in a mode and a piece, which `AbstractHeldEffector` defines.

    @property
    def mode_passes(self) -> int:
        """Number of calls of `mode_after` from `mode` to the mode at a dω/dt."""
        return 0

    def mode_after(
        self, mode: PyTree, state: PyTree, command: PyTree, acceleration: Vector
    ) -> PyTree:
        """Return the mode that follows this one where the body has this dω/dt (rad/s²)."""
        return mode

    @abc.abstractmethod
    def effect(self, piece: PyTree, t: RealScalar, plant: PlantState, state: PyTree) -> Effect:
        """Return torque and correction of the inertia at time `t` (s) for the own `state`."""

    def derivative(
        self, piece: PyTree, plant: PlantState, state: PyTree, acceleration: Vector
    ) -> PyTree:
        """Return the derivative of the effector's state where the body has this dω/dt (rad/s²)."""
        return jax.tree.map(jnp.zeros_like, state)

    def torque(self, piece: PyTree, effect: Effect, state: PyTree, acceleration: Vector) -> Vector:
        """Return the total torque of the devices on the body with devices locked, N m.

        `effect` is their effect, with which the body has this dω/dt (rad/s²).
        """
        return effect.torque

    def signals(self, piece: PyTree, state: PyTree, acceleration: Vector) -> dict[str, Array]:
        """Return the declared signals of motion, by name."""
        return {}

    def stored(self, state: PyTree) -> dict[str, Array]:
        """Return the declared signals of state, by name."""
        return {}

    # A continuous command: events, and the smooth piece between two of them.

    @property
    def event_count(self) -> int:
        """Number of corners under a continuous command."""
        return 0

    def event_functions(
        self, state: PyTree, command: PyTree, acceleration: Vector
    ) -> Float[Array, " m"]:
        """Return functions whose zeros are the corners."""
        return jnp.zeros(0, acceleration.dtype)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractEffector":
        """Return this effector with each event function on the side that `signs` gives."""
        return self

    def without_corners(self) -> "AbstractEffector":
        """Return this effector without failures in flight and features that need a held command."""
        if self.failures is None:
            return self
        return eqx.tree_at(lambda one: one.failures, self, None)

    def require_continuous(self) -> None:
        """Raise `ValueError` where the effector requires a held command."""
