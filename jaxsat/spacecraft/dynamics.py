"""The plant: a rigid body in a circular orbit, equations (1), (10), (11), (36), (37); with wheels a
gyrostat (Hughes, Spacecraft Attitude Dynamics, 1986, section 3.4).

With J the inertia with the wheels locked, h the momenta of rotors relative to the body, J_w their
inertias about their axes A, and c the torques of their motors and friction on the body:

    J dω/dt + A dh/dt = -ω × (Jω + A h) + T + T_d,  dh/dt = -c - J_w aᵀdω/dt

so that (J - Σ J_w a aᵀ) dω/dt = -ω × (Jω + A h) + A c + T + T_d. A wheel that friction or its limit
keeps from turning has no term in that sum.
"""

import dataclasses
from typing import cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import as_float, as_optional_float, require_inertia
from jaxsat.spacecraft import (
    Magnetorquers,
    Spacecraft,
    WheelPiece,
    Wheels,
    WheelStates,
    first_states,
    inverse_of,
)
from jaxsat.spacecraft.environment import (
    AbstractDisturbance,
    AbstractOrbit,
    DipoleField,
    NoDisturbance,
)

STATE_PASSES = 3
"""How often it is asked which wheels are held, each time with the rates that this gives."""


class PlantState(eqx.Module):
    """Attitude relative to the orbit frame, and inertial angular velocity in body axes, rad/s.

    `wheel_momentum` (N m s) is that of each wheel relative to the body, None without wheels.
    """

    attitude: AbstractAttitude
    omega: Float[Array, "3"] = eqx.field(converter=as_float)
    wheel_momentum: Float[Array, " wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )

    def normalised(self) -> "PlantState":
        """The same with attitude parameters that obey their constraint to rounding."""
        return dataclasses.replace(self, attitude=self.attitude.normalised())


class RigidBody(eqx.Module):
    """A rigid body in a circular orbit under a torque and a disturbance.

    With `third_rate_held` an ideal torque about the third body axis keeps ω3 from changing: the
    assumption under which the paper simulates its three-axis law, and what two reaction wheels
    with zero total momentum make true. A controller carries a `RigidBody` of its own, what it
    believes of the plant, so that plant and model can differ.

    With `wheels` the inertia is that with the wheels locked. A state without wheel momenta is that
    of the body whose wheels stand still. `magnetorquers` act in the Earth's magnetic `field`.
    Raises `ValueError` for wheels of a body whose third rate is held, for rotors with more inertia
    than the body has with them, and for magnetorquers without a field.
    """

    spacecraft: Spacecraft
    orbit: AbstractOrbit
    disturbance: AbstractDisturbance = NoDisturbance()
    third_rate_held: bool = eqx.field(static=True, default=False)
    wheels: Wheels | None = None
    magnetorquers: Magnetorquers | None = None
    field: DipoleField | None = None

    def __check_init__(self):
        if self.magnetorquers is not None and self.field is None:
            raise ValueError("Argument `field` must be given with `magnetorquers`.")
        if self.third_rate_held and self.wheels is not None:
            raise ValueError("The third rate of a body with wheels must not be held.")
        if self.wheels is not None and self.wheels.rotor_inertia is not None:
            require_inertia("inertia less that of all rotors", self.free_inertia())

    def relative_rate(self, state: PlantState) -> Float[Array, "3"]:
        """Equation (11): ω_r, the angular velocity relative to the orbit frame, rad/s."""
        return state.omega - self.orbit.frame_rate(state.attitude)

    def disturbance_torque(self, t: Float[Array, ""], state: PlantState) -> Float[Array, "3"]:
        """T_d at time `t` (s), N m."""
        return self.disturbance(t, state.attitude, self.spacecraft.inertia)

    def total_momentum(self, state: PlantState) -> Float[Array, "3"]:
        """J ω + A h in body axes, N m s: constant in inertial axes without external torque."""
        return self._momentum(state.omega, state.wheel_momentum)

    def _momentum(self, omega, wheel_momentum) -> Float[Array, "3"]:
        momentum = self.spacecraft.inertia @ omega
        if self.wheels is None or wheel_momentum is None:
            return momentum
        return momentum + self.wheels.axes @ wheel_momentum

    def free_inertia(self, turns: Bool[Array, " wheels"] | None = None) -> Float[Array, "3 3"]:
        """J - Σ J_w a aᵀ over the wheels that turn, by default all, kg m²."""
        wheels = self.wheels
        if wheels is None or wheels.rotor_inertia is None:
            return self.spacecraft.inertia
        return self.spacecraft.inertia - wheels.rotors(turns)

    def angular_acceleration(
        self,
        omega: Float[Array, "3"],
        torque: Float[Array, "3"],
        wheel_momentum: Float[Array, " wheels"] | None = None,
        turns: Bool[Array, " wheels"] | None = None,
    ) -> Float[Array, "3"]:
        """Equation (1): J dω/dt = -ω × (J ω + A h) + torque, solved for dω/dt, rad/s².

        `torque` (N m) is all that acts on the body, that of the wheels A c included. With rotors
        that have an inertia J on the left is `free_inertia` of the wheels that turn, by default of
        all.
        """
        inverse = inverse_of(self.free_inertia(turns))
        momentum = self._momentum(omega, wheel_momentum)
        acceleration = inverse @ (torque - jnp.cross(omega, momentum))
        if self.third_rate_held:
            acceleration = acceleration - inverse[:, 2] * (acceleration[2] / inverse[2, 2])
            acceleration = acceleration.at[2].set(0.0)
        return acceleration

    def constraint_torque(
        self, t: Float[Array, ""], state: PlantState, torque: Float[Array, "3"]
    ) -> Float[Array, ""] | None:
        """The ideal torque about the third body axis that holds ω3 at time `t` (s), N m.

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

    def with_wheel_momentum(self, state: PlantState) -> PlantState:
        """The state with the momenta of all wheels: zero where it has none."""
        if self.wheels is None or state.wheel_momentum is not None:
            return state
        return PlantState(state.attitude, state.omega, jnp.zeros(self.wheels.count))

    def wheel_torque(
        self,
        state: PlantState,
        command: Float[Array, " wheels"] | None,
        struck: Bool[Array, " f"] | None = None,
        external: Float[Array, "3"] | None = None,
    ) -> Float[Array, " wheels"] | None:
        """What each wheel does to the body along its axis on a command, N m; None without wheels.

        Without a command, None, it is what friction does. `struck` tells which failures of wheels
        have struck, None for none. `external` (N m) is the torque of all but the wheels, None for
        none, on which that of wheels with a rotor inertia depends.
        """
        if self.wheels is None or state.wheel_momentum is None:
            return None
        piece = self.wheel_drive(state, command, struck, external)
        assert piece is not None
        state = self.after_wheel_failures(state, struck)
        torque = piece.torque(cast(Array, state.wheel_momentum))
        if piece.turns is None:
            return torque
        return jnp.where(piece.turns, torque, -self._drag(state, external, torque, piece.turns))

    def wheel_drive(
        self,
        state: PlantState,
        command: Float[Array, " wheels"] | None,
        struck: Bool[Array, " f"] | None = None,
        external: Float[Array, "3"] | None = None,
    ) -> WheelPiece | None:
        """What drives wheels at one instant, and which of them turn; None without wheels.

        The arguments are those of `wheel_torque`.
        """
        if self.wheels is None or state.wheel_momentum is None:
            return None
        wheels, state, command = self._driven_wheels(self.wheels, state, command, struck)
        momentum = cast(Array, state.wheel_momentum)
        if wheels.rotor_inertia is None:
            torque = wheels.torque(momentum, command)
            return WheelPiece(torque, jnp.zeros_like(torque))
        drive = wheels.motor_torque(command)
        states = self.wheel_states(wheels, state, drive, external)
        return states.piece(wheels, drive)

    def wheel_states(
        self,
        wheels: Wheels,
        state: PlantState,
        drive: Float[Array, " wheels"],
        external: Float[Array, "3"] | None,
        states: WheelStates | None = None,
    ) -> WheelStates:
        """Which of `wheels`, whose motors make `drive` (N m), are held, and which turn.

        By their momenta, or from the `states` on in which they were. `external` (N m) is the torque
        of all else.
        """
        momentum = cast(Array, state.wheel_momentum)
        states = first_states(wheels, momentum) if states is None else states
        for _ in range(STATE_PASSES if wheels.limited is None else 0):
            drag = self.wheel_drag(state, external, states.piece(wheels, drive))
            margins = states.margins(wheels, momentum, drive, drag)
            states = states.left(margins, drive, drag)
        return states

    def wheel_drag(
        self, state: PlantState, external: Float[Array, "3"] | None, piece: WheelPiece
    ) -> Float[Array, " wheels"]:
        """J_w a·dω/dt of each wheel, N m; `external` (N m) is the torque of all but the wheels."""
        return self._drag(
            state, external, piece.torque(cast(Array, state.wheel_momentum)), piece.turns
        )

    def _drag(self, state: PlantState, external, torque, turns) -> Float[Array, " wheels"]:
        wheels = self.wheels
        assert wheels is not None
        assert wheels.rotor_inertia is not None
        total = wheels.axes @ torque + (0.0 if external is None else external)
        rate = self.angular_acceleration(state.omega, total, state.wheel_momentum, turns)
        return wheels.rotor_inertia * (wheels.axes.T @ rate)

    def _driven_wheels(
        self, wheels: Wheels, state: PlantState, command, struck
    ) -> tuple[Wheels, PlantState, Float[Array, " wheels"]]:
        """Wheels that fail no more, the state, and what is commanded of their motors."""
        state = self.after_wheel_failures(state, struck)
        momentum = cast(Array, state.wheel_momentum)
        command = jnp.zeros_like(momentum) if command is None else command
        if wheels.failures is not None and struck is not None:
            condition = wheels.failures.condition(struck, wheels.count)
            wheels, command = wheels.driven(condition, momentum, command)
        return wheels, state, command

    def after_wheel_failures(
        self, state: PlantState, struck: Bool[Array, " f"] | None
    ) -> PlantState:
        """The state right after failures of wheels have struck: those that seize stand still.

        J ω + A h is what it was, and so is J_w aᵀω + h of each other wheel. Once more, it changes
        nothing.
        """
        wheels, momentum = self.wheels, state.wheel_momentum
        if wheels is None or wheels.failures is None or momentum is None or struck is None:
            return state
        stopped = wheels.failures.condition(struck, wheels.count).stopped
        given = jnp.where(stopped, momentum, 0.0)
        kick = inverse_of(self.free_inertia(~stopped)) @ (wheels.axes @ given)
        if wheels.rotor_inertia is not None:
            momentum = momentum - wheels.rotor_inertia * (wheels.axes.T @ kick)
        momentum = jnp.where(stopped, 0.0, momentum)
        return PlantState(state.attitude, state.omega + kick, momentum)

    def wheel_events(
        self,
        state: PlantState,
        command: Float[Array, " wheels"] | None,
        struck: Bool[Array, " f"] | None = None,
        external: Float[Array, "3"] | None = None,
    ) -> Float[Array, " m"]:
        """The wheels' event functions on a command, of which there are none without wheels.

        The arguments are those of `wheel_torque`.
        """
        if self.wheels is None or state.wheel_momentum is None:
            return jnp.zeros(0, state.omega.dtype)
        wheels, state, command = self._driven_wheels(self.wheels, state, command, struck)
        momentum = cast(Array, state.wheel_momentum)
        if wheels.rotor_inertia is None:
            return wheels.event_functions(momentum, command)
        drive = wheels.motor_torque(command)
        piece = self.wheel_states(wheels, state, drive, external).piece(wheels, drive)
        return wheels.event_functions(momentum, command, self.wheel_drag(state, external, piece))

    def wheel_piece(self, signs: Bool[Array, " m"]) -> "RigidBody":
        """This body with each wheel at its momentum limit or not, as the wheels' events tell."""
        if self.wheels is None or not signs.size:
            return self
        return dataclasses.replace(self, wheels=self.wheels.smooth_piece(signs))

    def magnetic_torque(
        self, t: float | Float[Array, ""], state: PlantState, dipole: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """m × B in body axes at time `t` (s), N m, of a dipole m in body axes (A m²)."""
        if self.field is None:
            return jnp.zeros_like(dipole)
        return jnp.cross(dipole, self.field.in_body(jnp.asarray(t), state.attitude))

    def control_torque(
        self, torque: Float[Array, "3"], wheel_torque: Float[Array, " wheels"] | None
    ) -> Float[Array, "3"]:
        """The torque of thrusters and wheels on the body, N m."""
        if self.wheels is None or wheel_torque is None:
            return torque
        return torque + self.wheels.axes @ wheel_torque

    def rate(
        self,
        t: Float[Array, ""],
        state: PlantState,
        torque: Float[Array, "3"],
        wheel_torque: Float[Array, " wheels"] | None = None,
        turns: Bool[Array, " wheels"] | None = None,
    ) -> PlantState:
        """Time derivative of the state at time `t` (s) under a thruster torque, N m.

        `wheel_torque` (N m) is what motor and friction of each wheel do to the body along its axis,
        None for nothing. `turns` tells which wheels do not keep their momentum, None for all;
        the others make no such torque.
        """
        total = self.control_torque(torque, wheel_torque) + self.disturbance_torque(t, state)
        rate = self.angular_acceleration(state.omega, total, state.wheel_momentum, turns)
        return PlantState(
            state.attitude.rate(self.relative_rate(state)),
            rate,
            self._momentum_rate(state, rate, wheel_torque, turns),
        )

    def _momentum_rate(
        self, state: PlantState, rate: Float[Array, "3"], wheel_torque, turns
    ) -> Float[Array, " wheels"] | None:
        """dh/dt = -c - J_w aᵀdω/dt, N m."""
        if wheel_torque is None:
            if state.wheel_momentum is None:
                return None
            wheel_torque = jnp.zeros_like(state.wheel_momentum)
        found = -wheel_torque
        wheels = self.wheels
        if wheels is None or wheels.rotor_inertia is None:
            return found
        found = found - wheels.rotor_inertia * (wheels.axes.T @ rate)
        return found if turns is None else jnp.where(turns, found, 0.0)

    def made_by_wheels(self, rate: PlantState) -> Float[Array, " wheels"] | None:
        """c = -(dh/dt + J_w aᵀdω/dt) of each wheel, N m, at a time derivative of the state.

        Of a wheel that keeps its momentum it is what turns its rotor with the body. None without
        wheels.
        """
        wheels, momentum = self.wheels, rate.wheel_momentum
        if wheels is None or momentum is None or wheels.rotor_inertia is None:
            return None if momentum is None else -momentum
        return -(momentum + wheels.rotor_inertia * (wheels.axes.T @ rate.omega))
