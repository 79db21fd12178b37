"""What an open-loop solution really does, by an integrator and equations of its own."""

from typing import NamedTuple

import numpy as np

from jaxsat.synthesis.bounds.manoeuvre import Manoeuvre
from jaxsat.synthesis.bounds.transcription import Solution

TOLERANCE = 1e-11

MAX_ANGLE, MAX_RATE = 1e-4, 1e-5
"""A flight arrives at rest if it ends so near it (rad, rad/s)."""

MAX_EXCESS = 0.01
"""And within what is allowed of tilt, turn and rate if it exceeds it by no more of itself."""


class Verification(NamedTuple):
    """How far from the target a flight ends, in angle (rad) and relative rate (rad/s).

    The rate is that in inertial axes where rates alone are to be stopped.
    `effort` is ∫ Σ|T_i| dt (N m s) and `largest_thrust` the largest of any thruster (N m). `tilt`
    and `turn` (rad) are the parts of the angle across and about the third axis.
    """

    angle: float
    rate: float
    effort: float
    largest_thrust: float
    tilt: float
    turn: float

    def arrives(self, manoeuvre: Manoeuvre) -> bool:
        """Whether it ends where the manoeuvre does."""
        if manoeuvre.ends_at_rest:
            angles, ends = (self.angle,), (MAX_ANGLE, MAX_RATE)
        else:
            angles = (self.tilt, abs(self.turn))
            ends = tuple((1 + MAX_EXCESS) * one for one in manoeuvre.end)
        near = manoeuvre.rates_only or all(a < b for a, b in zip(angles, ends, strict=False))
        return near and self.rate < ends[-1]


def propagate(manoeuvre: Manoeuvre, solution: Solution) -> Verification:
    """Fly a solution's thrusts by DOP853, the attitude as direction cosines by (1), (10), (11)."""
    inverse = np.linalg.inv(manoeuvre.inertia)
    length = solution.duration / len(solution.thrust)

    def rate(t, y, torque):
        cosines, omega = y[:9].reshape(3, 3), y[9:]
        nadir = cosines[:, 2]
        gradient = 3 * manoeuvre.gradient_rate**2 * np.cross(nadir, manoeuvre.inertia @ nadir)
        turning = np.cross(omega, manoeuvre.inertia @ omega)
        total = torque + manoeuvre.disturbance(t) + gradient - turning
        turned = -np.cross(relative_rate(cosines, omega), cosines, axisb=0, axisc=0)
        return np.concatenate([turned.ravel(), acceleration(total)])

    def acceleration(total):
        if not manoeuvre.third_rate_held:
            return inverse @ total
        return np.append(np.linalg.solve(manoeuvre.inertia[:2, :2], total[:2]), 0.0)

    def relative_rate(cosines, omega):
        axis = np.eye(3)[1] if manoeuvre.small_angle else cosines[:, 1]
        return omega + manoeuvre.orbit_rate * axis

    from scipy.integrate import solve_ivp  # takes its time, and a check flies nothing

    y = np.concatenate([_cosines(manoeuvre.quaternion).ravel(), manoeuvre.omega])
    for number, thrust in enumerate(solution.thrust):
        span = (number * length, (number + 1) * length)
        torque = manoeuvre.torque_axes @ thrust
        flown = solve_ivp(rate, span, y, "DOP853", args=(torque,), rtol=TOLERANCE, atol=TOLERANCE)
        y = flown.y[:, -1]
    cosines, omega = y[:9].reshape(3, 3), y[9:]
    sine = np.array([cosines[1, 2] - cosines[2, 1], cosines[2, 0] - cosines[0, 2]])
    sine = np.append(sine, cosines[0, 1] - cosines[1, 0]) / 2
    angle = np.arctan2(np.linalg.norm(sine), (np.trace(cosines) - 1) / 2)
    tilt = np.arctan2(np.hypot(cosines[0, 2], cosines[1, 2]), cosines[2, 2])
    turn = np.arctan2(cosines[0, 1] - cosines[1, 0], cosines[0, 0] + cosines[1, 1])
    torques = solution.thrust @ manoeuvre.torque_axes.T
    return Verification(
        float(angle),
        float(np.linalg.norm(omega if manoeuvre.rates_only else relative_rate(cosines, omega))),
        float(np.abs(torques).sum() * length),
        float(np.abs(solution.thrust).max()),
        float(tilt),
        float(turn),
    )


def _cosines(quaternion: np.ndarray) -> np.ndarray:
    q0, q = quaternion[0], quaternion[1:]
    cross = np.array([[0, -q[2], q[1]], [q[2], 0, -q[0]], [-q[1], q[0], 0]])
    return (q0**2 - q @ q) * np.eye(3) + 2 * np.outer(q, q) - 2 * q0 * cross
