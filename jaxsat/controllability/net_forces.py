"""The least net force of a torque: zero for couples, while other thrusters also push the body."""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.actuators import ActuatorSet
from jaxsat.controllability.cone import (
    TorqueCone,
    complement,
    direction_words,
    nonnegative_least_squares,
    unit_rays,
)
from jaxsat.controllability.layout import TOLERANCE

ROUNDING = 1e-12
"""Tolerance on a sum of torques or forces, relative to its parts."""

DEPENDENT = 1e-11
"""Least singular value of wrenches that are independent, relative to the largest."""


@dataclass(frozen=True, eq=False)
class NetForce:
    """Least net force of attainable torques of thrusters.

    `directions` are unit torques: ± the body axes where all torques can be made, else ± a basis of
    those of both signs and the thrusters' own. `ratios` are in N per N m, equal to the linear
    impulse (N s) per N m s of angular impulse; for a spacecraft of mass m it is ΔV times m.
    """

    directions: Float[np.ndarray, "3 q"]
    ratios: Float[np.ndarray, " q"]

    @property
    def couples(self) -> bool:
        """Whether every torque can be made without net force."""
        return not np.any(self.ratios > 0)


def net_force(actuators: ActuatorSet, cone: TorqueCone) -> NetForce | None:
    """Compute the least net force of the thrusters' torques; None where forces are unknown.

    `cone` is that of the thrusters alone. Directions of a borderline cone that no thrusts make are
    left out.
    """
    if actuators.forces is None or not cone.rays.shape[1]:
        return None
    signs = actuators.two_sided
    torques = np.concatenate([actuators.torques, -actuators.torques[:, signs]], axis=1)
    forces = np.concatenate([actuators.forces, -actuators.forces[:, signs]], axis=1)
    if cone.two_sided == 3:
        directions = np.concatenate([np.eye(3), -np.eye(3)], axis=1)
    else:
        one_way = unit_rays(actuators.torques[:, ~signs], signs[~signs])
        directions = np.concatenate([cone.both_signs, -cone.both_signs, one_way], axis=1)
    ratios = np.array([_least(torques, forces, direction) for direction in directions.T])
    possible = np.isfinite(ratios)
    return NetForce(directions[:, possible], ratios[possible]) if possible.any() else None


def _least(
    torques: Float[np.ndarray, "3 k"],
    forces: Float[np.ndarray, "3 k"],
    direction: Float[np.ndarray, "3"],
) -> float:
    """Return the least |Σ λ f| for Σ λ τ = direction, λ ≥ 0; infinite without such λ.

    Those without torque across the direction are a cone. Of torque s and force s p of its rays,
    least squares of s = 1 and s p = 0 give the p nearest to zero, s up to a factor.
    """
    for tolerance in (ROUNDING, TOLERANCE):  # the second is that of the torques' cone
        torque, force, effort = _rays(torques, forces, direction, tolerance)
        if np.any(torque > 0):
            break
    else:
        return np.inf
    unit = float(np.min(np.linalg.norm(force, axis=0)[torque > 0] / torque[torque > 0]))
    if unit == 0:
        return 0.0
    rows = np.concatenate([force / unit, torque[None]])
    sizes = np.linalg.norm(rows, axis=0)
    target = np.array([0.0, 0.0, 0.0, 1.0])
    shares = nonnegative_least_squares(rows / sizes, target, DEPENDENT)[0] / sizes
    net = float(np.linalg.norm(force @ shares))
    return net / float(torque @ shares) if net > ROUNDING * effort @ shares else 0.0


def _rays(
    torques: Float[np.ndarray, "3 k"],
    forces: Float[np.ndarray, "3 k"],
    direction: Float[np.ndarray, "3"],
    tolerance: float,
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "3 n"], Float[np.ndarray, " n"]]:
    """Return torque, force and sum of |λ f| of the rays of the λ ≥ 0 without torque across.

    A ray has three thrusters at most, with shares that are the areas between the torques of the
    other two across. Two axes beside the thrusters complete rays of fewer.
    """
    turns, pushes = np.linalg.norm(torques, axis=0), np.linalg.norm(forces, axis=0)
    scale, count = np.where(turns > 0, turns, np.where(pushes > 0, pushes, 1.0)), len(turns)
    along = direction @ torques / scale
    along[np.abs(along) <= tolerance] = 0.0
    columns = np.pad(np.concatenate([along[None], forces / scale]), ((0, 0), (0, 2)))
    across = np.column_stack([complement(direction[:, None]).T @ torques / scale, np.eye(2)])
    triples = np.array(list(itertools.combinations(range(count + 2), 3))).T
    (x, y), one, other = across[:, triples], [1, 2, 0], [2, 0, 1]
    shares, length = x[one] * y[other] - y[one] * x[other], np.hypot(x, y)
    error = length[one] + length[other]
    shares = np.where(np.abs(shares) > tolerance * error, shares, 0.0)
    shares = np.where(np.any(shares < 0, axis=0), -shares, shares)
    rays = np.all(shares >= 0, axis=0) & np.any(shares > 0, axis=0)
    rays &= ~np.any((triples >= count) & (shares > 0), axis=0)
    shares, error, parts = shares[:, rays], error[:, rays], columns[:, triples[:, rays]]
    torque, force = np.sum(parts[0] * shares, axis=0), np.sum(parts[1:] * shares, axis=1)
    sizes = np.linalg.norm(parts[1:], axis=0)
    torque[np.abs(torque) <= ROUNDING * np.sum(error, axis=0)] = 0.0
    force[:, np.linalg.norm(force, axis=0) <= ROUNDING * np.sum(sizes * error, axis=0)] = 0.0
    some = (torque != 0) | np.any(force != 0, axis=0)
    return torque[some], force[:, some], np.sum(sizes * shares, axis=0)[some]


def net_force_words(force: NetForce | None) -> str | None:
    """Return the net force of a torque, or couples, as text; None if the forces are unknown."""
    if force is None:
        return None
    if force.couples:
        return "Net force: zero, couples make every torque"
    worst = int(np.argmax(force.ratios))
    pure = int(np.sum(force.ratios == 0))
    return (
        f"Net force: at least {force.ratios[worst]:.3g} N for each N m of torque along "
        f"{direction_words(force.directions[:, worst])} (as much linear impulse, N s, for each "
        f"N m s); {pure} of {len(force.ratios)} examined directions are couples"
    )
