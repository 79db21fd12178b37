"""Reaction wheels on their momentum level set.

Wheels with the axes A turn the body by taking up momentum: J dω/dt = −ω × (Jω + A h) + A u,
dh/dt = −u. Here J is the inertia without the rotors about their axes, and h the momentum of each
rotor that its motor alone changes, J_w (Ω + a·ω); with the wheels locked, and relative to the body,
their sum Jω + A h is the same. Without external torque this total H is constant in inertial axes:
every n perpendicular to all wheels has n·Jω = n·CH for ever, C the attitude. So states are counted
on the level set of that momentum:

- three independent axes: attitude and rate, 6 dimensions, all within reach;
- two: n·Jω = n·CH leaves 5 dimensions. The two rates ω with n·Jω = 0 are driven directly and their
  vector product is along Jn, which is not among them: two fields and their bracket turn the body
  about every axis (Chow), whatever the drift. With H = 0 every attitude can be held; otherwise
  only those with n·CH = 0 are at rest;
- one, along a: Jω + a h = CH leaves 4. With H = 0 the body turns about J⁻¹a alone.

A wheel with a dead motor coasts: its momentum stays, and β, the sum of these along their axes, is
a momentum fixed in the body. CH − β replaces CH, so rest needs n·CH = n·β with two wheels and
CH − β along a with one, which no attitude satisfies where β is too large beside H.

A wheel beside thrusters changes the rate but not the momentum Jω + A h, so its brackets are not
those of a thruster along its axis: `one_wheel_brackets`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.actuators import MOMENTUM_ROUNDING, ActuatorSet
from jaxsat.controllability.layout import TOLERANCE

_LEVEL = 1e-9  # threshold on singular values of unit columns


@dataclass(frozen=True, eq=False)
class MomentumLevelSet:
    """Authority of wheels alone at the given momentum.

    - `directions`: orthonormal basis of the wheel torques (body axes); `missing` that of the rest.
    - `margin`: smallest counted singular value of the unit wheel axes.
    - `momentum`: size of the total momentum, N m s, zero if round-off.
    - `coasting`: momentum of coasting wheels across the wheels' axes, N m s, zero if round-off.
    - `rank`, `dimension`: directions in the level set that wheels and drift reach, and all of it.
    - `turned_about`: the unit vector J⁻¹a of one wheel without momentum, else None.
    """

    directions: Float[np.ndarray, "3 d"]
    missing: Float[np.ndarray, "3 e"]
    margin: float
    borderline: bool
    momentum: float
    coasting: float
    rank: int
    dimension: int
    turned_about: Float[np.ndarray, "3"] | None

    @property
    def axes(self) -> int:
        """Number of independent wheel axes."""
        return self.directions.shape[1]

    @property
    def rests(self) -> bool:
        """Whether there are attitudes at which the body may be at rest."""
        return self.coasting <= self.momentum * (1 + _LEVEL)


def momentum_level_set(
    inertia: Float[np.ndarray, "3 3"], actuators: ActuatorSet, tolerance: float = TOLERANCE
) -> MomentumLevelSet:
    """Judge the wheels of `actuators` on the level set of their momentum, thrusters off."""
    lengths = np.linalg.norm(actuators.wheel_axes, axis=0)
    unit = actuators.wheel_axes[:, lengths > 0] / lengths[lengths > 0]
    directions, values, _ = np.linalg.svd(unit, full_matrices=True)
    count = int(np.sum(values > tolerance))
    momentum = float(np.linalg.norm(actuators.momentum))
    coasting = float(np.linalg.norm(actuators.coasting))
    nothing = MOMENTUM_ROUNDING * (momentum + coasting + np.abs(actuators.stored).sum())
    momentum = momentum if momentum > nothing else 0.0
    across = float(np.linalg.norm(directions[:, count:].T @ actuators.coasting))
    across = across if across > nothing else 0.0
    rank, turned_about = (0, 2, 5, 6)[count], None
    if count == 1:
        turn = np.linalg.solve(inertia / np.max(np.abs(inertia)), directions[:, 0])
        turned_about = turn / np.linalg.norm(turn)
        if momentum or across:
            turned_about = None
            rank = _one_wheel_rank(inertia, directions[:, 0], bool(momentum), actuators.coasting)
    return MomentumLevelSet(
        directions=directions[:, :count],
        missing=directions[:, count:],
        margin=float(values[count - 1]) if count else 0.0,
        borderline=bool(np.any((values > _LEVEL) & (values <= tolerance))),
        momentum=momentum,
        coasting=across,
        rank=rank,
        dimension=3 + count,
        turned_about=turned_about,
    )


def _one_wheel_rank(
    inertia: Float[np.ndarray, "3 3"],
    axis: Float[np.ndarray, "3"],
    momentum_left: bool,
    coasting: Float[np.ndarray, "3"],
) -> int:
    """Return the rank, of 4, at generic attitudes of one wheel with momentum P in body axes.

    With b = J⁻¹a, [g, f] is the rotation −b, [b, f] = c = b × ω − J⁻¹(b × P) and
    [b, c] = b × c + c' at b × (b × P) in place of P, in body rates; c does not depend on h, and
    c' is c without the part of the momentum β of `coasting` wheels, which is fixed in the body.
    """
    inverse = np.linalg.inv(inertia / np.max(np.abs(inertia)))
    b = inverse @ axis

    def bracket(momentum):
        return np.cross(b, inverse @ momentum) - inverse @ np.cross(b, momentum)

    momentum = np.array([0.6180, -0.5291, 0.8437]) * momentum_left
    size = float(np.linalg.norm(coasting))
    fixed = coasting / (size or 1.0)
    c = bracket(momentum) - np.cross(b, inverse @ fixed)
    d = np.cross(b, c) - bracket(np.cross(b, momentum))
    size = float(np.linalg.norm(b))
    columns = np.stack([b / size, c / size, d / size**2], axis=1)
    return 1 + int(np.sum(np.linalg.svd(columns, compute_uv=False) > 1e-6))


def one_wheel_brackets(
    inertia: Float[np.ndarray, "3 3"],
    torques: Float[np.ndarray, "3 m"],
    axis: Float[np.ndarray, "3"],
    tolerance: float = TOLERANCE,
) -> tuple[Float[np.ndarray, "3 d"], float]:
    """Return torque directions that brackets reach at rest with one wheel, and the margin.

    `torques` of thrusters count as of both signs. A direction is a pair: the torque Jx on the body
    and the momentum p, which is the same for a thruster and zero for the wheel. From two of them
    [[f, x], y] makes the torque −(x × p_y + y × p_x), with as much momentum. The closure has four
    dimensions at most. Products smaller than `tolerance` beside their terms are zero; the margin is
    the smallest singular value of the unit torques.
    """
    inverse = np.linalg.inv(inertia / np.max(np.abs(inertia)))
    lengths = np.linalg.norm(torques, axis=0)
    pairs = [np.concatenate([axis / np.linalg.norm(axis), np.zeros(3)])]
    pairs += [np.tile(column, 2) for column in (torques[:, lengths > 0] / lengths[lengths > 0]).T]
    basis = _independent(pairs, tolerance)
    while True:
        products = []
        for i, first in enumerate(basis):
            for second in basis[i:]:
                x, y = inverse @ first[:3], inverse @ second[:3]
                torque = -np.cross(x, second[3:]) - np.cross(y, first[3:])
                size = np.linalg.norm(x) * np.linalg.norm(second[3:])
                size += np.linalg.norm(y) * np.linalg.norm(first[3:])
                if np.linalg.norm(torque) > tolerance * size:
                    products.append(np.tile(torque / np.linalg.norm(torque), 2))
        larger_basis = _independent([*basis, *products], tolerance)
        if len(larger_basis) == len(basis):
            break
        basis = larger_basis
    directions, values, _ = np.linalg.svd(np.stack(basis, axis=1)[:3])
    count = int(np.sum(values > tolerance))
    return directions[:, :count], float(values[2]) if count == 3 else 0.0


def _independent(
    vectors: list[Float[np.ndarray, "6"]], tolerance: float
) -> list[Float[np.ndarray, "6"]]:
    """Return the first of the vectors that span all of them, to a sine of `tolerance`."""
    members: list[Float[np.ndarray, 6]] = []
    for vector in vectors:
        rest = vector
        if members:
            basis = np.linalg.qr(np.stack(members, axis=1))[0]
            rest = vector - basis @ (basis.T @ vector)
        if np.linalg.norm(rest) > tolerance * np.linalg.norm(vector):
            members.append(vector)
    return members
