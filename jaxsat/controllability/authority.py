"""How quickly a layout can turn the body about the axis that is hardest to reach.

The margin is a matter of directions alone: for the paper's layout it is |J1 - J2| / (J1 + J2) for
any J3. The turn time knows the inertia. From rest, constant torques u make the rates

    ω = w t + ⟨w:w⟩ t³/6 + ⟨w:⟨w:w⟩⟩ t⁵/30 + …,    w = J⁻¹ Σ u_i g_i,

because dω/dt = w + ½⟨ω:ω⟩. So each bracket of the generating list turns the body by an angle that
grows with a power of the time; the turn time is when these angles span a radian in every direction.
"""

import itertools

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.decision import RankDecision

HALVINGS = 60

LARGEST = 200.0
"""Logarithm of the largest angle that is told apart from larger ones."""


def turn_time(
    inertia: Float[np.ndarray, "3 3"], torque_axes: Float[np.ndarray, "3 m"], torque: float = 1.0
) -> float:
    """The time (s) to turn by one radian about the axis hardest to reach, from rest.

    `inertia` in kg m²; `torque_axes` have any lengths, each thruster makes up to `torque` (N m) of
    either sign about its own. It is the least t at which the angles that single brackets make,
    leading order in t, have no singular value below 1 rad; the other axes need not come to rest, so
    a manoeuvre takes longer. It falls as 1/√torque. Infinite where the brackets do not span.

    For principal axes and thrusters along x and y, with T the torque, it is the larger of
    √(2 max(J1, J2) / T) and (12 J1 J2 J3 / (|J1 - J2| T²))^¼. NaN where moments are so far apart
    that the brackets are beyond the range of numbers.
    """
    scale = float(np.max(np.abs(inertia)))
    with np.errstate(over="ignore", invalid="ignore"):
        accelerations, powers = _columns(inertia / scale, torque_axes)
        sizes = np.linalg.norm(accelerations, axis=0)
    if not np.isfinite(sizes).all():
        return np.nan
    accelerations, powers, sizes = (part[..., sizes > 0] for part in (accelerations, powers, sizes))
    if np.linalg.matrix_rank(accelerations) < 3:
        return np.inf

    def least(logarithm: float) -> float:
        grown = np.minimum(np.log(sizes) + powers * logarithm, LARGEST)
        return float(np.linalg.svd(accelerations / sizes * np.exp(grown), compute_uv=False)[-1])

    low, high = -2.0, 2.0
    while least(low) > 1:
        low -= 4.0
    while least(high) < 1 and high < 300:
        high += 4.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if least(middle) < 1 else (low, middle)
    return float(np.exp(high) * np.sqrt(scale / torque))


def decided_turn_time(
    decision: RankDecision, inertia: Float[np.ndarray, "3 3"], torque_axes: Float[np.ndarray, "3 m"]
) -> float:
    """The turn time (s) at 1 N m of a layout of rank 6, infinite for any other."""
    return turn_time(inertia, torque_axes) if decision.controllable else np.inf


def _columns(
    inertia: Float[np.ndarray, "3 3"], torque_axes: Float[np.ndarray, "3 m"]
) -> tuple[Float[np.ndarray, "3 k"], Float[np.ndarray, " k"]]:
    """Angles (rad) after one unit of time, and the powers of time with which they grow."""
    largest = np.abs(torque_axes).max(axis=0, initial=0.0)
    axes = torque_axes[:, largest > 0] / largest[largest > 0]
    axes = axes / np.linalg.norm(axes, axis=0)
    directions = np.linalg.solve(inertia, axes).T

    def product(x, y):  # ⟨x:y⟩
        return -np.linalg.solve(inertia, np.cross(x, inertia @ y) + np.cross(y, inertia @ x))

    found = [(v / 2, 2) for v in directions]
    found += [(product(v, w) / 12, 4) for v, w in itertools.combinations(directions, 2)]
    for v in directions:
        h = product(v, v)
        found += [(h / 24, 4), (product(v, h) / 180, 6), (product(h, h) / 4032, 8)]
    if not found:
        return np.zeros((3, 0)), np.zeros(0)
    columns, powers = zip(*found, strict=True)
    return np.stack(columns, axis=1), np.array(powers, float)
