"""Whether two wheels hold the target in a case of a study, with its momentum and torques.

No wheel changes E, the momentum beyond the requirement of the target's rate, about the normal n of
both wheels: n·Jω equals it. In the target's axes dE/dt = m - o × E, with o the rate of the orbit
frame and m the external torque less o × J o. Two wheels hold the target for the required time if
n·E / |Jn| is a rate that leaves the attitude within its tolerances.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsat.compiler.llvm.mapped import compiled_over_cases
from jaxsat.core.attitude import DCM
from jaxsat.core.once import once_property
from jaxsat.core.tolerances import SETTLED_BEFORE, Tolerances
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.studies.changes import PerturbedLoop
from jaxsat.studies.quantities import QUANTITIES

INSTANTS = 97
"""Number of instants from the last failure to the end at which torques are evaluated."""

AN_ORBIT = 32
"""Least number of these instants in an orbit."""

SLOW = 0.25
"""Largest rotation of a held body over the required time, relative to the tolerance."""

NOTHING = 1e-12
"""Momentum that is treated as zero, relative to that of a body at the largest rate allowed."""

SLIGHT = 1e-3
"""Rotation (rad) over which the slope of a torque is taken."""


@dataclass(frozen=True)
class Held:
    """Cases, by their `draws`, with the `duration` (s) and the `tolerances` of the attitude before
    the end."""

    loop: AbstractLoop
    start: PlantState
    duration: float
    tolerances: Tolerances
    draws: Mapping[str, np.ndarray]

    @once_property
    def _starts(self) -> "_Starts":
        """Start of each case; one for all without draws."""
        names = [name for name in QUANTITIES if name in self.draws]
        draws = tuple(np.asarray(self.draws[name]) for name in names)
        draws = tuple(one.reshape(len(one), -1) for one in draws)

        def begin(values, _):
            perturbed = PerturbedLoop(self.loop, self.start, self.loop)
            for name, value in zip(names, values, strict=True):
                perturbed = QUANTITIES[name].apply(perturbed, value)
            plant, state = perturbed.loop.plant, perturbed.start
            into_body = state.attitude.as_dcm().matrix
            momentum = into_body.T @ plant.total_momentum(state)
            return plant.spacecraft.inertia, momentum, into_body

        if not names:
            return _Starts(*(np.asarray(one)[None] for one in begin((), None)))
        starts = compiled_over_cases(begin, tuple(one[0] for one in draws))(draws)
        return _Starts(*map(np.asarray, starts))

    @once_property
    def free(self) -> bool:
        """Whether neither an external torque acts nor the target turns."""
        times, inertia = np.linspace(0.0, self.duration, INSTANTS), self._starts.inertia[0]
        torques = self._torques(inertia, times, _slightly(SLIGHT * np.eye(3)))
        most = np.abs(inertia).max() * float(self.tolerances.relative_rate)
        nothing = np.abs(torques).max() * self.duration <= NOTHING * most
        return bool(nothing and not self._rate)

    @property
    def _rate(self) -> float:
        return float(np.asarray(self.loop.plant.orbit.rate))

    def holds(self, case: int, normal: Float[np.ndarray, "3"], failed: float) -> bool:
        """Whether two wheels with this `normal` hold the target at the end, with the last failure
        at `failed` (s).

        An attitude within the tolerances may oppose as much of the momentum as it can. The sign of
        the momentum from external torques before the last failure, in the initial attitude, is
        unknown.
        """
        limits, inertia = self._limits(normal), self._starts.of(case).inertia
        times, path = self.path(case, normal, failed)
        across = np.cross(normal, path)
        beside = np.linalg.norm(across, axis=1)
        away = np.abs(across) / np.where(beside > 0, beside, 1.0)[:, None]
        most = _within(limits.tilt, limits.turn, np.hypot(away[:, 0], away[:, 1]), away[:, 2])
        along = path @ normal
        margin = (
            np.abs(along)
            + self._unknown(case, failed)
            - np.sin(np.minimum(most, np.pi / 2)) * beside
        )
        rates = np.sign(along) * np.maximum(margin, 0.0) / float(np.linalg.norm(inertia @ normal))
        rates = rates[times >= self.duration - limits.dwell]
        turned = np.ptp(np.cumsum(rates)) * (times[1] - times[0])
        return bool(turned <= SLOW * limits.about and np.abs(rates).max() <= limits.rate)

    def path(
        self, case: int, normal: Float[np.ndarray, "3"], failed: float
    ) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k 3"]]:
        """Times (s) to the end, and E (N m s) at these times.

        The body is assumed at the target from the last failure on, or at an attitude within the
        tolerances that opposes the mean torque about the normal.
        """
        times = self.times(failed)
        if self.free:
            return times, self._path(case, times, np.zeros((len(times), 3)))
        inertia = self._starts.of(case).inertia
        return times, self._path(case, times, self._balanced(inertia, normal, times))

    def times(self, failed: float) -> Float[np.ndarray, " k"]:
        """Times (s) from a failure to the end."""
        failed = min(max(failed, 0.0), self.duration)
        orbits = (self.duration - failed) * abs(self._rate) / (2 * np.pi)
        return np.linspace(failed, self.duration, max(INSTANTS, int(AN_ORBIT * orbits)))

    def under(
        self, case: int, times: Float[np.ndarray, " k"], torque: Float[np.ndarray, "k 3"]
    ) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "3 3"]]:
        """E (N m s) of a body at the target under one more `torque` (N m), and how a constant
        vector turns in a step, in axes of the target."""
        inertia = self._starts.of(case).inertia
        torque = torque + self._torques(inertia, times, np.eye(3)[None])[0]
        frame = np.array([0.0, -self._rate, 0.0]) * (times[1] - times[0])
        turn = np.stack([_turned(axis, -frame) for axis in np.eye(3)], axis=1)
        return self._path(case, times, torque), turn

    def _path(
        self, case: int, times: Float[np.ndarray, " k"], torque: Float[np.ndarray, "k 3"]
    ) -> Float[np.ndarray, "k 3"]:
        """E (N m s) under a torque m (N m)."""
        inertia, momentum, _ = self._starts.of(case)
        frame, step = np.array([0.0, -self._rate, 0.0]), times[1] - times[0]
        path = np.tile(_turned(momentum, -frame * times[0]) - inertia @ frame, (len(times), 1))
        for number in range(1, len(times)):
            before = path[number - 1] + step / 2 * torque[number - 1]
            path[number] = _turned(before, -frame * step) + step / 2 * torque[number]
        return path

    @property
    def angle(self) -> float:
        """Least tolerance of the attitude, rad."""
        return min(2 * float(np.arctan(float(self.tolerances.w))), float(self.tolerances.z))

    def _limits(self, normal: Float[np.ndarray, "3"]) -> "_Limits":
        own = self.tolerances
        tilt, turn = 2 * np.arctan(float(own.w)), float(own.z)
        dwell = (1 - SETTLED_BEFORE) * self.duration if own.dwell is None else float(own.dwell)
        beside = np.hypot(normal[0], normal[1])
        about = float(_within(tilt, turn, beside, abs(normal[2])))
        return _Limits(tilt, turn, float(own.relative_rate), dwell, about)

    def _balanced(
        self,
        inertia: Float[np.ndarray, "3 3"],
        normal: Float[np.ndarray, "3"],
        times: Float[np.ndarray, " k"],
    ) -> Float[np.ndarray, "k 3"]:
        """m (N m) at the target, less the part of its mean about the normal that an attitude within
        the tolerances opposes."""
        turns = SLIGHT * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
        torques = self._torques(inertia, times, _slightly(turns))
        slopes = (torques[1:4] - torques[4:]).mean(axis=1) @ normal / (2 * SLIGHT)
        limits, mean = self._limits(normal), float(torques[0].mean(axis=0) @ normal)
        most = limits.tilt * np.hypot(slopes[0], slopes[1]) + limits.turn * abs(slopes[2])
        return torques[0] - np.clip(mean, -most, most) * normal

    def _unknown(self, case: int, failed: float) -> float:
        """Momentum (N m s) from torques in the initial attitude until the last failure (s)."""
        if self.free:
            return 0.0
        inertia, _, into_body = self._starts.of(case)
        torques = self._torques(inertia, np.zeros(1), np.stack([into_body, np.eye(3)]))[:, 0]
        return float(np.linalg.norm(into_body.T @ torques[0] - torques[1])) * failed

    def _torques(
        self,
        inertia: Float[np.ndarray, "3 3"],
        times: Float[np.ndarray, " k"],
        matrices: Float[np.ndarray, "n 3 3"],
    ) -> Float[np.ndarray, "n k 3"]:
        """m (N m, body axes) in several attitudes, at several times (s)."""
        plant = self.loop.plant

        def torque(row, inertia):
            t, matrix = row
            attitude = DCM(matrix)
            rate = plant.orbit.frame_rate(attitude)
            disturbance = plant.disturbance(t, attitude, inertia)
            return disturbance - jnp.cross(rate, inertia @ rate)

        shape = (len(matrices), len(times))
        rows = (np.tile(times, len(matrices)), np.repeat(matrices, len(times), axis=0))
        torques = compiled_over_cases(torque, (rows[0][0], rows[1][0]), inertia)(rows, inertia)
        return np.asarray(torques).reshape(*shape, 3)


class _Starts(NamedTuple):
    """Initial inertia (kg m²), momentum of body and wheels (N m s, axes of the target), and
    attitude, of each case or of one."""

    inertia: Float[np.ndarray, "*cases 3 3"]
    momentum: Float[np.ndarray, "*cases 3"]
    into_body: Float[np.ndarray, "*cases 3 3"]

    def of(self, case: int) -> "_Starts":
        """Return the start of a case."""
        return _Starts(*(one[min(case, len(one) - 1)] for one in self))


class _Limits(NamedTuple):
    """Tolerances of tilt and turn (rad) and of the rate (rad/s), the time (s) for which they hold,
    and the largest rotation about a normal (rad)."""

    tilt: float
    turn: float
    rate: float
    dwell: float
    about: float


def _within(tilt: float, turn: float, across, along):
    """Largest rotation (rad) within tolerances about an axis with these components across and along
    the third one."""
    with np.errstate(divide="ignore"):
        return np.minimum(tilt / np.abs(across), turn / np.abs(along))


def _slightly(turns: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Matrices of bodies turned slightly (rad) from the target: 1 - turn ×."""
    return np.eye(3) + np.cross(turns[:, None, :], np.eye(3))


def _turned(vector: Float[np.ndarray, "3"], turn: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    angle = float(np.linalg.norm(turn))
    if angle == 0:
        return vector
    axis = turn / angle
    along = axis * (axis @ vector)
    return along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector)
