"""The plant: a rigid body in a circular orbit, equations (1), (10), (11), (36), (37)."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.attitude import AbstractAttitude
from jaxsat.checks import as_float
from jaxsat.environment import AbstractDisturbance, AbstractOrbit, NoDisturbance
from jaxsat.vehicle import Spacecraft


class PlantState(eqx.Module):
    """Attitude relative to the orbit frame, and inertial angular velocity in body axes, rad/s."""

    attitude: AbstractAttitude
    omega: Float[Array, "3"] = eqx.field(converter=as_float)

    def normalised(self) -> "PlantState":
        """The same with attitude parameters that obey their constraint to rounding."""
        return dataclasses.replace(self, attitude=self.attitude.normalised())


class RigidBody(eqx.Module):
    """A rigid body in a circular orbit under a torque and a disturbance.

    With `third_rate_held` an ideal torque about the third body axis keeps ω3 from changing: the
    assumption under which the paper simulates its three-axis law, and what two reaction wheels
    with zero total momentum would make true. A controller carries a `RigidBody` of its own, what it
    believes of the plant, so that plant and model can differ.
    """

    spacecraft: Spacecraft
    orbit: AbstractOrbit
    disturbance: AbstractDisturbance = NoDisturbance()
    third_rate_held: bool = eqx.field(static=True, default=False)

    def relative_rate(self, state: PlantState) -> Float[Array, "3"]:
        """Equation (11): ω_r, the angular velocity relative to the orbit frame, rad/s."""
        return state.omega - self.orbit.frame_rate(state.attitude)

    def disturbance_torque(self, t: Float[Array, ""], state: PlantState) -> Float[Array, "3"]:
        """T_d at time `t` (s), N m."""
        return self.disturbance(t, state.attitude, self.spacecraft.inertia)

    def angular_acceleration(
        self, omega: Float[Array, "3"], torque: Float[Array, "3"]
    ) -> Float[Array, "3"]:
        """Equation (1): J dω/dt = -ω × J ω + torque, solved for dω/dt, rad/s²."""
        inverse = self.spacecraft.inverse_inertia
        momentum = self.spacecraft.inertia @ omega
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

    def rate(self, t: Float[Array, ""], state: PlantState, torque: Float[Array, "3"]) -> PlantState:
        """Time derivative of the state at time `t` (s) under a thruster torque, N m."""
        total = torque + self.disturbance_torque(t, state)
        return PlantState(
            state.attitude.rate(self.relative_rate(state)),
            self.angular_acceleration(state.omega, total),
        )
