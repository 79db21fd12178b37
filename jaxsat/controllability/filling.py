"""Momentum that wheels must hold at a target while others take out what they can.

Along the flight E, the momentum beyond what rest at the target requires, follows a path in the axes
of the target, which turn. Whatever thrusters and magnetorquers add to it, wheels hold the sum. A
linear programme finds the least part of their capacity that is enough.
"""

import numpy as np
from jaxtyping import Float
from scipy.sparse import block_diag, csr_array, eye_array, hstack, kron, vstack

from jaxsat.controllability.programme import OPTIMAL, solve

SAME_AXIS = 1e-6
"""Singular value of unit axes below which wheels make no torque along a direction."""


def least_load(
    path: Float[np.ndarray, "instants 3"],
    turn: Float[np.ndarray, "3 3"],
    axes: Float[np.ndarray, "3 m"],
    capacity: Float[np.ndarray, " m"],
    impulses: Float[np.ndarray, "steps 3 n"],
    low: Float[np.ndarray, " n"],
    high: Float[np.ndarray, " n"],
) -> float:
    """Return the least part of a finite `capacity` (N m s) that wheels along unit `axes` need.

    `path` (N m s) is E without the others. In a step the target turns so that a constant vector is
    moved by `turn`, and each other device adds its column of `impulses` (N m s) times a use between
    `low` and `high`, known ahead. What wheels cannot hold at first may be taken out at once.
    Infinite where no use holds the path. Raises `UnsolvedProgramme` as `solve` does.
    """
    (instants, _), wheels, unit = path.shape, axes.shape[1], float(capacity.max())
    directions, sizes, _ = np.linalg.svd(axes)
    missing = directions[:, int(np.sum(sizes > SAME_AXIS)) :]
    shifted = kron(eye_array(instants, k=-1), turn)
    onwards = csr_array(eye_array(3 * instants) - shifted)
    stores = csr_array(onwards @ kron(eye_array(instants), axes))
    dipoles = csr_array(block_diag([np.zeros((3, 0)), *(impulses / unit)]))
    at_first = np.zeros((3 * instants, missing.shape[1] + 1))
    at_first[:3, :-1] = missing
    count, steps = wheels * (instants - 1), len(low) * (instants - 1)
    later = hstack([csr_array((count, wheels)), eye_array(count)])
    none = csr_array((count, steps + missing.shape[1]))
    full = csr_array(-np.tile(capacity / unit, instants - 1)[:, None])
    uses = np.tile(np.stack([low, high], axis=1), (instants - 1, 1))
    free = np.array([[-np.inf, np.inf]])
    solution = solve(
        np.append(np.zeros(wheels * instants + steps + missing.shape[1]), 1.0),
        A_ub=vstack([hstack([later, none, full]), hstack([-later, none, full])]),
        b_ub=np.zeros(2 * count),
        A_eq=hstack([stores, -dipoles, at_first]),
        b_eq=onwards @ path.reshape(-1) / unit,
        bounds=np.concatenate(
            [
                free.repeat(wheels * instants, axis=0),
                uses,
                free.repeat(missing.shape[1], axis=0),
                [[0.0, np.inf]],
            ]
        ),
    )
    return float(solution.fun) if solution.status == OPTIMAL else np.inf
