"""Rest of a body near the orbit frame, from which products of inertia and wheels turn it away."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.linear import skew

NORMAL, NADIR = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
"""The orbit normal and the way to the Earth, in the orbit frame."""

MOST_TURN = 0.5
"""Largest turn (rad) from the orbit frame to a rest that counts as near it."""

ACROSS = 0.1
"""Smallest sine of the angle between the orbit normal and a wheel whose momentum balances."""

_ITERATIONS, _LARGEST_STEP, _BALANCED = 50, 0.2, 1e-12


class OrbitRest(NamedTuple):
    """A rest near the orbit frame: `to_body` is C (v_body = C v_orbit), `turn` its angle (rad).

    `momentum` is that of wheels there, over the orbit's rate (kg m², body axes). Magnetorquers need
    the part `opposing` of their limits to rest there: zero at an equilibrium.
    """

    to_body: Float[np.ndarray, "3 3"]
    momentum: Float[np.ndarray, "3"]
    turn: float
    opposing: float = 0.0


class _Balance(NamedTuple):
    """Torques on a body at rest, over the square of the orbit's rate (kg m², body axes).

    `torque` is left after wheels balance what they can by the `momentum`; `keeps` projects on it.
    """

    momentum: Float[np.ndarray, "3"]
    torque: Float[np.ndarray, "3"]
    keeps: Float[np.ndarray, "3 3"]


def _balance(
    to_body: Float[np.ndarray, "3 3"],
    inertia: Float[np.ndarray, "3 3"],
    momentum: Float[np.ndarray, "3"],
    basis: Float[np.ndarray, "3 p"],
    pull: float,
) -> _Balance:
    normal, nadir = to_body @ NORMAL, to_body @ NADIR
    across = np.cross(normal, basis.T).T
    ways, sizes, shares = np.linalg.svd(across, full_matrices=False)
    ways, shares = ways[:, sizes > ACROSS], shares[sizes > ACROSS]
    torque = np.cross(normal, inertia @ normal + momentum)
    torque -= pull * np.cross(nadir, inertia @ nadir)
    stored = momentum - basis @ (shares.T @ (ways.T @ torque / sizes[sizes > ACROSS]))
    keeps = np.eye(3) - ways @ ways.T
    return _Balance(stored, keeps @ torque, keeps)


def balance_at_frame(
    inertia: Float[np.ndarray, "3 3"],
    momentum: Float[np.ndarray, "3"],
    basis: Float[np.ndarray, "3 p"],
    *,
    gravity_gradient: bool,
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return the momentum of wheels in the orbit frame, and the torque that they leave there.

    Over the orbit's rate, and over its square (both kg m²); arguments as of `rest_near_frame`.
    """
    stored, torque, _ = _balance(np.eye(3), inertia, momentum, basis, 3.0 * gravity_gradient)
    return stored, torque


def rest_near_frame(
    inertia: Float[np.ndarray, "3 3"],
    momentum: Float[np.ndarray, "3"],
    basis: Float[np.ndarray, "3 p"],
    *,
    gravity_gradient: bool,
) -> OrbitRest | None:
    """Find the attitude near the orbit frame where nothing turns the body; None if there is none.

    There n × (J n + h + E η) = 3 e × J e with the orbit normal n and e towards the Earth, without
    the right-hand side if gravity gradient does not act. `inertia` J (kg m²), `momentum` h of
    wheels over the orbit's rate (kg m²). Wheels with the orthonormal `basis` E hold what momentum η
    across n balances; the turn is the smallest for the rest, by Newton's method.
    """
    from scipy.spatial.transform import Rotation  # slow

    turn, stored = np.eye(3), np.asarray(momentum, float)
    size, pull = np.abs(inertia).max() + np.linalg.norm(stored), 3.0 * gravity_gradient
    for _ in range(_ITERATIONS):
        normal, nadir = turn @ NORMAL, turn @ NADIR
        stored, rest, keeps = _balance(turn, inertia, stored, basis, pull)
        if np.linalg.norm(rest) <= _BALANCED * size:
            angle = float(Rotation.from_matrix(turn).magnitude())
            return OrbitRest(turn, stored, angle) if angle <= MOST_TURN else None
        whole = inertia @ normal + stored
        slope = (skew(normal) @ inertia - skew(whole)) @ skew(normal)
        slope -= pull * (skew(nadir) @ inertia - skew(inertia @ nadir)) @ skew(nadir)
        step = np.linalg.lstsq(keeps @ slope, -rest, rcond=1e-9)[0]
        step *= min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-300))
        turn = Rotation.from_rotvec(-step).as_matrix() @ turn
    return None
