"""The manoeuvre as a nonlinear program: multiple shooting in dimensionless units.

The duration T has equal intervals with a constant torque of every thruster in each. States at their
ends are unknowns, coupled by classical Runge-Kutta steps (Bock and Plitt, A multiple shooting
algorithm for direct solution of optimal control problems, IFAC World Congress, 1984).
"""

import abc
import enum
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.barriers import BALLS, inside, radii_of
from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.tolerances import Tolerances
from jaxsat.spacecraft.dynamics import PlantState, RigidBody

STATES = 7
"""Number of states: quaternion and ω τ."""

ARRIVALS = 6
"""Number of arrival components: twice the sines of half of tilt and turn, and the relative rate
times τ; zero at rest at the target."""


class PlanObjective(enum.Enum):
    """Objective of a plan: the duration, or ∫ Σ|T_i| dt in a given duration."""

    TIME = "time"
    EFFORT = "effort"


class Unknowns(NamedTuple):
    """Unknowns of the program: states at the begin of the intervals and the last, torques,
    duration.

    `place` is the end's place in its tolerances, see `jaxsat.control.planning.barriers`; None:
    rest.
    """

    states: Float[Array, "n 7"]
    last: Float[Array, "7"]
    torque: Float[Array, "n m"]
    duration: RealScalar
    place: Float[Array, "6"] | None = None


class AbstractCorrection(eqx.Module):
    """Correction of the model's dynamics."""

    @abc.abstractmethod
    def __call__(self, omega: Vector, torque: Vector, acceleration: Vector) -> Vector:
        """The angular acceleration (rad/s²) that replaces the model's `acceleration`.

        `omega` are the rates (rad/s), `torque` that of the thrusters (N m), in body axes.
        """


