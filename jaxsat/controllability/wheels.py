"""Reaction wheels on their momentum level set.

Wheels with the axes A turn the body by taking up momentum: J dω/dt = −ω × (Jω + A h) + A u,
dh/dt = −u, J with the wheels locked. Without external torque the total H = Jω + A h is constant in
inertial axes: every n perpendicular to all wheels has n·Jω = n·CH for ever, C the attitude. So
states are counted, and judged, on the level set of that momentum:

- three independent axes: attitude and rate, 6 dimensions, all within reach;
- two: n·Jω = n·CH leaves 5 dimensions. The two rates ω with n·Jω = 0 are driven directly and their
  vector product is along Jn, which is not among them: two fields and their bracket turn the body
  about every axis (Chow), whatever the drift. With H = 0 every attitude is held; with H left only
  those with n·CH = 0 are at rest;
- one, along a: Jω + a h = CH leaves 4. With H = 0 the body turns about J⁻¹a alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.actuators import ActuatorSet
from jaxsat.controllability.layout import TOLERANCE

MOMENTUM_ROUNDING = 1e-12
"""Total momentum, N m s, that counts as none."""

_LEVEL = 1e-9  # a singular value of unit columns below this is zero


@dataclass(frozen=True, eq=False)
class MomentumLevelSet:
    """What wheels alone can do with the momentum there is.

    - `directions`: orthonormal basis of the wheel torques (body axes); `missing` that of the rest.
    - `margin`: smallest of the singular values of the unit wheel axes that were counted.
    - `momentum`: size of the total momentum, N m s, zero if rounding.
    - `rank`, `dimension`: directions in the level set that wheels and drift reach, and all it has.
    - `turned_about`: the unit vector J⁻¹a of one wheel without momentum, else None.
    """

    directions: Float[np.ndarray, "3 d"]
    missing: Float[np.ndarray, "3 e"]
    margin: float
    borderline: bool
    momentum: float
    rank: int
    dimension: int
    turned_about: Float[np.ndarray, "3"] | None

    @property
    def axes(self) -> int:
        """Number of independent wheel axes."""
        return self.directions.shape[1]


def momentum_level_set(
    inertia: Float[np.ndarray, "3 3"], actuators: ActuatorSet, tolerance: float = TOLERANCE
) -> MomentumLevelSet:
    """Judge the wheels of `actuators` on the level set of their momentum, thrusters off."""
    lengths = np.linalg.norm(actuators.wheel_axes, axis=0)
    unit = actuators.wheel_axes[:, lengths > 0] / lengths[lengths > 0]
    directions, values, _ = np.linalg.svd(unit, full_matrices=True)
    count = int(np.sum(values > tolerance))
    momentum = float(np.linalg.norm(actuators.momentum))
    momentum = momentum if momentum > MOMENTUM_ROUNDING else 0.0
    rank, turned_about = (0, 2, 5, 6)[count], None
    if count == 1:
        turn = np.linalg.solve(inertia / np.max(np.abs(inertia)), directions[:, 0])
        turned_about = turn / np.linalg.norm(turn)
        if momentum:
            rank, turned_about = _one_wheel_rank(inertia, directions[:, 0]), None
    return MomentumLevelSet(
        directions=directions[:, :count],
        missing=directions[:, count:],
        margin=float(values[count - 1]) if count else 0.0,
        borderline=bool(np.any((values > _LEVEL) & (values <= tolerance))),
        momentum=momentum,
        rank=rank,
        dimension=3 + count,
        turned_about=turned_about,
    )


def _one_wheel_rank(inertia: Float[np.ndarray, "3 3"], axis: Float[np.ndarray, "3"]) -> int:
    """Rank, of 4, at attitudes in no special position of one wheel with momentum P in body axes.

    With b = J⁻¹a, [g, f] is the rotation −b, [b, f] = c = b × ω − J⁻¹(b × P) and
    [b, c] = b × c + c at b × (b × P) in place of P, in body rates; c does not depend on h.
    """
    inverse = np.linalg.inv(inertia / np.max(np.abs(inertia)))
    b = inverse @ axis

    def bracket(momentum):
        return np.cross(b, inverse @ momentum) - inverse @ np.cross(b, momentum)

    momentum = np.array([0.6180, -0.5291, 0.8437])
    c = bracket(momentum)
    d = np.cross(b, c) - bracket(np.cross(b, momentum))
    size = float(np.linalg.norm(b))
    columns = np.stack([b / size, c / size, d / size**2], axis=1)
    return 1 + int(np.sum(np.linalg.svd(columns, compute_uv=False) > 1e-6))
