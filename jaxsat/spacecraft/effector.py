"""What acts on the body, or takes momentum from it: one interface for every kind.

The method is back-substitution (Allard, Schaub and others, J. Aerospace Information Systems 15(12),
2018). With J the inertia of the body with all effectors locked and h the momentum that each stores
relative to the body, an effector tells, before dω/dt is known, its torque τ on the body and a
correction D of the inertia. The body solves

    (J + Σ D) dω/dt = -ω × (J ω + Σ h) + Σ τ

once, and gives dω/dt back, from which the effector has the derivative of its own state. A wheel
has D = -J_w a aᵀ, τ = a c and dh/dt = -c - J_w aᵀdω/dt, a magnetorquer D = 0, τ = m × B and no
state. A failure that strikes at once is the same with an impulse for τ and a change of ω for dω/dt.

Six things belong to an effector. Its *state* is integrated. Its *command* stays between samples or
comes from a continuous law. Its *mode* tells how it moves (a wheel rests, or is at its limit) and
may depend on dω/dt. Its *piece* is made of mode and command, and is what the torque depends on
until the mode changes. Its *failures* make of it another effector that fails no more. Its *reach*
is what it can do now, which is all that allocation and controllability know of it.
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
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.spacecraft.dispersible import Dispersible
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField, AbstractPlace
from jaxsat.spacecraft.held_effector import AbstractHeldEffector
from jaxsat.spacecraft.spacecraft import PlantState


class Effect(NamedTuple):
    """A torque on the body (N m), or an impulse (N m s), and the correction D of its inertia
    (kg m²), None for none."""

    torque: Vector
    inertia: Matrix | None = None


class EffectorContext(NamedTuple):
    """What a scenario gives an effector besides its own tables.

    `field` is the magnetic field along the circular orbit. `failures` in flight are the number,
    from 0, of the device that each strikes, and its checked table `[[failure]]`.
    """

    field: AbstractMagneticField
    failures: tuple[tuple[int, Any], ...]

    @property
    def place(self) -> AbstractPlace:
        """Where the circular orbit is."""
        return self.field.orbit


class Reach(NamedTuple):
    """What devices can do to the body now: `columns` @ use, each use from `low` to `high`.

    The use of a device is the number that commands it, of a reaction wheel a torque (N m), of a
    gimbal a rate (rad/s); its column is the torque on the body for one unit of it. `price` is what
    a unit costs, in kg/s of propellant, None for nothing. A device that does not obey has `low`
    equal to `high`.
    """

    columns: Float[Array, "3 n"]
    low: Float[Array, " n"]
    high: Float[Array, " n"]
    price: Float[Array, " n"] | None = None

    @staticmethod
    def none() -> "Reach":
        """The reach of an effector that can do nothing."""
        return Reach(jnp.zeros((3, 0)), jnp.zeros(0), jnp.zeros(0))


class Storage(NamedTuple):
    """What each device that stores momentum is: its rotor's inertia about its column of the reach,
    kg m², zero where that does not turn freely, and the most it can hold, N m s."""

    rotors: Float[Array | np.ndarray, " n"]
    capacity: Float[Array | np.ndarray, " n"]


class Dipoles(NamedTuple):
    """Devices whose torque is that of a dipole along unit `axes` (body axes), of at most its limit
    (A m²), in the Earth's magnetic `field`."""

    axes: Float[Array, "3 k"]
    limits: Float[Array, " k"]
    field: AbstractMagneticField


