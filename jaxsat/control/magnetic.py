"""Three axes by magnetorquers, alone or with wheels: a tumble is damped, then attitude is held.

A magnetorquer makes no torque along the Earth's field. The law commands torques, of which
`MagneticSteering` makes the part across the field.
"""

import dataclasses
import enum
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.controller import LawContext, MagneticContext, UnsuitableModel
from jaxsat.control.linear_motion import LinearMotion, linear_motion
from jaxsat.control.periodic_gain import PeriodicGain, floquet_multipliers, periodic_gain
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.checks import as_float, as_optional_float, positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.magnetic import MAGNETIC_CONTROL
from jaxsat.core.quotients import SMALLEST
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import GravityGradient, has_gravity_gradient
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField
from jaxsat.spacecraft.magnetorquers import MagneticSteering
from jaxsat.spacecraft.wheels import wheel_momentum

SLOW = 4.0
"""Default of the rate below which a tumble counts as stopped, over the orbital rate."""

LEAVE = 2.0
"""Rate or turn at which a mode is left, over the one below which it began."""

NEAR = 0.5
"""Turn (rad) from the orbit frame within which the body is pointed."""

STIFFNESS, SLEW_DAMPING = 2.0, 3.0
"""Gains of a slew from farther away, over the largest moment of inertia times the square of the
orbital rate, and the rate: gravity gradient alone makes at most 1.5 of the former."""

STAYS = 1 - 1e-6
"""Part of an error left by an orbit from which on it counts as staying, by round-off too."""


class MagneticMode(enum.IntEnum):
    """Mode of the law."""

    DAMPING = 1
    SLEWING = 2
    POINTING = 3


class MagneticMemory(NamedTuple):
    """Memory of the law: `mode`; estimates of the residual `dipole` (A m²) and a constant `torque`
    (N m); the `momentum` (N m s) of body and wheels expected at the next sample, which is valid
    where the law `predicts`: with magnetorquers within their limits; in body axes."""

    mode: Annotated[IntScalar, MagneticMode]
    dipole: Vector
    torque: Vector
    momentum: Vector
    predicts: BoolScalar


