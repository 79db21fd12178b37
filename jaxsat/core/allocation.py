"""Allocation of a torque to thrusters in plain NumPy: equation (5), one-sided thrusters."""

import itertools

import numpy as np
from jaxtyping import Float

NORMALISER_FLOOR = 1e-9
"""Threshold for unit columns below which the denominator of (5) or (8) is zero."""

LEFT_BY_ROUNDING = 1e-12
"""Part of a command, relative to it, below which it is round-off."""


BASIS_TOLERANCE = 1e-9
"""Tolerance relative to the largest torque, below which a size is zero."""


def unit_columns(torque_axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 m"]:
    """Return torque axes scaled to unit length; raises `ValueError` for a zero column."""
    lengths = np.sqrt(np.sum(torque_axes**2, axis=0, keepdims=True))
    if not np.all(lengths > 0):
        raise ValueError("Argument `torque_axes` must have no zero column, but one is zero.")
    return torque_axes / lengths


def least_squares_map(
    axes: Float[np.ndarray, "3 m"],
    torques: int,
    limits: Float[np.ndarray, " m"] | None = None,
    directions: Float[np.ndarray, "3 torques"] | None = None,
) -> Float[np.ndarray, "m torques"]:
    """Compute actuator torques along unit `axes` per unit of each command, by least squares.

    Commands are about the first body axes, or about `directions` in the plane of the actuators. Of
    a command that the actuators cannot make, they make the nearest torque. The squares are of use
    over limit; without `limits` all actuators have equal weight. Two actuators under two torques
    make these exactly, and about z the dependent torque of equation (5).
    """
    if not axes.size:
        return np.zeros((axes.shape[1], torques))
    relative_limits = np.ones(axes.shape[1]) if limits is None else finite_limits(limits)
    scaled = axes * relative_limits
    if directions is not None and np.any(directions != np.eye(3)[:, :torques]):
        return relative_limits[:, None] * direction_matrix(scaled, directions)
    try:
        return relative_limits[:, None] * allocation_matrix(scaled, torques)
    except ValueError:
        return relative_limits[:, None] * np.linalg.pinv(scaled)[:, :torques]


def finite_limits(limits: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
    """Return limits over the largest finite one, as which infinite ones count; all 1 if none is."""
    finite = np.where(np.isfinite(limits), limits, 0.0)
    most = finite.max(initial=0.0)
    return np.where(np.isfinite(limits), finite / most, 1.0) if most > 0 else np.ones_like(finite)


def unmade_map(
    axes: Float[np.ndarray, "3 m"],
    shares: Float[np.ndarray, "m torques"],
    directions: Float[np.ndarray, "3 torques"] | None = None,
) -> Float[np.ndarray, "torques torques"]:
    """Return the part of a command that actuators along unit `axes` with these shares do not make.

    `directions` are those of `least_squares_map`.
    """
    torques = shares.shape[1]
    along = np.eye(3)[:, :torques] if directions is None else directions
    remainder = np.eye(torques) - along.T @ (axes @ shares)
    return np.where(np.abs(remainder) < LEFT_BY_ROUNDING, 0.0, remainder)


def allocation_matrix(
    torque_axes: Float[np.ndarray, "3 m"], torques: int = 2
) -> Float[np.ndarray, "m torques"]:
    """Compute thrusts for a unit torque about each of the first two body axes, or of all three.

    `torque_axes` has a unit column for each thruster. With two torques and coplanar thrusters, the
    third torque is b1 u1 + b2 u2, equation (5); otherwise it is zero. One torque is about the
    `torque_axis`. Raises `ValueError` where the thrusters cannot make the torques independently.
    """
    if torques == 1:
        return np.linalg.pinv(torque_axes) @ torque_axis(torque_axes)[:, None]
    count = torque_axes.shape[1]
    rank = np.linalg.matrix_rank(torque_axes, tol=NORMALISER_FLOOR)
    rows = torque_axes
    if torques == rank == 2:
        rows = torque_axes[:2]
        rank = np.linalg.matrix_rank(rows, tol=NORMALISER_FLOOR)
    if rank < rows.shape[0] or count < torques:
        which = "x and y" if torques == 2 else "x, y and z"
        raise ValueError(
            f"The thrusters left must make independent torques about body axes {which}, "
            f"but their torque axes are the columns of {torque_axes.round(6).tolist()}."
        )
    return np.linalg.pinv(rows)[:, :torques]


def torque_axis(torque_axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3"]:
    """Return the unit vector of the thrusters' only torque axis, in the direction of the first.

    `torque_axes` has a column for each thruster. Raises `ValueError` for no thruster, or torques
    about more than one axis.
    """
    if not torque_axes.size or np.linalg.matrix_rank(torque_axes, tol=NORMALISER_FLOOR) != 1:
        raise ValueError(
            "The thrusters left must make torques about one axis alone, "
            f"but their torque axes are the columns of {torque_axes.round(6).tolist()}."
        )
    return unit_columns(torque_axes)[:, 0]


def torque_directions(torque_axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 2"]:
    """Compute two orthonormal directions about which the thrusters can make any torque.

    In the plane of the torques, nearest to body axes: x and y, y and z, or z and x where the normal
    of the plane is nearest to the third. For thrusters with torques about all three axes they are x
    and y. `torque_axes` has a unit column for each thruster. Raises `ValueError` for torques about
    one axis alone.
    """
    if np.linalg.matrix_rank(torque_axes, tol=NORMALISER_FLOOR) == 3:
        return np.eye(3)[:, :2]
    columns = torque_axes.T
    normals = np.array([np.cross(one, other) for one in columns for other in columns])
    lengths = np.sqrt(np.sum(normals**2, axis=-1))
    if not np.max(lengths, initial=0.0) > NORMALISER_FLOOR:
        raise ValueError(
            "The thrusters left must make torques about two independent axes, "
            f"but their torque axes are the columns of {torque_axes.round(6).tolist()}."
        )
    normal = normals[np.argmax(lengths)] / np.max(lengths)
    nearest = np.argmax(np.abs(normal))
    normal = normal * np.sign(normal[nearest])
    first = np.eye(3)[(nearest + 1) % 3]
    first = first - normal * (normal @ first)
    first = first / np.sqrt(first @ first)
    return np.stack([first, np.cross(normal, first)], axis=1)


def pushed_directions(torque: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 2"]:
    """Compute `torque_directions` of one-sided thrusters, torque columns in N m at full thrust.

    The torques are those possible in both signs, where they span a plane or more; else all.
    """
    both_ways = two_sided_torques(torque)
    plane = both_ways.size and len(_independent_rows(both_ways)) >= 2
    return torque_directions(unit_columns(both_ways if plane else torque))


def direction_matrix(
    torque_axes: Float[np.ndarray, "3 m"], directions: Float[np.ndarray, "3 torques"]
) -> Float[np.ndarray, "m torques"]:
    """Return thrusts for unit torques about `directions` of `torque_directions`."""
    return np.linalg.pinv(torque_axes) @ directions


def plane_map(
    torque: Float[np.ndarray, "3 m"], torques: int, any_plane: bool = False
) -> Float[np.ndarray, "3 torques"]:
    """Return the map from a command about the first two or all three body axes to a body torque.

    Where all torques are in one plane, two commanded torques imply the third that keeps to the
    plane; commands in `any_plane` are about `pushed_directions`, and one torque is about the
    `torque_axis`. Raises `ValueError` where the plane contains no such torques.
    """
    if torques == 3:
        return np.eye(3)
    if torques == 1:
        return torque_axis(torque)[:, None]
    if any_plane:
        return pushed_directions(torque)
    rows = _independent_rows(torque)
    if len(rows) != 2:
        return np.eye(3)[:, :2]
    upper = rows[:, :2].T
    if abs(np.linalg.det(upper)) < NORMALISER_FLOOR:
        normal = np.cross(rows[0], rows[1])
        raise ValueError(
            "The thrusters left must make independent torques about body axes x and y, but make "
            f"none along {(normal + 0.0).round(3).tolist()}."
        )
    return rows.T @ np.linalg.inv(upper)


def least_propellant(
    torque: Float[np.ndarray, "3 m"],
    cost: Float[np.ndarray, " m"],
    command_map: Float[np.ndarray, "3 torques"],
) -> Float[np.ndarray, "bases m torques"]:
    """Compute duties per unit of command for every basis that can be optimal.

    The duties d >= 0 of one-sided thrusters minimise costᵀd subject to B d = M u, with B = `torque`
    at full thrust (N m) and M = `command_map`, from a command to the torque on the body. The
    optimal basis depends on the direction of u alone, and gives no negative duty. Raises
    `ValueError`, which names a torque that cannot be made, where some u has no solution.
    """
    torque, cost = np.asarray(torque, float), np.asarray(cost, float)
    possible, optimal = _bases(torque, cost, command_map)
    _require_all_ways(possible, torque, command_map)
    return np.stack(_optimal_somewhere(optimal))


def require_all_ways(torque: Float[np.ndarray, "3 m"]) -> None:
    """Raise `ValueError`, which names a missing torque, unless columns of one-sided thrusters make
    all torques."""
    torque = np.asarray(torque, float)
    if not torque.shape[1]:
        raise ValueError("all have failed")
    possible, _ = _bases(torque, np.ones(torque.shape[1]), np.eye(3))
    _require_all_ways(possible, torque, np.eye(3))


def two_sided_torques(torque: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 k"]:
    """Return the columns, one-sided thrusters at full thrust (N m), whose opposite others can make.

    They span all torques that can be made in both signs.
    """
    torque = np.asarray(torque, float)
    if not torque.shape[1]:
        return torque
    possible, _ = _bases(torque, np.ones(torque.shape[1]), -torque)
    feasible = np.min(possible, axis=1) >= -BASIS_TOLERANCE
    return torque[:, np.any(feasible, axis=0)]


def _bases(
    torque: Float[np.ndarray, "3 m"],
    cost: Float[np.ndarray, " m"],
    command_map: Float[np.ndarray, "3 k"],
) -> tuple[Float[np.ndarray, "bases m k"], Float[np.ndarray, "optimal m k"]]:
    """Return duties per unit of command of all bases, and of those that can be optimal."""
    rows, count = _independent_rows(torque), torque.shape[1]
    columns, commands = rows @ torque, rows @ command_map
    price = np.maximum(cost / np.max(cost), BASIS_TOLERANCE)
    bases = np.array(list(itertools.combinations(range(count), len(rows))))
    squares = np.moveaxis(columns[:, bases], 1, 0)
    regular = np.abs(np.linalg.det(squares / _size(torque))) >= BASIS_TOLERANCE
    bases, squares = bases[regular], squares[regular]
    possible = np.zeros((len(bases), count, command_map.shape[1]))
    np.put_along_axis(possible, bases[:, :, None], np.linalg.solve(squares, commands), axis=1)
    dual = np.linalg.solve(np.swapaxes(squares, 1, 2), price[bases][:, :, None])[:, :, 0]
    optimal = dual @ columns <= price * (1 + BASIS_TOLERANCE) + BASIS_TOLERANCE
    return possible, possible[np.all(optimal, axis=1)]


def _size(torque: Float[np.ndarray, "r m"]) -> float:
    """Return the length of the largest column, N m."""
    return float(np.sqrt(np.sum(torque**2, axis=0)).max())


def _independent_rows(torque: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis, as rows, of the span of the torques."""
    left_vectors, sizes, _ = np.linalg.svd(torque)
    return left_vectors[:, : int(np.sum(sizes > BASIS_TOLERANCE * sizes[0]))].T


def _require_all_ways(possible: np.ndarray, torque: np.ndarray, command_map: np.ndarray) -> None:
    """Raise `ValueError` unless both ways along each commanded axis are combinations of columns.

    The torques of one-sided thrusters form a convex cone, each element of which is a combination of
    as many thrusters as a basis has (Carathéodory).
    """
    rows, size = _independent_rows(torque), _size(torque)
    for number, axis in enumerate(command_map.T):
        inside = np.allclose(rows.T @ (rows @ axis), axis, rtol=0, atol=BASIS_TOLERANCE)
        for sign in (1.0, -1.0):
            least_duties = np.min(sign * possible[:, :, number], axis=1) * size
            if inside and np.any(least_duties >= -BASIS_TOLERANCE):
                continue
            missing = (sign * axis / np.sqrt(axis @ axis) + 0.0).round(3).tolist()
            raise ValueError(
                "Those left must make torques of either sign about the commanded axes, "
                f"but none of their combinations makes a torque along {missing}."
            )


def _optimal_somewhere(candidates: np.ndarray) -> list[np.ndarray]:
    """Return the distinct duties without a negative entry for some range of commands."""
    distinct: list[np.ndarray] = []
    for duties in candidates:
        rows = duties[np.any(np.abs(duties) > BASIS_TOLERANCE * np.abs(duties).max(), axis=1)]
        if not _has_interior(rows):
            continue
        if not any(np.allclose(duties, other, rtol=1e-9, atol=0) for other in distinct):
            distinct.append(duties)
    return distinct


def _has_interior(rows: np.ndarray) -> bool:
    """Whether rows @ u > 0 for some u, for independent rows or vectors u of two entries."""
    if rows.shape[0] <= rows.shape[1]:
        return True
    normals = np.arctan2(rows[:, 1], rows[:, 0])
    bounds = np.sort(np.concatenate([normals - np.pi / 2, normals + np.pi / 2]) % (2 * np.pi))
    middle = (bounds + np.append(bounds[1:], bounds[0] + 2 * np.pi)) / 2
    sides = np.cos(middle[:, None] - normals[None, :])
    return bool(np.any(np.all(sides > BASIS_TOLERANCE, axis=1)))


def largest_torque(
    torque: Float[np.ndarray, "3 m"],
    low: Float[np.ndarray, " m"] | float,
    high: Float[np.ndarray, " m"] | float,
    command_map: Float[np.ndarray, "3 torques"],
) -> float:
    """Compute the largest command (N m) about all its axes at once, in any signs, within reach.

    Each actuator makes its column of `torque` times a number from `low` to `high`, zero between
    them, and `command_map` is the torque of a unit of command. The reachable torques are a convex
    body, bounded by the support function of the normals of its facets, each across two columns.
    """
    rows = _independent_rows(torque)
    columns, commands = rows @ torque, rows @ command_map
    corners = np.array(list(itertools.product((1.0, -1.0), repeat=commands.shape[1])))
    along = _facet_normals(columns)
    components = along @ columns
    reach = np.maximum(components * low, components * high).sum(axis=1)
    speed = along @ commands @ corners.T
    ahead = speed > BASIS_TOLERANCE * np.abs(commands).max()
    return float(np.min(np.where(ahead, reach[:, None] / np.where(ahead, speed, 1.0), np.inf)))


def _facet_normals(columns: Float[np.ndarray, "r m"]) -> Float[np.ndarray, "n r"]:
    """Return unit normals, both ways, of the facets of the zonotope of spanning columns."""
    space = len(columns)
    pairs = itertools.combinations(columns.T / _size(columns), space - 1)
    normals = np.array([_across(np.array(pair).reshape(space - 1, space)) for pair in pairs])
    sizes = np.sqrt(np.sum(normals**2, axis=1))
    normals = normals[sizes > BASIS_TOLERANCE] / sizes[sizes > BASIS_TOLERANCE, None]
    return np.concatenate([normals, -normals])


def _across(rows: np.ndarray) -> np.ndarray:
    """Return the vector across n - 1 rows of n numbers, with their volume as its length."""
    places = range(rows.shape[1])
    return np.array([(-1) ** k * np.linalg.det(np.delete(rows, k, axis=1)) for k in places])


def usable_share(torque_axes: Float[np.ndarray, "3 m"], frame: Float[np.ndarray, "2 3"]) -> float:
    """Return the share of each thruster's limit that a torque may have without saturation.

    It holds for torques about both rows of `frame` at once, which are orthonormal and in the plane
    of the torques.
    """
    thrusts = np.linalg.pinv(torque_axes) @ frame.T
    return 1.0 / float(np.abs(thrusts).sum(axis=1).max())
