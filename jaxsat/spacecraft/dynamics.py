"""The plant: a rigid body in a circular orbit, equations (1), (10), (11), (36), (37).

With effectors that store momentum it is a gyrostat (Hughes, Spacecraft Attitude Dynamics, 1986,
section 3.4).
How a body and its effectors exchange torque and momentum: `jaxsat.spacecraft.effector`.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.checks import require_inertia
from jaxsat.spacecraft.effector import AbstractEffector, Effect
from jaxsat.spacecraft.environment.disturbances import AbstractDisturbance, NoDisturbance
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.spacecraft import OfEach, PlantState, Spacecraft, inverse_of

Struck = tuple[Bool[Array, " _"], ...]
"""Whether each failure of each effector has struck."""


class BodyMotion(NamedTuple):
    """The `rate` of a body's state, its angular velocity ω_r relative to the orbit frame (rad/s),
    and the effectors' torque on it (N m)."""

    rate: PlantState
    relative_rate: Vector
    torque: Vector


class RigidBody(eqx.Module):
    """A rigid body in a circular orbit under a torque and a disturbance.

    With `third_rate_held` an ideal torque about the third body axis keeps ω3 constant: the
    assumption of the paper's simulations of its three-axis law, which two reaction wheels with
    zero total momentum make true. A controller has a `RigidBody` of its own as its model, so that
    plant and model can differ.

    The inertia includes all `effectors` locked. Raises `ValueError` for effectors with a state on
    a body whose third rate is held, and for effectors with more inertia than the whole body.
    """

    spacecraft: Spacecraft
    orbit: AbstractOrbit
    disturbance: AbstractDisturbance = NoDisturbance()
    third_rate_held: bool = eqx.field(static=True, default=False)
    effectors: tuple[AbstractEffector, ...] = ()

    def __check_init__(self):
        if self.third_rate_held and jax.tree.leaves([one.init() for one in self.effectors]):
            raise ValueError("The third rate of a body with wheels must not be held.")
        free = [one.free_inertia() for one in self.effectors]
        if any(one is not None for one in free):
            require_inertia("inertia less that of all rotors", self._inertia(free))

    @property
    def stores_momentum(self) -> bool:
        """Whether any effector stores momentum."""
        return any(one.storage() is not None for one in self.effectors)

    def relative_rate(self, state: PlantState) -> Vector:
        """Angular velocity ω_r relative to the orbit frame, equation (11), rad/s."""
        return state.omega - self.orbit.frame_rate(state.attitude)

    def disturbance_torque(self, t: RealScalar, state: PlantState) -> Vector:
        """Return the disturbance torque T_d at time `t` (s), N m."""
        return self.disturbance(t, state.attitude, self.spacecraft.inertia)

    def total_momentum(self, state: PlantState) -> Vector:
        """Return J ω + Σ h, body axes, N m s: constant in inertial axes without external torque."""
        total = self.spacecraft.inertia @ state.omega
        for one, own in self._with(state):
            stored = one.momentum(own)
            total = total if stored is None else total + stored
        return total

    def _with(self, state: PlantState) -> list[tuple]:
        """Return each effector with its state; empty where the plant's state has no effectors."""
        states = state.of_each if self.effectors else ()
        return list(zip(self.effectors, states, strict=True)) if states else []

    @staticmethod
    def _sum(torques: Sequence[Vector], first: Vector | None) -> Vector:
        torques = [*(() if first is None else (first,)), *torques]
        return sum(torques[1:], torques[0]) if torques else jnp.zeros(3)

    def _inertia(self, corrections: list[Matrix | None]) -> Matrix:
        return sum((one for one in corrections if one is not None), self.spacecraft.inertia)

    def angular_acceleration(self, omega: Vector, torque: Vector) -> Vector:
        """Solve equation (1), J dω/dt = -ω × J ω + torque (N m), for dω/dt, rad/s²."""
        inertia = self.spacecraft.inertia
        return self._solved(inertia, torque - jnp.cross(omega, inertia @ omega))

    def _solved(self, inertia: Matrix, torque: Vector):
        """Return dω/dt, rad/s², of a body of this inertia (kg m²) under all torques (N m)."""
        inverse = inverse_of(inertia)
        acceleration = inverse @ torque
        if self.third_rate_held:
            acceleration = acceleration - inverse[:, 2] * (acceleration[2] / inverse[2, 2])
            acceleration = acceleration.at[2].set(0.0)
        return acceleration

    def constraint_torque(
        self, t: RealScalar, state: PlantState, torque: Vector
    ) -> RealScalar | None:
        """Return the ideal torque about the third body axis that holds ω3 at time `t` (s), N m.

        With e3 the third axis, -e3ᵀJ⁻¹(T + T_d - ω × Jω) / e3ᵀJ⁻¹e3, for principal axes
        -(J1 - J2) ω1 ω2 - d3 - T3. None where the third rate is free.
        """
        if not self.third_rate_held:
            return None
        spacecraft, omega = self.spacecraft, state.omega
        total = torque + self.disturbance_torque(t, state)
        total = total - jnp.cross(omega, spacecraft.inertia @ omega)
        row = spacecraft.inverse_inertia[2]
        return -(row @ total) / row[2]

    def complete(self, state: PlantState) -> PlantState:
        """Return the state with states of all effectors, at rest where it has none."""
        if state.effectors or not self.effectors:
            return state
        return dataclasses.replace(state, effectors=tuple(one.init() for one in self.effectors))

    def later(self, commands: OfEach, elapsed: RealScalar) -> OfEach:
        """Return commands, or pieces, `elapsed` seconds after the begin of their hold."""
        parts = zip(self.effectors, commands, strict=True)
        return tuple(one.later(command, elapsed) for one, command in parts)

    # Failures in flight.

    @property
    def failure_times(self) -> tuple[Float[Array, " _"], ...]:
        """Time of each failure of each effector, s."""
        return tuple(one.failure_times for one in self.effectors)

    def after_failures(self, state: PlantState, struck: Struck) -> PlantState:
        """Return the state right after these failures have struck, with J ω + Σ h conserved.

        Idempotent: a second call changes nothing.
        """
        if not any(one.blows and one.failures is not None for one in self.effectors):
            return state
        parts = list(zip(self.effectors, state.of_each, struck, strict=True))
        blows = [one.blow(own, mine) for one, own, mine in parts]
        inertia = self._inertia([blow.inertia for blow in blows])
        impulse = sum((blow.torque for blow in blows[1:]), blows[0].torque)
        change = inverse_of(inertia) @ impulse
        after = tuple(one.blown(own, mine, change) for one, own, mine in parts)
        return PlantState(state.attitude, state.omega + change, after)

    def driven(
        self, state: PlantState, commands: OfEach, struck: Struck
    ) -> "tuple[RigidBody, OfEach]":
        """Return the body with effectors as these failures leave them, and their commands."""
        parts = zip(self.effectors, state.of_each, commands, struck, strict=True)
        pairs = [one.driven(own, command, mine) for one, own, command, mine in parts]
        body = self.with_effectors(tuple(one for one, _ in pairs))
        return body, tuple(command for _, command in pairs)

    def with_effectors(self, effectors: tuple[AbstractEffector, ...]) -> "RigidBody":
        """Return this body with other effectors."""
        if len(effectors) != len(self.effectors):
            return dataclasses.replace(self, effectors=effectors)
        return eqx.tree_at(lambda x: x.effectors, self, effectors) if effectors else self

    # Motion.

    def modes(
        self, t: RealScalar, state: PlantState, commands: OfEach, modes: OfEach | None = None
    ) -> OfEach:
        """Return the effectors' modes under their commands at time `t` (s).

        The search starts from the `modes` given, or from the modes of their states.
        """
        if modes is None:
            modes = tuple(one.mode(own) for one, own in self._with(state))
        for _ in range(max((one.mode_passes for one in self.effectors), default=0)):
            acceleration = self.acceleration(t, state, pieces=self.pieces(modes, commands))
            modes = self.modes_after(modes, state, commands, acceleration)
        return modes

    def modes_after(
        self, modes: OfEach, state: PlantState, commands: OfEach, acceleration: Vector
    ) -> OfEach:
        """Return the effectors' next modes for this dω/dt (rad/s²)."""
        parts = zip(self.effectors, modes, state.of_each, commands, strict=True)
        return tuple(one.mode_after(m, s, c, acceleration) for one, m, s, c in parts)

    def pieces(self, modes: OfEach, commands: OfEach) -> OfEach:
        """Return the effectors' pieces for these modes and commands."""
        parts = zip(self.effectors, modes, commands, strict=True)
        return tuple(one.piece(mode, command) for one, mode, command in parts)

    def acceleration(
        self, t: RealScalar, state: PlantState, torque: Vector | None = None, pieces: OfEach = ()
    ) -> Vector:
        """Return dω/dt (rad/s²) at time `t` (s) with effectors in `pieces` and a `torque` (N m).

        Without pieces, effectors make no torque and keep their momenta.
        """
        return self._acceleration(t, state, torque, self._effects(t, state, pieces))

    def _effects(self, t: RealScalar, state: PlantState, pieces: OfEach) -> list[Effect]:
        return [
            one.effect(piece, t, state, own)
            for (one, own), piece in zip(self._with(state), pieces, strict=False)
        ]

    def _acceleration(
        self, t: RealScalar, state: PlantState, torque: Vector | None, effects: list[Effect]
    ) -> Vector:
        total = self._sum([effect.torque for effect in effects], torque)
        total = total + self.disturbance_torque(t, state)
        total = total - jnp.cross(state.omega, self.total_momentum(state))
        return self._solved(self._inertia([effect.inertia for effect in effects]), total)

    def rate(
        self, t: RealScalar, state: PlantState, torque: Vector | None = None, pieces: OfEach = ()
    ) -> PlantState:
        """Return the time derivative of the state; the arguments are those of `acceleration`."""
        return self.motion(t, state, torque, pieces).rate

    def motion(
        self, t: RealScalar, state: PlantState, torque: Vector | None = None, pieces: OfEach = ()
    ) -> BodyMotion:
        """Return the motion; the arguments are those of `acceleration`.

        The effect of each effector is computed once.
        """
        effects, relative_rate = self._effects(t, state, pieces), self.relative_rate(state)
        acceleration = self._acceleration(t, state, torque, effects)
        own, torques = jax.tree.map(jnp.zeros_like, state.effectors), []
        if pieces:
            parts = list(zip(self.effectors, pieces, state.of_each, effects, strict=True))
            own = tuple(one.derivative(piece, state, x, acceleration) for one, piece, x, _ in parts)
            torques = [
                one.torque(piece, effect, x, acceleration) for one, piece, x, effect in parts
            ]
        rate = PlantState(state.attitude.rate(relative_rate), acceleration, own)
        return BodyMotion(rate, relative_rate, self._sum(torques, None))

    def stored(self, state: PlantState) -> dict[str, Array]:
        """Return the effectors' signals of state (momenta, angles), by name."""
        parts = self._with(state)
        return {name: x for one, own in parts for name, x in one.stored(own).items()}

    def signals(self, state: PlantState, pieces: OfEach, acceleration: Vector) -> dict[str, Array]:
        """Return the effectors' signals of motion (torques, rates), by name."""
        parts = zip(self.effectors, pieces, state.of_each, strict=True)
        of_each = [one.signals(piece, own, acceleration) for one, piece, own in parts]
        return {name: x for signals in of_each for name, x in signals.items()}

    # Corners under a continuous command.

    @property
    def event_count(self) -> int:
        """Number of corners of all effectors."""
        return sum(one.event_count for one in self.effectors)

    def event_functions(
        self, state: PlantState, commands: OfEach, acceleration: Vector
    ) -> Float[Array, " m"]:
        """Return the effectors' event functions for this dω/dt (rad/s²)."""
        parts = zip(self.effectors, state.of_each, commands, strict=True)
        functions = [one.event_functions(own, command, acceleration) for one, own, command in parts]
        return jnp.concatenate([*functions, jnp.zeros(0, state.omega.dtype)])

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "RigidBody":
        """Return this body with each effector in the smooth piece that the event signs give."""
        pieces, begin = [], 0
        for one in self.effectors:
            pieces.append(one.smooth_piece(signs[begin : begin + one.event_count]))
            begin += one.event_count
        return self.with_effectors(tuple(pieces))
