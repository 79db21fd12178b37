"""Net force of a torque: zero for couples, while other thrusters also push the body."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.actuators import ActuatorSet
from jaxsat.controllability.cone import (
    TorqueCone,
    direction_words,
    nonnegative_least_squares,
    unit_rays,
)

COUPLE = 1e-7
"""Tolerance on the least net force, relative to the forces that make the torque."""

_WEIGHT = 1e5  # of torque over force, in units of the shortest lever


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

    `cone` is that of the thrusters alone. Non-negative least squares give the thrusts of least net
    force for each direction.
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
    ratios = [_least(torques, forces, direction) for direction in directions.T]
    return NetForce(directions, np.array(ratios))


def _least(
    torques: Float[np.ndarray, "3 k"],
    forces: Float[np.ndarray, "3 k"],
    direction: Float[np.ndarray, "3"],
) -> float:
    """Return the least |Σ λ f| for Σ λ τ = direction, λ ≥ 0, with torque-free thrusters too."""
    pushes = np.linalg.norm(forces, axis=0)
    turns = np.linalg.norm(torques, axis=0)
    size = np.where(turns > 0, turns, 1.0)
    lever = max(float(np.max(pushes / size, where=turns > 0, initial=0.0)), 1e-300)
    scale = np.where(turns > 0, 1.0 / size, 1.0 / np.where(pushes > 0, pushes, 1.0) * lever)
    rows = np.concatenate([_WEIGHT * torques * scale, forces * scale / lever])
    target = np.concatenate([_WEIGHT * direction, np.zeros(3)])
    shares, _ = nonnegative_least_squares(rows, target)
    net = float(np.linalg.norm(rows[3:] @ shares))
    effort = float(np.sum(np.linalg.norm(rows[3:], axis=0) * shares))
    return net * lever if net > COUPLE * effort else 0.0


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
