"""The plant: a rigid body in a circular orbit, equations (1), (10), (11), (36), (37); with wheels a
gyrostat (Hughes, Spacecraft Attitude Dynamics, 1986, section 3.4).
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.attitude import AbstractAttitude
from jaxsat.checks import as_float, as_optional_float
from jaxsat.environment import AbstractDisturbance, AbstractOrbit, DipoleField, NoDisturbance
from jaxsat.vehicle import Magnetorquers, Spacecraft, Wheels


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
    Raises `ValueError` for wheels of a body whose third rate is held, and for magnetorquers without
    a field.
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

    def angular_acceleration(
        self,
        omega: Float[Array, "3"],
        torque: Float[Array, "3"],
        wheel_momentum: Float[Array, " wheels"] | None = None,
    ) -> Float[Array, "3"]:
        """Equation (1): J dω/dt = -ω × (J ω + A h) + torque, solved for dω/dt, rad/s².

        `torque` (N m) is all that acts on the body, that of the wheels A u included.
        """
        inverse = self.spacecraft.inverse_inertia
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
    ) -> Float[Array, " wheels"] | None:
        """What each wheel does to the body along its axis on a command, N m; None without wheels.

        Without a command, None, it is what friction does. `struck` tells which failures of wheels
        have struck, None for none.
        """
        if self.wheels is None or state.wheel_momentum is None:
            return None
        wheels, momentum, command = self._driven_wheels(self.wheels, state, command, struck)
        return wheels.torque(momentum, command)

    def _driven_wheels(
        self, wheels: Wheels, state: PlantState, command, struck
    ) -> tuple[Wheels, Float[Array, " wheels"], Float[Array, " wheels"]]:
        """Wheels that fail no more, their momenta, and what is commanded of their motors."""
        momentum = self.after_wheel_failures(state, struck).wheel_momentum
        assert momentum is not None
        command = jnp.zeros_like(momentum) if command is None else command
        if wheels.failures is not None and struck is not None:
            condition = wheels.failures.condition(struck, wheels.count)
            wheels, command = wheels.driven(condition, momentum, command)
        return wheels, momentum, command

    def after_wheel_failures(
        self, state: PlantState, struck: Bool[Array, " f"] | None
    ) -> PlantState:
        """The state right after failures of wheels have struck: those that seize stand still.

        J ω + A h is what it was. Once more, it changes nothing.
        """
        wheels, momentum = self.wheels, state.wheel_momentum
        if wheels is None or wheels.failures is None or momentum is None or struck is None:
            return state
        stopped = wheels.failures.condition(struck, wheels.count).stopped
        given = jnp.where(stopped, momentum, 0.0)
        kick = self.spacecraft.inverse_inertia @ (wheels.axes @ given)
        momentum = jnp.where(stopped, 0.0, momentum)
        return PlantState(state.attitude, state.omega + kick, momentum)

    def wheel_events(
        self,
        state: PlantState,
        command: Float[Array, " wheels"] | None,
        struck: Bool[Array, " f"] | None = None,
    ) -> Float[Array, " m"]:
        """The wheels' event functions on a command, of which there are none without wheels."""
        if self.wheels is None or state.wheel_momentum is None:
            return jnp.zeros(0, state.omega.dtype)
        wheels, momentum, command = self._driven_wheels(self.wheels, state, command, struck)
        return wheels.event_functions(momentum, command)

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
    ) -> PlantState:
        """Time derivative of the state at time `t` (s) under a thruster torque, N m.

        `wheel_torque` (N m) is what each wheel does to the body along its axis, None for nothing.
        """
        total = self.control_torque(torque, wheel_torque) + self.disturbance_torque(t, state)
        momentum_rate = None if wheel_torque is None else -wheel_torque
        if momentum_rate is None and state.wheel_momentum is not None:
            momentum_rate = jnp.zeros_like(state.wheel_momentum)
        return PlantState(
            state.attitude.rate(self.relative_rate(state)),
            self.angular_acceleration(state.omega, total, state.wheel_momentum),
            momentum_rate,
        )
