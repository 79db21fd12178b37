"""Linear controllability about the equilibrium in the orbit frame, and its time scales.

State (δθ, δω): small rotation from the orbit frame (rad, body axes) and rate error (rad/s), with
the exact orbit term in (11). At ω0 = 0 each thruster moves its own axis only; the orbit rate
couples roll and yaw through the gyroscopic torque of the orbital rotation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.layout import TOLERANCE, Numbers, make_layout
from jaxsat.core.errors import JaxsatError


class NoEquilibriumError(JaxsatError, ValueError):
    """The orbit frame is no equilibrium: the body y axis is not a principal axis."""


def skew(x: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the cross-product matrix of x: skew(x) @ y = x × y."""
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def lvlh_linearisation(
    inertia: Numbers, torque_axes: Numbers, orbit_rate: float | int
) -> tuple[Float[np.ndarray, "6 6"], Float[np.ndarray, "6 m"]]:
    """Return A and B of d(δθ, δω)/dt = A (δθ, δω) + B u about R = I, ω = (0, −ω0, 0).

    `inertia` (3,) or (3, 3) in kg m², `torque_axes` (3, m) in N m per unit command, `orbit_rate` in
    rad/s. With ω_r = ω − Rω_e and R ≈ I − skew(δθ): δθ̇ = δω + skew(δθ)ω_e = δω − ω_e × δθ, and
    δω̇ = J⁻¹(skew(Jω_e) − skew(ω_e)J) δω. No gravity gradient (the paper has none).
    Raises NoEquilibriumError (a ValueError) unless the body y axis is a principal axis.
    """
    layout = make_layout(inertia, torque_axes)
    matrix = layout.inertia
    if not np.isfinite(orbit_rate):
        raise ValueError(f"Argument `orbit_rate` must be finite, but got {orbit_rate}")
    scale = np.max(np.abs(matrix))
    if orbit_rate and max(abs(matrix[0, 1]), abs(matrix[2, 1])) > 1e-9 * scale:
        raise NoEquilibriumError(
            "Argument `inertia` must have the body y axis as a principal axis for an equilibrium "
            f"in the orbit frame, but got products {matrix[0, 1]} and {matrix[1, 2]}"
        )
    torque = np.linalg.solve(matrix, layout.torque_axes)
    return orbital_motion(matrix, orbit_rate), np.concatenate([np.zeros_like(torque), torque])


def orbital_motion(
    inertia: Float[np.ndarray, "3 3"], orbit_rate: float | int
) -> Float[np.ndarray, "6 6"]:
    """Return A of `lvlh_linearisation`, also of a body that a constant torque holds there."""
    orbital = np.array([0.0, -float(orbit_rate), 0.0])
    state = np.zeros((6, 6))
    state[:3, :3] = -skew(orbital)
    state[:3, 3:] = np.eye(3)
    state[3:, 3:] = np.linalg.solve(inertia, skew(inertia @ orbital) - skew(orbital) @ inertia)
    return state


@dataclass(frozen=True, eq=False)
class LinearControllability:
    """Rank of the linear system, its margin and its matrices.

    `margin` is the least singular value of [A − λI, B] over the eigenvalues λ (Popov-Belevitch-
    Hautus), in units of time 1/ω0 with unit columns of J B/|J|: zero if not controllable.
    `borderline`: the deciding value is between round-off and `tolerance`.
    """

    rank: int
    controllable: bool
    borderline: bool
    margin: float
    state_matrix: Float[np.ndarray, "6 6"]
    input_matrix: Float[np.ndarray, "6 m"]


def linear_controllability(
    inertia: Numbers,
    torque_axes: Numbers,
    orbit_rate: float | int,
    *,
    tolerance: float | int = TOLERANCE,
) -> LinearControllability:
    """Analyse linear controllability about the orbit frame.

    Thrusters on x and y have rank 6 for ω0 ≠ 0 and J1 ≠ J2, rank 5 for J1 = J2, rank 4 for ω0 = 0.
    `inertia` (3,) or (3, 3) in kg m², `torque_axes` (3, m), `orbit_rate` in rad/s. Sufficient for
    controllability close to the equilibrium, not necessary: the nonlinear rank can be 6 where this
    one is not. Raises ValueError as `lvlh_linearisation`.
    """
    state, inputs = lvlh_linearisation(inertia, torque_axes, orbit_rate)
    layout = make_layout(inertia, torque_axes)
    rate = abs(float(orbit_rate)) or 1.0
    # Time in 1/ω0: rates divided by ω0; each command scaled to a unit column.
    matrix = np.diag([1.0] * 3 + [1.0 / rate] * 3) @ state @ np.diag([1.0] * 3 + [rate] * 3) / rate
    lengths = np.linalg.norm(inputs, axis=0)
    unit = inputs[:, lengths > 0] / lengths[lengths > 0]
    rank, smallest = reachable_rank(matrix, unit, layout.rounding)
    eigenvalues = np.linalg.eigvals(matrix)
    margins = [
        np.linalg.svd(np.concatenate([matrix - value * np.eye(6), unit], axis=1))[1][5]
        for value in eigenvalues
    ]
    limit = max(tolerance, layout.rounding)
    return LinearControllability(
        rank=rank,
        controllable=rank == 6,
        borderline=bool(smallest <= limit),
        margin=float(min(margins)) if rank == 6 else 0.0,
        state_matrix=state,
        input_matrix=inputs,
    )


