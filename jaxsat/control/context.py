"""What a control law is built from, besides its own keys."""

from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.control.diagnosis import ThrusterModel
from jaxsat.core.errors import JaxsatError
from jaxsat.spacecraft import Wheels
from jaxsat.spacecraft.dynamics import RigidBody


class ThrusterContext(NamedTuple):
    """What a law that commands the duties of thrusters is told of them.

    `cost` is what full thrust of each costs, `rate_noise` (rad/s) the standard deviation of the
    rates that the law is told, zero where they are exact. `pulse` (s) is the least on-time, of
    which each gives whole multiples, zero where any on-time will do.
    """

    model: ThrusterModel
    cost: Float[np.ndarray, " m"]
    rate_noise: float
    pulse: Float[np.ndarray, " m"]


class WheelContext(NamedTuple):
    """What a law that commands the torque of each wheel is told of them.

    `wheels` have the limits and the friction that are declared, and no failures in flight. `failed`
    tells which had failed before the start. `momentum_noise` (N m s) is the standard deviation of
    each tachometer, `rate_noise` (rad/s) that of the rates that the law is told, zero where they
    are exact. Commands act `delay` (s) late.
    """

    wheels: Wheels
    failed: Bool[np.ndarray, " m"]
    momentum_noise: Float[np.ndarray, " m"]
    delay: float
    rate_noise: float = 0.0


class LawContext(NamedTuple):
    """What a scenario tells a law besides the law's own keys.

    `model` is what the controller believes of the plant, with the disturbance that it measures. Its
    inertia is the one that turns under a torque: with wheels it is without that of their rotors.
    `torque_limit` (N m) is that of each thruster, None if unlimited. The periodic disturbance has
    `disturbance_amplitude` (N m) and `disturbance_frequency` (rad/s) about x, y and z. The unit
    columns of `torque_axes` are the torque axes of the working thrusters. `thrusters` is None but
    for laws that command their duties, `wheels` but for those that command the torque of each.
    `gravity_gradient` tells whether that torque acts.
    """

    model: RigidBody
    torque_limit: float | None
    disturbance_amplitude: tuple[float, ...]
    disturbance_frequency: tuple[float, ...]
    torque_axes: Float[np.ndarray, "3 m"] = np.eye(3)[:, :2]
    thrusters: ThrusterContext | None = None
    wheels: WheelContext | None = None
    gravity_gradient: bool = False


class UnsuitableModel(JaxsatError, ValueError):
    """A law cannot be built for what it believes of `about`, its inertia or its orbit's rate."""

    about: Literal["inertia", "orbit_rate"]

    def __init__(self, about: Literal["inertia", "orbit_rate"], message: str):
        super().__init__(message)
        self.about = about