class MagneticLaw(AbstractSampledController):
    """Damps a tumble, u = -k ω_r, slews, u = -s θ - c ω_r - ω0 N (h - h0), points, u = -K x.

    θ = 2 sgn(q0) q is the turn from the orbit frame and ω_r the rate relative to it. Wheels make
    their part of u; of the rest, N u, what is across the field B is made, so that damping without
    wheels is -k (1 - b bᵀ) ω_r, b = B / |B|, as by a dipole against the change of the field in the
    body (B-dot). h is the momentum of wheels and h0 their bias, along the orbit normal: slewing
    turns one to the other, as the body does not turn away from the momentum of its wheels. x = (θ,
    ω_r, η, d), η the momentum of wheels beyond a bias along body -y; wheels that failed before the
    start coast with the momentum `coasting` (N m s, body axes). `damping` is k (N m s),
    `stiffness` s (N m), `slew_damping` c (N m s). A tumble has been stopped once |ω_r| is below
    `pointing_rate` (rad/s). `gain` is K, periodic in orbit and day; it is not made for large turns,
    hence the slew. A residual dipole m of the body and a constant torque d are estimated by what d
    + m × B does to the momentum of body and wheels; m × B is opposed. `steering` makes dipoles of
    u. Avanzini and Giulietti, J. Guidance, Control, and Dynamics 35(4), 2012; Lovera and Astolfi,
    Automatica 40(8), 2004; for K see `jaxsat.control.periodic_gain`.
    """

    declaration: ClassVar[LawDeclaration] = MAGNETIC_CONTROL
    modes: ClassVar[type[enum.IntEnum]] = MagneticMode

    model: RigidBody
    steering: MagneticSteering
    gain: PeriodicGain
    stiffness: RealScalar = eqx.field(converter=positive("stiffness"))
    slew_damping: RealScalar = eqx.field(converter=positive("slew_damping"))
    wheel_axes: Float[Array, "3 wheels"] | None = eqx.field(converter=as_optional_float)
    damping: RealScalar = eqx.field(converter=positive("damping"))
    pointing_rate: RealScalar = eqx.field(converter=positive("pointing_rate"))
    period: RealScalar = eqx.field(converter=positive("period"))
    coasting: Vector = eqx.field(converter=as_float, default=(0.0, 0.0, 0.0))

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "MagneticLaw":
        """Build the law of a table of a scenario.

        Raises `UnsuitableModel` where magnetorquers do not control all axes over a day.
        """
        magnetic = context.magnetic
        if magnetic is None:
            raise ValueError("Argument `context` must have magnetorquers, but has none.")
        model, field = context.model, magnetic.steering.field
        inertia = np.asarray(model.spacecraft.inertia)
        rate = float(field.circle.rate)
        if context.gravity_gradient:
            model = dataclasses.replace(model, disturbance=GravityGradient(rate))
        damping, pointing = values["damping_N_m_s"], values["pointing_rate_rad_s"]
        moments = np.linalg.eigvalsh(inertia).tolist()
        return cls(
            model=model,
            steering=magnetic.steering,
            gain=_gain(
                magnetic_motion(inertia, magnetic, context.gravity_gradient),
                values["control_weight"],
                values["wheel_weight"],
            ),
            wheel_axes=context.wheel_axes,
            stiffness=STIFFNESS * moments[2] * rate**2,
            slew_damping=SLEW_DAMPING * moments[2] * rate,
            damping=_damping(field, moments[0]) if damping is None else damping,
            pointing_rate=SLOW * rate if pointing is None else pointing,
            period=values["period_s"],
            coasting=magnetic.momentum - np.asarray(magnetic.steering.bias),
        )

    def holds_with(self, rods: Bool[np.ndarray, " rods"]) -> bool:
        """Return whether small errors fall over a day if it commands all rods, and these work."""
        momentum = np.asarray(self.steering.bias) + np.asarray(self.coasting)
        magnetic = MagneticContext(self.steering, momentum)
        inertia = np.asarray(self.model.spacecraft.inertia)
        has_gradient = has_gravity_gradient(self.model.disturbance)
        motion = magnetic_motion(inertia, magnetic, has_gradient, rods)
        return _left_in_an_orbit(motion, self.gain) < STAYS

    def init(self, state: PlantState) -> MagneticMemory:
        """Return the memory of a tumbling body without residual dipole."""
        mode = jnp.array(int(MagneticMode.DAMPING))
        none = jnp.zeros_like(state.omega)
        return MagneticMemory(mode, none, none, self._momentum(state), jnp.array(False))

    def step(
        self, t: RealScalar, state: PlantState, memory: MagneticMemory
    ) -> tuple[Vector, MagneticMemory]:
        """Return the commanded torque (N m) and the next memory."""
        return self.beside(t, state, memory, jnp.zeros_like(self.steering.dipole_limit))

    def beside(
        self,
        t: RealScalar,
        state: PlantState,
        memory: MagneticMemory,
        besides: Float[Array, " k"],
    ) -> tuple[Vector, MagneticMemory]:
        """Return the torque beside dipoles (A m²) that are commanded anyway, and the memory."""
        relative, turn = self.model.relative_rate(state), _turn(state)
        mode = self._mode(_size(relative), _size(turn), memory.mode)
        field = self.steering.field.in_body(t, state.attitude)
        momentum = self._momentum(state)
        stopped = mode != int(MagneticMode.DAMPING)
        learns = stopped & memory.predicts
        surplus = jnp.where(learns, self.gain.rate, 0.0) * (momentum - memory.momentum)
        dipole = memory.dipole + jnp.cross(field, surplus) / jnp.sum(field**2)
        constant = memory.torque + surplus
        residual = jnp.cross(dipole + self.steering.axes @ besides, field)
        excess = self.steering.excess(state)
        points = self.gain.torque(t, jnp.concatenate([turn, relative]), excess, constant)
        slews = self._slew(state, turn, relative)
        pull = jnp.where(mode == int(MagneticMode.POINTING), points, slews)
        torque = jnp.where(stopped, pull, -self.damping * relative) - residual
        dipoles = self.steering.unlimited(field, self.steering.demand(state, torque))
        within = jnp.all(jnp.abs(dipoles + besides) <= self.steering.dipole_limit)
        outside = jnp.cross(self.steering.axes @ dipoles, field) + residual + constant
        outside = outside + self.model.disturbance_torque(t, state)
        outside = outside - jnp.cross(state.omega, momentum)
        return torque, MagneticMemory(
            mode, dipole, constant, momentum + self.period * outside, stopped & within
        )

    def _mode(self, speed: RealScalar, turn: RealScalar, before: IntScalar) -> IntScalar:
        """Select the mode by rate (rad/s) and turn (rad) from the orbit frame, with hysteresis."""
        stopped = before != int(MagneticMode.DAMPING)
        pointed = before == int(MagneticMode.POINTING)
        slow = speed < jnp.where(stopped, LEAVE, 1.0) * self.pointing_rate
        near = turn < jnp.where(pointed, LEAVE, 1.0) * NEAR
        mode = jnp.where(near, int(MagneticMode.POINTING), int(MagneticMode.SLEWING))
        return jnp.where(slow, mode, int(MagneticMode.DAMPING))

    def _momentum(self, state: PlantState) -> Vector:
        """Return the momentum of body and wheels (N m s, body axes)."""
        return self.model.spacecraft.inertia @ state.omega + self._stored(state)

    def _stored(self, state: PlantState) -> Vector:
        momentum = wheel_momentum(state)
        if self.wheel_axes is None or momentum is None:
            return jnp.zeros_like(state.omega)
        return self.wheel_axes @ momentum

    def _slew(self, state: PlantState, turn: Vector, relative: Vector) -> Vector:
        """Return the torque (N m) far from the orbit frame."""
        torque = -self.stiffness * turn - self.slew_damping * relative
        bias = self.steering.bias[1] * self.model.orbit.frame_rate(state.attitude)  # -ω0 h0
        return torque - self.steering.command_part @ (self.gain.rate * self._stored(state) + bias)

    def mode(self, memory: MagneticMemory) -> IntScalar:
        """Return the `MagneticMode` at work."""
        return memory.mode


