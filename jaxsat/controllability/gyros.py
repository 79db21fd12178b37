"""Controllability by single-gimbal control moment gyros, also with locked gimbals.

With the total momentum P in body axes, which turns with the body, and the momenta h_i(δ_i) of
rotors with constant speed, J ω = P - Σ h_i. The state on the level set of the momentum is attitude
and gimbal angles, and the commands are the gimbal rates. Where the torques -∂h_i/∂δ_i of the
working gimbals have three directions, every torque can be made: a law of three torques flies.

Fewer still reach every attitude, in principle. The brackets of drift and one gimbal rate turn the
body about J⁻¹ ∂h/∂δ and, once more, about J⁻¹ h; the bracket of these two turns it about their
vector product: all three axes, at every state. The drift preserves the volume of a compact level
set, so almost every state returns, and all can be reached (Bhat and Tiwari, Controllability of
spacecraft attitude using control moment gyroscopes, IEEE Trans. Automatic Control 54, 2009). No law
of jaxsat does so.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.controllability.torque_ranges import torque_reserve
from jaxsat.core.text import number_text, vector_text

INDEPENDENT = 1e-9
"""Threshold on singular values of unit columns, below which they are dependent."""

TURNS = 2 * np.pi * np.array([0.0, 0.137, 0.371, 0.618])
"""Angles (rad) tried in the search for a nonsingular set, each gimbal at a multiple of them."""

WAYS = ("one gimbal", "two gimbals")
"""Numbers of gimbals that lock in addition to those already locked."""


@dataclass(frozen=True, eq=False)
class GyroCluster:
    """Gyros at their `angle` (rad): unit gimbal and spin axes, momenta (N m s), rates (rad/s).

    `spin_axes` are at angles of zero. A gimbal that is not `turning` is locked; its rotor keeps its
    momentum.
    """

    gimbal_axes: Float[np.ndarray, "3 k"]
    spin_axes: Float[np.ndarray, "3 k"]
    momentum: Float[np.ndarray, " k"]
    rate_limit: Float[np.ndarray, " k"]
    angle: Float[np.ndarray, " k"]
    turning: Bool[np.ndarray, " k"]

    def columns(self, angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, "3 n"]:
        """Return torques (N m) of the working gimbals per rad/s, at these angles (rad)."""
        across = np.cross(self.gimbal_axes, self.spin_axes, axis=0)
        change = np.cos(angle) * across - np.sin(angle) * self.spin_axes
        return (-change * self.momentum)[:, self.turning]

    @property
    def torques(self) -> int:
        """Number of independent torques at angles that are not singular."""
        numbers = np.arange(1, len(self.angle) + 1)
        return max(_rank(self.columns(turn * numbers)) for turn in TURNS)

    @property
    def torques_now(self) -> int:
        """Number of independent torques at the current angles."""
        return _rank(self.columns(self.angle))

    @property
    def reserve(self) -> float:
        """Torque (N m) that can be made about every axis at the current angles."""
        limit = self.rate_limit[self.turning]
        return torque_reserve(self.columns(self.angle), -limit, limit) if limit.size else 0.0

    def envelope(self, direction: Float[np.ndarray, "3"]) -> float:
        """Return the largest momentum (N m s) of the working gimbals along a unit direction.

        Each turns its rotor as near to the direction as possible: Σ H √(1 - (g·u)²).
        """
        along = direction @ self.gimbal_axes[:, self.turning]
        return float(np.sum(self.momentum[self.turning] * np.sqrt(np.maximum(1 - along**2, 0))))

    def locked(self, places: Sequence[int]) -> "GyroCluster":
        """Return the cluster with these gimbals locked at their angles."""
        turning = self.turning & ~np.isin(np.arange(len(self.turning)), places)
        return GyroCluster(
            self.gimbal_axes, self.spin_axes, self.momentum, self.rate_limit, self.angle, turning
        )

    def verdict(self) -> str:
        """Return the verdict on the working gimbals as one sentence."""
        count = f"{int(self.turning.sum())} of {len(self.turning)} gimbals"
        if self.torques == 3 and self.torques_now == 3:
            return (
                f"Controllable: {count} make three torques while they are not singular, at least "
                f"{number_text(self.reserve, 3)} N m about any axis at their angles at the start."
            )
        if self.torques == 3:
            return (
                f"Controllable: {count} make three torques while they are not singular, but they "
                "are singular at their angles at the start."
            )
        if not self.turning.any():
            return "Not controllable: all gimbals are locked."
        number = ("no", "one", "two")[self.torques]
        return (
            f"Controllable by drift: {count} make {number} independent torque"
            f"{'s' if self.torques == 2 else ''}; every attitude is reached as the momentum turns "
            "the body. No law of jaxsat uses it."
        )

    def lines(self) -> list[str]:
        """Return lines on the storable momentum, and on one or two more locked gimbals."""
        momentum = vector_text([self.envelope(axis) for axis in np.eye(3)])
        lines = [
            f"Control moment gyros (not in the table): they store at most {momentum} N m s along "
            "body x, y, z"
        ]
        places = np.flatnonzero(self.turning).tolist()
        for number, way in enumerate(WAYS, 1):
            cases = [self.locked(some) for some in itertools.combinations(places, number)]
            if not cases or number == len(places):
                continue
            three = [one.reserve for one in cases if one.torques == 3]
            text = f"{len(three)} of {len(cases)} cases leave three torques"
            if three:
                text += f", the worst {number_text(min(three), 3)} N m about some axis at the start"
            if len(three) < len(cases):
                text += "; the others are controllable by drift alone"
            lines.append(f"With {way} locked: {text}")
        return lines


def _rank(columns: Float[np.ndarray, "3 n"]) -> int:
    sizes = np.linalg.norm(columns, axis=0)
    axes = columns[:, sizes > 0] / sizes[sizes > 0]
    return int(np.sum(np.linalg.svd(axes, compute_uv=False) > INDEPENDENT)) if axes.size else 0