class Transcription(eqx.Module):
    """The nonlinear program of a body with thrusters that each produce up to `limit` N m.

    Times are in units of τ = √(J0 / limit) with J0 the mean moment of inertia, torques in units of
    the limit. `torque_axes` (3, m) are the directions of the thrusters' torques, which have either
    sign. Each of the `intervals` is integrated in `substeps` steps. A `correction` applies to the
    model's angular acceleration. The plan ends within `tolerances` of rest, without them at rest.
    """

    model: RigidBody
    torque_axes: Float[Array, "3 m"]
    limit: RealScalar
    objective: PlanObjective = eqx.field(static=True)
    intervals: int = eqx.field(static=True)
    substeps: int = eqx.field(static=True)
    correction: AbstractCorrection | None = None
    tolerances: Tolerances | None = None

    @property
    def time_unit(self) -> RealScalar:
        """The unit of time τ, s."""
        return jnp.sqrt(jnp.mean(self.model.spacecraft.moments) / self.limit)

    def scaled(self, state: PlantState) -> Float[Array, "7"]:
        """A plant state in the program's units."""
        q = state.attitude.as_quaternion().q
        return jnp.concatenate([q, state.omega * self.time_unit])

    def plant_state(self, x: Float[Array, "7"]) -> PlantState:
        """The plant state of a state in the program's units."""
        return PlantState(Quaternion(x[:4]), x[4:] / self.time_unit)

    @property
    def target(self) -> Float[Array, "7"]:
        """Rest in the orbit frame; the quaternion of the other sign is the same attitude."""
        unturned = Quaternion(jnp.eye(4)[0])
        return self.scaled(PlantState(unturned, self.model.orbit.frame_rate(unturned)))

    def arrival(self, x: Float[Array, "7"]) -> Float[Array, "6"]:
        """Arrival error of a last state: zero at rest in the orbit frame, for q and -q."""
        relative = self.model.relative_rate(self.plant_state(x))
        turn = 1.0 if self.tolerances is None else jnp.sqrt(x[0] ** 2 + x[3] ** 2)
        of_attitude = 2 * jnp.stack([x[1], x[2], x[3] / turn])
        return jnp.concatenate([of_attitude, relative * self.time_unit])

    @property
    def radii(self) -> Vector | None:
        """Limits on the arrival in tilt, turn and rate; None for rest."""
        return None if self.tolerances is None else radii_of(self.tolerances, self.time_unit)

    def place(self, x: Float[Array, "7"]) -> Float[Array, "6"] | None:
        """The place in the tolerances that a last state has, or the nearest one."""
        radii = self.radii
        return None if radii is None else inside(self.arrival(x) / (BALLS @ radii))

    def missed(self, at: "Unknowns") -> Float[Array, "6"]:
        """The difference of the last state from its place in the tolerances, or from rest."""
        arrival, radii = self.arrival(at.last), self.radii
        if radii is None or at.place is None:
            return arrival
        return arrival - BALLS @ radii * at.place

    def _rate(
        self, t: RealScalar, x: Float[Array, "7"], u: Float[Array, " m"]
    ) -> Float[Array, "7"]:
        """dx/dt of equations (1), (10) and (11)."""
        model, unit, state = self.model, self.time_unit, self.plant_state(x)
        torque = self.torque_axes @ (u * self.limit)
        disturbance = model.disturbance_torque(t * unit, state)
        turning = Quaternion(x[:4]).rate(model.relative_rate(state)).q
        acceleration = model.angular_acceleration(state.omega, torque + disturbance)
        if self.correction is not None:
            acceleration = self.correction(state.omega, torque, acceleration)
        return jnp.concatenate([turning * unit, acceleration * unit**2])

    def interval(
        self,
        begin: RealScalar,
        number: RealScalar,
        x: Float[Array, "7"],
        duration: RealScalar,
        u: Float[Array, " m"],
    ) -> Float[Array, "7"]:
        """The state after interval `number` of a plan that begins at the time `begin`."""
        h = duration / (self.intervals * self.substeps)

        def step(number, point):
            t, x = point
            k1 = self._rate(t, x, u)
            k2 = self._rate(t + h / 2, x + h / 2 * k1, u)
            k3 = self._rate(t + h / 2, x + h / 2 * k2, u)
            k4 = self._rate(t + h, x + h * k3, u)
            return t + h, x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

        t = begin + number * duration / self.intervals
        if self.substeps == 1:
            return step(0, (t, x))[1]
        return lax.fori_loop(0, self.substeps, step, (t, x))[1]

    def coasted(
        self, begin: RealScalar, x: Float[Array, "7"], step: RealScalar, steps: IntScalar, most: int
    ) -> Float[Array, "7"]:
        """The state after coasting for `steps` Runge-Kutta steps, at most `most`."""
        whole, coast = step * self.intervals, jnp.zeros(self.torque_axes.shape[1], x.dtype)

        def one(at):
            number, x = at
            x = self.interval(begin + number * step, jnp.zeros_like(begin), x, whole, coast)
            return number + 1, jnp.concatenate([x[:4] / jnp.sqrt(jnp.sum(x[:4] ** 2)), x[4:]])

        def goes_on(at):
            return (at[0] < most) & (at[0] < steps)

        return lax.while_loop(goes_on, one, (jnp.array(0), x))[1]

    def linearised(
        self, begin: RealScalar, number: RealScalar, x, duration: RealScalar, u
    ) -> tuple[Array, Array, Array]:
        """The state after an interval, its derivatives by (x, T) and those by u."""

        def after(v):
            return self.interval(begin, number, v[:STATES], v[STATES], v[STATES + 1 :])

        at = jnp.concatenate([x, duration[None], u])
        jacobian = jax.jacfwd(after)(at)
        return after(at), jacobian[:, : STATES + 1], jacobian[:, STATES + 1 :]

    def defects(self, begin: RealScalar, at: "Unknowns") -> RealScalar:
        """Σ|x_(k+1) - f(x_k, u_k)| + |arrival|₁: zero where the plan can be flown."""

        def one(carry, row):
            total, end_state = carry
            number, x, u = row
            total = total + jnp.sum(jnp.abs(x - end_state))
            return (total, self.interval(begin, number, x, at.duration, u)), None

        first = (jnp.sum(jnp.abs(self.missed(at))), at.states[0])
        rows = (self.numbers(at), at.states, at.torque)
        (total, end_state), _ = lax.scan(one, first, rows)
        return total + jnp.sum(jnp.abs(at.last - end_state))

    def effort(self, at: "Unknowns") -> RealScalar:
        """The effort ∫ Σ|u| dt of a plan, dimensionless."""
        return jnp.sum(jnp.abs(at.torque)) * at.duration / self.intervals

    def value(self, at: "Unknowns") -> RealScalar:
        """The objective: duration or effort, dimensionless."""
        return at.duration if self.objective is PlanObjective.TIME else self.effort(at)

    def numbers(self, at: "Unknowns") -> Float[Array, " n"]:
        """The numbers of the intervals."""
        return jnp.arange(self.intervals, dtype=at.last.dtype)
