"""Controllability over an orbit by magnetorquers together with the remaining wheels.

At an instant magnetorquers make two torques, across the Earth's field, and wheels those about their
axes. As the field turns along the orbit, the linear motion of attitude, rate and wheel momentum
about rest near the orbit frame can be controllable although at no instant it is. Its Gramian over
an orbit decides (Bhat, IEEE Trans. Automatic Control 50, 2005, pages 1725-1735), for the motion
from which the law `magnetic` has its gains (`jaxsat.control.periodic_gain`). Thrusters are left
out.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.control.flyable_laws import Laws
from jaxsat.control.linear_motion import TURNS, reference_moment, small_motion
from jaxsat.controllability.judgement import Judgement, OrbitRank, Verdict
from jaxsat.controllability.orbit_rest import (
    MOST_TURN,
    NORMAL,
    OrbitRest,
    balance_at_frame,
    rest_near_frame,
)
from jaxsat.core.once import once_property
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField

STEPS = 128
"""Number of instants of an orbit."""

LEAST_MARGIN = 2e-3
"""Threshold on the margin, below which the field hardly turns."""

MOST_OPPOSING = 0.5
"""Largest part of their limits with which magnetorquers may keep a body off an equilibrium: as much
is left to control it."""

SAME_AXIS = 1e-6
"""Tolerance on the sine of the angle between two equal axes."""


@dataclass(frozen=True, eq=False)
class RodSet:
    """Magnetorquers that may fail, and their environment.

    `axes` are unit columns (body axes) and `limits` dipoles (A m²) in the Earth's `field`. `bias`
    (N m s) is the momentum about the orbit normal that wheels keep; `gravity_gradient` includes its
    torque.
    """

    names: tuple[str, ...]
    axes: Float[np.ndarray, "3 k"]
    limits: Float[np.ndarray, " k"]
    field: AbstractMagneticField
    bias: float = 0.0
    gravity_gradient: bool = False

    def torques(
        self, places: Sequence[int], to_body: Float[np.ndarray, "3 3"] | None = None
    ) -> Float[np.ndarray, "turns instants 3 n"]:
        """Return torques (N m, orbit frame) of some at their limits, along an orbit, for Earth
        angles.

        The body rests at the attitude `to_body`, by default that of the orbit frame.
        """
        dipoles = (self.axes * self.limits)[:, list(places)]
        dipoles = dipoles if to_body is None else to_body.T @ dipoles
        return np.cross(dipoles.T, self.fields[..., None, :]).swapaxes(-1, -2)

    def rest(
        self,
        places: Sequence[int],
        inertia: Float[np.ndarray, "3 3"],
        momentum: Float[np.ndarray, "3"],
        basis: Float[np.ndarray, "3 p"],
    ) -> OrbitRest | None:
        """Return the rest of a body near the orbit frame, beside wheels with `momentum` (N m s).

        Where none is near, as of a body with equal moments about x and z and a product of both, it
        is the orbit frame if these rods hold the body there: with at most `MOST_OPPOSING` of their
        limits they oppose the torque, which accelerates the body by at most `MOST_TURN` ω0².
        """
        rate, pull = float(self.field.circle.rate), self.gravity_gradient
        rest = rest_near_frame(inertia, momentum / rate, basis, gravity_gradient=pull)
        if rest is not None:
            return rest
        stored, torque = balance_at_frame(inertia, momentum / rate, basis, gravity_gradient=pull)
        if np.linalg.norm(np.linalg.solve(inertia, torque)) > MOST_TURN:
            return None
        part = self.opposing(places, torque * rate**2)
        return OrbitRest(np.eye(3), stored, 0.0, part) if part <= MOST_OPPOSING else None

    def opposing(self, places: Sequence[int], torque: Float[np.ndarray, "3"]) -> float:
        """Return the largest part of their limits by which some oppose a torque (N m, orbit frame).

        It is constant, and opposed on the mean of an orbit by the dipoles with the least mean
        square, at the worst angle of the Earth; infinite where they cannot.
        """
        torques = self.torques(places)
        power = np.mean(torques @ torques.swapaxes(-1, -2), axis=1)
        weights = np.linalg.pinv(power, rcond=SAME_AXIS, hermitian=True) @ torque
        means = (power @ weights[..., None])[..., 0]
        if np.abs(means - torque).max() > SAME_AXIS * np.abs(torque).max():
            return np.inf
        return float(np.abs(weights[:, None, None] @ torques).max())

    @once_property
    def fields(self) -> Float[np.ndarray, "turns instants 3"]:
        """The field (T, orbit frame) at instants of an orbit, for angles of the Earth."""
        instants = (np.arange(STEPS) + 0.5) * 2 * np.pi / STEPS / float(self.field.circle.rate)
        turns = np.arange(TURNS) * 2 * np.pi / TURNS
        return self.field.sampled(instants, turns[:, None])


def rest_with_rods(judgement: Judgement, rods: RodSet, places: Sequence[int]) -> OrbitRest | None:
    """Return the rest near the orbit frame of a body with the rods of these places, and with its
    wheels at their bias, see `RodSet.rest`."""
    basis = _basis(judgement.actuators.wheel_axes)
    holds = bool(np.linalg.norm(NORMAL - basis @ (basis.T @ NORMAL)) <= SAME_AXIS)
    momentum = judgement.actuators.coasting + holds * rods.bias * NORMAL
    return rods.rest(places, judgement.inertia, momentum, basis)


def judge_with_rods(
    without: Judgement, rods: RodSet, places: Sequence[int], tolerance: float | int
) -> Judgement:
    """Return the judgement with the rods of these places, where they are needed.

    They are not where thrusters and wheels make three torques, or thrusters two. Singular values
    below `tolerance` of the largest are zero.
    """
    if not places or without.laws in ("three torques", "two torques"):
        return without
    inertia, basis = without.inertia, _basis(without.actuators.wheel_axes)
    rate = float(rods.field.circle.rate)
    independent = int(np.linalg.matrix_rank(rods.axes[:, list(places)], tol=SAME_AXIS))
    dimension, rank, margin, turn, opposing = 6 + basis.shape[1], 0, (0.0, 0.0), np.nan, 0.0
    rest = rest_with_rods(without, rods, places)
    if rest is not None:
        back, turn, opposing = rest.to_body.T, rest.turn, rest.opposing
        values = orbit_singular_values(
            back @ inertia @ back.T,
            back @ basis,
            back @ rest.momentum * rate,
            rods,
            places,
            rest.to_body,
        )
        rank = int(np.max(np.sum(values > tolerance * values[:, :1], axis=1)))
        ratios = values[:, -1] / values[:, 0]
        margin = (float(ratios.min()), float(ratios.max()))
    verdict, laws = _verdict(rest is not None, rank == dimension, margin, independent > 1)
    orbit = OrbitRank(independent, basis.shape[1], rank, dimension, margin, turn, opposing)
    if verdict != "controllable" and without.controllable:
        return without
    return dataclasses.replace(
        without,
        verdict=verdict,
        rank=rank,
        dimension=dimension,
        laws=laws,
        margin=margin[0],
        turn_time=np.nan,
        orbit=orbit,
        without_rods=without,
    )


def _verdict(
    rests: bool, full: bool, margin: tuple[float, float], flown: bool
) -> tuple[Verdict, Laws]:
    if not rests:
        return "not decided", "none"
    if not full:
        return "uncontrollable", "none"
    if margin[0] < LEAST_MARGIN:
        return "borderline", "magnetic" if flown else "none"
    return ("controllable", "magnetic") if flown else ("by drift", "none")


def _basis(axes: Float[np.ndarray, "3 k"]) -> Float[np.ndarray, "3 p"]:
    """Return an orthonormal basis of the torques of wheels along `axes`."""
    lengths = np.linalg.norm(axes, axis=0)
    directions, values, _ = np.linalg.svd(axes[:, lengths > 0] / lengths[lengths > 0])
    return directions[:, : int(np.sum(values > SAME_AXIS))]


def orbit_singular_values(
    inertia: Float[np.ndarray, "3 3"],
    basis: Float[np.ndarray, "3 p"],
    momentum: Float[np.ndarray, "3"],
    rods: RodSet,
    places: Sequence[int],
    to_body: Float[np.ndarray, "3 3"] | None = None,
) -> Float[np.ndarray, "turns x"]:
    """Compute singular values of a factor of the Gramian over an orbit, for Earth angles.

    `basis` (3, p) is that of the torques of wheels, whose `momentum` at rest is in N m s. These and
    the inertia are in axes along those of the orbit frame at rest, at the attitude `to_body`. The
    state is (δθ, δω / ω0, η), as in `lvlh_linearisation`. Wheels are as strong as the strongest
    torque of rods.
    """
    from scipy.linalg import expm  # slow

    rate, moment = float(rods.field.circle.rate), reference_moment(inertia)
    scaled, count = inertia / moment, basis.shape[1]
    state = small_motion(
        scaled, basis, momentum / (moment * rate), gravity_gradient=rods.gravity_gradient
    )
    inverse, unmade = np.linalg.inv(scaled), np.eye(3) - basis @ basis.T
    torques = rods.torques(places, to_body)
    torques = torques / np.abs(torques).max()
    own = np.concatenate([np.zeros((3, 3)), inverse @ unmade, basis.T])
    wheels = np.concatenate([np.zeros((3, count)), inverse @ basis, -np.eye(count)])
    shared = np.broadcast_to(wheels, (*torques.shape[:2], *wheels.shape))
    inputs = np.concatenate([own @ torques, shared], axis=-1)
    back, power = expm(-state * 2 * np.pi / STEPS), expm(-state * np.pi / STEPS)
    inertial = np.eye(len(state))  # of rates relative to the orbit frame
    inertial[3:6, :3] = np.cross(NORMAL, np.eye(3)).T
    blocks = []
    for instant in range(STEPS):
        blocks.append(inertial @ power @ inputs[:, instant])
        power = power @ back
    return np.linalg.svd(np.concatenate(blocks, axis=-1), compute_uv=False)
