"""Manoeuvre whose optimum is sought, as plain numbers."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from jaxsat.core.errors import ArgumentError
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import (
    AbstractDisturbance,
    ConstantTorque,
    GravityGradient,
    NoDisturbance,
    PeriodicTorque,
    terms_of,
)
from jaxsat.spacecraft.environment.orbit import SmallAngleOrbit

Vector = Float[np.ndarray, "3"]

End = Literal["settled", "rest"]
"""End of a manoeuvre: where a case counts as settled, or exactly at rest."""


@dataclass(frozen=True)
class Manoeuvre:
    """Manoeuvre from a start to rest in the orbit frame, or within tolerances of it.

    `inertia` (3, 3) in kg m², `torque_axes` (3, m) of thrusters that each make up to `limit` N m of
    either sign, `orbit_rate` ω0 in rad/s. The start is a unit quaternion from the orbit to the body
    frame, scalar first, and ω in rad/s. The disturbance is (2) plus a constant, N m, and the
    gravity gradient of an orbit at `gradient_rate` rad/s. With `small_angle` (11) has the identity
    in place of C_bo; with `third_rate_held` an ideal torque keeps ω3 constant. With `rates_only` it
    ends at ω = 0 in any attitude. `end` is the largest tilt and turn (rad) and relative rate
    (rad/s) at the end, zero for rest.
    """

    inertia: Float[np.ndarray, "3 3"]
    torque_axes: Float[np.ndarray, "3 m"]
    limit: float
    orbit_rate: float
    quaternion: Float[np.ndarray, "4"]
    omega: Vector
    amplitude: Vector
    frequency: Vector
    phase: Vector
    constant: Vector
    gradient_rate: float = 0.0
    small_angle: bool = False
    third_rate_held: bool = False
    rates_only: bool = False
    end: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self):
        if not 0 < self.limit < math.inf:
            raise ArgumentError("limit", "must be positive and finite", f"{self.limit} N m")
        if self.torque_axes.shape[1] < 1:
            raise ValueError("Argument `torque_axes` must have at least one thruster.")

    @property
    def ends_at_rest(self) -> bool:
        """Whether the manoeuvre ends exactly at rest."""
        return not any(self.end)

    def disturbance(self, t: float) -> Vector:
        """Return (2) at time `t` (s) plus the constant, N m."""
        return self.amplitude * np.sin(self.frequency * t + self.phase) + self.constant

    @property
    def tau(self) -> float:
        """Unit of time √(J/Tm), s, of the mean moment of inertia and one thruster's torque."""
        return math.sqrt(float(np.trace(self.inertia)) / 3 / self.limit)

    def time_unit(self) -> float:
        """Return √(J/T) of the largest moment about a body axis and the torque limit, s."""
        return math.sqrt(np.diag(self.inertia).max() / self.limit)

    def slew_time(self) -> float:
        """Return the duration (s) of one slew by one thruster through the start's tilt and turn."""
        angle = 2 * math.acos(min(1.0, abs(float(self.quaternion[0]))))
        angle = math.pi if self.rates_only else angle  # as many rates take a turn to stop
        stop = float(np.abs(self.inertia @ self.omega).max()) / self.limit
        return 2 * self.time_unit() * math.sqrt(angle) + stop


def ideal_thrusters(plant: RigidBody) -> Actuators | None:
    """Return the thrusters of a body if they are ideal and its only effectors, else None."""
    alone = plant.effectors[0] if len(plant.effectors) == 1 else None
    return alone if isinstance(alone, Actuators) else None


def manoeuvre_of(
    loop: AbstractLoop,
    start: PlantState,
    rates_only: bool = False,
    tolerances: Tolerances | None = None,
) -> Manoeuvre:
    """Return the manoeuvre of a closed loop from a start, whatever its controller.

    With `rates_only` it stops the rotation in any attitude. It ends within `tolerances` or, without
    them, at rest.

    Raises `ValueError` where the thrusters have no limit, or for a plug-in disturbance.
    """
    plant = loop.plant
    if not isinstance(loop, ContinuousLoop | SampledLoop):
        raise ValueError("Bounds need thrusters with a limit, but the loop has ideal ones.")
    thrusters = ideal_thrusters(plant)
    if thrusters is None:
        names = [type(one).__name__ for one in plant.effectors]
        raise ValueError(f"Bounds need thrusters that make their torque exactly, but got {names}.")
    periodic, constant, gradients = _torques(plant.disturbance)
    zero = np.zeros(3)

    def part(name: str) -> Vector:
        return np.asarray(getattr(periodic[0], name), float) if periodic else zero

    return Manoeuvre(
        inertia=np.asarray(plant.spacecraft.inertia, float),
        torque_axes=np.asarray(thrusters.torque_axes, float),
        limit=float(thrusters.limit),
        orbit_rate=float(plant.orbit.rate),
        quaternion=np.asarray(start.attitude.as_quaternion().q, float),
        omega=np.asarray(start.omega, float),
        amplitude=part("amplitude"),
        frequency=part("frequency"),
        phase=part("phase"),
        constant=sum((np.asarray(one.torque, float) for one in constant), zero),
        gradient_rate=float(gradients[0].orbit_rate) if gradients else 0.0,
        small_angle=isinstance(plant.orbit, SmallAngleOrbit),
        third_rate_held=plant.third_rate_held,
        rates_only=rates_only,
        end=(0.0, 0.0, 0.0) if tolerances is None else _end_of(tolerances),
    )


def _end_of(tolerances: Tolerances) -> tuple[float, float, float]:
    turn = min(float(tolerances.z), math.pi)
    return 2 * math.atan(float(tolerances.w)), turn, float(tolerances.relative_rate)


def _torques(
    disturbance: AbstractDisturbance,
) -> tuple[list[PeriodicTorque], list[ConstantTorque], list[GravityGradient]]:
    terms = terms_of(disturbance)
    periodic = [term for term in terms if isinstance(term, PeriodicTorque)]
    constant = [term for term in terms if isinstance(term, ConstantTorque)]
    gradients = [term for term in terms if isinstance(term, GravityGradient)]
    none = sum(isinstance(term, NoDisturbance) for term in terms)
    supported_terms = len(periodic) + len(constant) + len(gradients) + none
    if supported_terms < len(terms) or max(len(periodic), len(gradients)) > 1:
        raise ValueError(
            "Bounds need a disturbance of at most one periodic torque, one gravity gradient and "
            "constant torques, but got " + ", ".join(type(term).__name__ for term in terms) + "."
        )
    return periodic, constant, gradients
