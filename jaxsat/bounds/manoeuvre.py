"""The manoeuvre whose bounds are sought, as plain numbers."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.dynamics import PlantState
from jaxsat.environment import (
    AbstractDisturbance,
    ConstantTorque,
    ExactOrbit,
    NoDisturbance,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.simulation import AbstractLoop, ContinuousLoop, SampledLoop

Vector = Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Manoeuvre:
    """From a start to rest in the orbit frame, as fast or as cheaply as thrusters can.

    `inertia` (3, 3) in kg m², `torque_axes` (3, m) of thrusters that each make up to `limit` N m
    of either sign, `orbit_rate` ω0 in rad/s. The start is a unit quaternion from the orbit to the
    body frame, scalar first, and ω in rad/s. The disturbance is (2) plus a constant, N m.
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

    def __post_init__(self):
        if not 0 < self.limit < math.inf:
            raise ValueError(
                f"Argument `limit` must be positive and finite, but got {self.limit} N m."
            )
        if self.torque_axes.shape[1] < 2:
            raise ValueError("Argument `torque_axes` must have at least two thrusters.")

    def disturbance(self, t: float) -> Vector:
        """(2) at time `t` (s) plus the constant, N m."""
        return self.amplitude * np.sin(self.frequency * t + self.phase) + self.constant

    def slew_time(self) -> float:
        """Seconds for the tilt and turn of the start as one slew with one thruster."""
        angle = 2 * math.acos(min(1.0, abs(float(self.quaternion[0]))))
        stop = float(np.abs(self.inertia @ self.omega).max()) / self.limit
        return 2 * math.sqrt(np.diag(self.inertia).max() * angle / self.limit) + stop


def manoeuvre_of(loop: AbstractLoop, start: PlantState) -> Manoeuvre:
    """The manoeuvre that a closed loop has to do from a start, whatever its controller.

    Raises `ValueError` where that is not one of a free rigid body in the exact orbit frame with
    limited thrusters under disturbances that depend on time alone.
    """
    plant = loop.plant
    if not isinstance(loop, ContinuousLoop | SampledLoop):
        raise ValueError("Bounds need thrusters with a limit, but the loop has ideal ones.")
    if plant.third_rate_held:
        raise ValueError("Bounds need a free third rate, but the plant's is held.")
    if not isinstance(plant.orbit, ExactOrbit):
        raise ValueError("Bounds need the exact form of (11), but got its small angle form.")
    periodic, constant = _torques(plant.disturbance)
    zero = np.zeros(3)

    def part(name: str) -> Vector:
        return zero if periodic is None else np.asarray(getattr(periodic, name), float)

    return Manoeuvre(
        inertia=np.asarray(plant.spacecraft.inertia, float),
        torque_axes=np.asarray(loop.actuators.torque_axes, float),
        limit=float(loop.actuators.limit),
        orbit_rate=float(plant.orbit.rate),
        quaternion=np.asarray(start.attitude.as_quaternion().q, float),
        omega=np.asarray(start.omega, float),
        amplitude=part("amplitude"),
        frequency=part("frequency"),
        phase=part("phase"),
        constant=sum((np.asarray(one.torque, float) for one in constant), zero),
    )


def _torques(
    disturbance: AbstractDisturbance,
) -> tuple[PeriodicTorque | None, list[ConstantTorque]]:
    terms = disturbance.terms if isinstance(disturbance, SumOfDisturbances) else (disturbance,)
    periodic = [term for term in terms if isinstance(term, PeriodicTorque)]
    constant = [term for term in terms if isinstance(term, ConstantTorque)]
    known = len(periodic) + len(constant) + sum(isinstance(t, NoDisturbance) for t in terms)
    if known < len(terms) or len(periodic) > 1:
        raise ValueError(
            "Bounds need a disturbance of at most one periodic torque and constant ones, but got "
            + ", ".join(type(term).__name__ for term in terms)
            + "."
        )
    return (periodic[0] if periodic else None), constant