class AbstractEffector(AbstractHeldEffector):
    """A set of `count` devices of one `kind`, each of which has one number as its command.

    Thrusters may share a command of two or three torques themselves: see `command_size`.

    What a kind does not have, a state, modes, edges, corners, it need not define. One that a
    scenario can have is declared in `jaxsat.core.declaration`, and has a class method
    `from_tables(tables, context)`, which gives the effector and its state at the start, of checked
    tables and an `EffectorContext`.
    """

    kind: ClassVar[str]
    """What one of them is called; commands and names of those that fail go by it."""

    columns_change: ClassVar[bool] = False
    """Whether the columns of its reach change with time, attitude or its own state."""

    dispersible: ClassVar[Mapping[str, Dispersible]] = MappingProxyType({})
    """What the quantities change that its declaration names as dispersible."""

    even: ClassVar[bool] = False
    """Whether its torque depends on command and time alone, and changes evenly in a hold."""

    blows: ClassVar[bool] = False
    """Whether a failure may give the body an impulse: see `blow`."""

    mild_corners: ClassVar[bool] = False
    """Whether steps may pass its corners, see `event_functions`, without much loss."""

    failures: eqx.AbstractVar[Any]
    """`AbstractFailures` of its kind, None for none in flight."""

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """How many devices there are."""

    @property
    def command_size(self) -> int:
        """How many numbers command it: one for each device."""
        return self.count

    # State and command.

    def init(self) -> PyTree:
        """The state at rest; None for a kind without a state."""
        return None

    def idle(self) -> Float[Array, " size"]:
        """The command that asks for nothing."""
        return jnp.zeros(self.command_size)

    def with_momenta(self, state: PyTree, change: Callable[[Array], Array]) -> PyTree:
        """The state, its rate or its error with `change` of each momentum in it, N m s.

        A similar body that is k times as heavy has k times the momenta, and all else the same.
        """
        return state

    def momentum(self, state: PyTree) -> Vector | None:
        """What is stored relative to the body, in body axes, N m s; None for nothing ever."""
        return None

    def storage(self) -> Storage | None:
        """What each device can store, without limit unless stated; None for nothing ever."""
        if self.momentum(self.init()) is None:
            return None
        return Storage(jnp.zeros(self.count), jnp.full(self.count, jnp.inf))

    def dipoles(self) -> Dipoles | None:
        """The dipoles of devices that turn the body in a magnetic field; None for other kinds."""
        return None

    def free_inertia(self) -> Matrix | None:
        """D where all devices move freely, kg m²; None for none ever."""
        return None

    def unmade(self, use: Float[Array, " size"]) -> Vector | None:
        """The torque of what is asked for that is beyond the limits, as whoever allocates knows
        them, N m; None for a kind that is asked for something else, or does not tell."""
        return None

    # Failures in flight.

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When each failure strikes, s; none of those that divide a plan into holds."""
        return jnp.zeros(0) if self.failures is None else self.failures.at

    def last_drawn_kind(self, sampled: bool) -> AbstractFailureKind | None:
        """The last kind of failure that a study may draw, under a `sampled` law or a continuous
        one; None for all that its declaration names."""
        return None

    def blow(self, state: PyTree, struck: Bool[Array, " f"]) -> Effect:
        """What the body gets at once where these failures have struck."""
        return Effect(jnp.zeros(3))

    def blown(self, state: PyTree, struck: Bool[Array, " f"], change: Vector) -> PyTree:
        """The state after a blow that changed the body's ω by `change` (rad/s)."""
        return state

    @abc.abstractmethod
    def driven(
        self, state: PyTree, command: PyTree, struck: Bool[Array, " f"]
    ) -> "tuple[AbstractEffector, PyTree]":
        """The effector that fails no more once these failures have struck, and its command."""

    def reach(
        self,
        t: RealScalar,
        plant: PlantState,
        state: PyTree,
        struck: Bool[Array, " f"],
        span: RealScalar,
    ) -> Reach:
        """What the devices can do at time `t` (s) once these failures have struck.

        That which they can go on doing for `span` seconds; of zero seconds, now.
        """
        return Reach.none()

    # Motion: the effect and the derivative in a mode and a piece, which `AbstractHeldEffector` has.

    @property
    def mode_passes(self) -> int:
        """How often `mode_after` is asked to come from `mode` to that at a dω/dt."""
        return 0

    def mode_after(
        self, mode: PyTree, state: PyTree, command: PyTree, acceleration: Vector
    ) -> PyTree:
        """The mode after one that devices have left where the body has this dω/dt (rad/s²)."""
        return mode

    @abc.abstractmethod
    def effect(self, piece: PyTree, t: RealScalar, plant: PlantState, state: PyTree) -> Effect:
        """Torque and correction of the inertia at time `t` (s); `state` is the effector's own."""

    def derivative(
        self, piece: PyTree, plant: PlantState, state: PyTree, acceleration: Vector
    ) -> PyTree:
        """Time derivative of the own state where the body has this dω/dt (rad/s²)."""
        return jax.tree.map(jnp.zeros_like, state)

    def torque(
        self, piece: PyTree, t: RealScalar, plant: PlantState, state: PyTree, acceleration: Vector
    ) -> Vector:
        """All that the devices do to the body with them locked, N m."""
        return self.effect(piece, t, plant, state).torque

    def signals(self, piece: PyTree, state: PyTree, acceleration: Vector) -> dict[str, Array]:
        """What the devices do, by the names of signals that they declare."""
        return {}

    def stored(self, state: PyTree) -> dict[str, Array]:
        """What they store, by the names of signals that they declare."""
        return {}

    # A command that changes continuously: events, and the smooth piece between two of them.

    @property
    def event_count(self) -> int:
        """How many corners there are under a continuous command."""
        return 0

    def event_functions(
        self, state: PyTree, command: PyTree, acceleration: Vector
    ) -> Float[Array, " m"]:
        """Functions whose zeros are the corners."""
        return jnp.zeros(0, acceleration.dtype)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractEffector":
        """This effector with each event function on the side that `signs` gives."""
        return self

    def without_corners(self) -> "AbstractEffector":
        """This effector without failures in flight, and without what needs a held command."""
        if self.failures is None:
            return self
        return eqx.tree_at(lambda one: one.failures, self, None)

    def require_continuous(self) -> None:
        """Raise `ValueError` where the effector cannot have a command that is not held."""