def _turn(state: PlantState) -> Vector:
    """Return the turn 2 sgn(q0) q, rad."""
    quaternion = state.attitude.as_quaternion().q
    return jnp.where(quaternion[0] < 0, -2.0, 2.0) * quaternion[1:]


def _size(vector: Vector) -> RealScalar:
    return jnp.sqrt(jnp.sum(vector**2) + SMALLEST**2)


def magnetic_motion(
    inertia: Float[np.ndarray, "3 3"],
    magnetic: MagneticContext,
    gravity_gradient: bool,
    rods: Bool[np.ndarray, " rods"] | None = None,
) -> LinearMotion:
    """Return the linear motion of a body (kg m²) with magnetorquers and any wheels.

    All magnetorquers are commanded, of which these work; None for all.
    """
    steering, momentum = magnetic
    axes, shares = (np.asarray(one, float) for one in (steering.axes, steering.shares))
    working = axes if rods is None else axes * rods
    return linear_motion(
        inertia,
        steering.field,
        np.asarray(steering.command_part, float),
        momentum,
        dipoles=working @ shares,
        missing=np.eye(3) - axes @ shares,
        unloading=0.0 if steering.wheel_axes is None else float(steering.unloading),
        gravity_gradient=gravity_gradient,
    )


def _left_in_an_orbit(motion: LinearMotion, gain: PeriodicGain) -> float:
    """Return the part of the slowest error that an orbit leaves, the mean of a day.

    It is the geometric mean, as a day passes through all turns of the Earth.
    """
    return float(np.exp(np.mean(np.log(np.abs(floquet_multipliers(motion, gain)[:, 0])))))


def _gain(motion: LinearMotion, weight: float, wheel_weight: float) -> PeriodicGain:
    gain = periodic_gain(motion, weight, wheel_weight)
    largest = np.inf if gain is None else _left_in_an_orbit(motion, gain)
    if gain is None or not largest < STAYS:
        raise UnsuitableModel(
            "inclination",
            "can hold all axes by magnetorquers, for which the field must turn in the orbit: "
            "errors must fall in an orbit, on average over a day, to less than 1 of what they "
            f"were, got {largest:.3g} (largest Floquet multiplier)",
        )
    return gain


def _damping(field: AbstractMagneticField, least: float) -> float:
    """Return 2 ω0 (1 + sin ξ) J_min, ξ the mean inclination to the geomagnetic equator."""
    orbit = field.circle
    dipole = np.asarray(field.dipole)
    axial = float(abs(dipole[2]) / np.linalg.norm(dipole))
    inclined = abs(np.sin(float(orbit.inclination))) * axial
    return 2 * float(orbit.rate) * (1 + inclined) * least