def reachable_rank(
    a: Float[np.ndarray, "n n"], b: Float[np.ndarray, "n m"], noise: float
) -> tuple[int, float]:
    """Return the dimension of the controllable subspace of x' = A x + B u, and the length of the
    shortest new direction in it.

    An orthonormal basis is grown by A; a new direction counts if it is longer than `noise`. More
    robust than the rank of [B AB A²B ...], whose columns differ by many powers of ten.
    """
    basis, shortest = np.zeros((a.shape[0], 0)), np.inf
    front = b
    while front.size and basis.shape[1] < a.shape[0]:
        for _ in range(2):  # twice suffices for orthogonality to round-off
            front = front - basis @ (basis.T @ front)
        directions, lengths, _ = np.linalg.svd(front, full_matrices=False)
        independent = lengths > noise
        shortest = min(shortest, float(np.min(lengths[independent], initial=np.inf)))
        new = directions[:, independent]
        basis = np.hstack([basis, new])
        front = a @ new
    return basis.shape[1], shortest


def _exponentials(matrices: Float[np.ndarray, "k n n"]) -> Float[np.ndarray, "k n n"]:
    """Return exponentials of small matrices at once: Taylor's polynomial, scaled and squared."""
    largest = np.max(np.sum(np.abs(matrices), axis=1), initial=0.5)
    squarings = int(np.ceil(np.log2(largest / 0.5)))
    scaled_matrices, one = matrices / 2.0**squarings, np.eye(matrices.shape[1])
    power = one + scaled_matrices / 16.0
    for order in range(15, 0, -1):  # the remainder is below 0.5^17 / 17! = 2e-20
        power = one + scaled_matrices @ power / order
    for _ in range(squarings):
        power = power @ power
    return power


def gramian_time_scales(
    linear: LinearControllability,
    *,
    errors: Sequence[float] = (0.0175, 0.0175, 0.0175, 1e-3, 1e-3, 1e-3),
    rms_command: float | int = 1.0,
    longest: float | int = 1e6,
) -> Float[np.ndarray, "6"]:
    """Compute the time (s) to remove each single error with this root-mean-square command.

    `errors`: angles (rad) and rates (rad/s) about body x, y, z, removed one at a time by the
    least-energy command, all six states zero at the end; `rms_command` in the units of the torque
    axes (N m for unit axes). The times come from a grid with steps of 10 %; NaN where more than
    `longest` seconds are needed or the error cannot be removed at all. Pitch responds in seconds;
    roll and yaw, which only the orbit rate couples, take minutes.
    """
    times = np.full(6, np.nan)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    for horizon in np.geomspace(1e-2, longest, 200):
        # Time in units of the horizon keeps all entries near one.
        stretch = np.array([1.0] * 3 + [horizon] * 3)
        state = stretch[:, None] * linear.state_matrix / stretch * horizon
        if np.linalg.norm(state, 1) > 100.0:
            break  # many revolutions: 64 nodes no longer resolve them
        inputs = stretch[:, None] * linear.input_matrix * horizon
        # A factor of the Gramian: its singular values are not squared.
        parts = _exponentials(-0.5 * (nodes[:, None, None] + 1.0) * state) @ inputs
        factor = np.concatenate(list(np.sqrt(0.5 * weights)[:, None, None] * parts), axis=1)
        directions, values, _ = np.linalg.svd(factor, full_matrices=False)
        solid = values > 1e-13 * values[:1]
        for k in (int(k) for k in np.flatnonzero(np.isnan(times))):
            parts = directions[k] * (stretch[k] * errors[k])
            if np.linalg.norm(parts[~solid]) > 1e-11 * np.linalg.norm(parts):
                continue
            if np.sum((parts[solid] / values[solid]) ** 2) <= rms_command**2:
                times[k] = horizon
    return times
