"""Controllability with failed thrusters that keep making torque: two levels for each thruster.

Thruster k makes the torque τ_k l_k with low_k <= l_k <= high_k. The attainable torques are a
zonotope. With zero inside it, torques of every direction remain. With zero on its boundary the
thrusters move about a balance Σ τ_k l_k = 0, in which each can do more, less, or both: these
columns decide. With zero outside, nothing opposes the constant torque. Nor does anything where a
balance takes some thruster's whole range: with a slightly smaller range there is none.
"""

import itertools

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.actuators import ActuatorSet, actuator_set
from jaxsat.controllability.judgement import CONTROLLABLE, Judgement
from jaxsat.controllability.judging import judge
from jaxsat.controllability.layout import TOLERANCE, Numbers
from jaxsat.controllability.programme import solve

LEVEL_ROUNDING = 1e-7
"""Tolerance on levels in the linear programmes."""


def torque_reserve(
    torques: Float[np.ndarray, "3 m"], low: Float[np.ndarray, " m"], high: Float[np.ndarray, " m"]
) -> float:
    """Compute the largest torque (N m) that can be made in every direction, below zero if none.

    `torques` in N m at level 1. The result is the least of the support function over the normals
    of all facets, and zero where the varying torques do not span R³.
    """
    centre, half = torques @ ((high + low) / 2), torques * (high - low) / 2
    if np.linalg.matrix_rank(half, tol=TOLERANCE * np.abs(torques).max(initial=1e-300)) < 3:
        return 0.0
    pairs = np.array(list(itertools.combinations(half.T, 2)))
    normals = np.cross(pairs[:, 0], pairs[:, 1])
    sizes = np.linalg.norm(normals, axis=1)
    is_facet = sizes > TOLERANCE**2 * sizes.max()
    normals = normals[is_facet] / sizes[is_facet, None]
    reach = np.abs(normals @ half).sum(axis=1) - np.abs(normals @ centre)
    return float(reach.min())


def opposing_share(
    torques: Float[np.ndarray, "3 m"], low: Float[np.ndarray, " m"], high: Float[np.ndarray, " m"]
) -> float:
    """Compute the share of their range that thrusters need to balance the constant torque of all.

    `torques` in N m at level 1; the constant torque is that of the levels nearest to zero. The
    share is that of the most loaded thruster, minimised: zero without a constant torque, above 1
    where the ranges do not suffice, infinite where no share does.
    """
    least = np.clip(0.0, low, high)
    constant = torques @ least
    size = np.abs(torques).max(initial=1e-300)
    if np.all(np.abs(constant) <= TOLERANCE * size):
        return 0.0
    return _least_share(-constant, torques * (high - least), torques * (low - least))


def _least_share(
    aim: Float[np.ndarray, "3"], up: Float[np.ndarray, "3 m"], down: Float[np.ndarray, "3 m"]
) -> float:
    """Return the least s with `aim` = Σ a_i `up`_i + b_i `down`_i, 0 <= a_i, b_i <= s; the columns
    of each pair are parallel. The aim is at the boundary of a zonotope that grows with s, on one of
    whose facets the share is found."""
    generators = up - down
    basis, sizes, _ = np.linalg.svd(generators, full_matrices=False)
    basis = basis[:, sizes > TOLERANCE * sizes.max(initial=1e-300)]
    size = np.linalg.norm(aim)
    if np.linalg.norm(aim - basis @ (basis.T @ aim)) > TOLERANCE * size:
        return np.inf
    pairs = np.array(list(itertools.combinations(generators.T, 2))).reshape(-1, 2, 3)
    if basis.shape[1] == 3:
        normals = np.cross(pairs[:, 0], pairs[:, 1])
    elif basis.shape[1] == 2:
        normals = np.cross(np.cross(basis[:, 0], basis[:, 1]), generators.T)
    else:
        normals = basis.T
    lengths = np.linalg.norm(normals, axis=1)
    is_facet = lengths > TOLERANCE**2 * lengths.max()
    units = normals[is_facet] / lengths[is_facet, None]
    units = np.concatenate([units, -units])
    reach = np.maximum(units @ up, units @ down).sum(axis=1)
    need = units @ aim
    need = np.where(need > TOLERANCE * size, need, 0.0)
    within = reach > TOLERANCE * np.linalg.norm(generators, axis=0).max()
    if np.any(need[~within] > 0):
        return np.inf
    return float(np.max(need[within] / reach[within], initial=0.0))


def stuck_on_words(inertia: Numbers, actuators: ActuatorSet) -> str | None:
    """Return which thrusters the others oppose while one is stuck on; None without one-sided ones.

    A two-sided thruster may stick in either direction. Raises ValueError as `judge` does.
    """
    if actuators.two_sided.all():
        return None
    shares, axes_lost = {}, []
    for place, name in enumerate(actuators.thrusters):
        ways = (1.0, -1.0) if actuators.two_sided[place] else (1.0,)
        each = [_stuck(inertia, actuators, place, level) for level in ways]
        shares[name] = max(share for share, _ in each)
        axes_lost += [] if all(controllable for _, controllable in each) else [name]
    opposed = [name for name, share in shares.items() if share < 1 - LEVEL_ROUNDING]
    barely = [name for name, share in shares.items() if abs(share - 1) <= LEVEL_ROUNDING]
    words = [f"the others oppose {len(opposed) or 'none'} of {len(shares)} thrusters"]
    if opposed:
        hardest = max(opposed, key=lambda name: shares[name])
        words.append(
            f"{hardest} takes most, {100 * shares[hardest]:.3g} % of the thrust of another"
        )
    if barely:
        words.append(
            f"{', '.join(barely)} would take the full thrust of another, which errors decide"
        )
    if away := [name for name in opposed if name in axes_lost]:
        words.append(f"after {', '.join(away)} they do not control every axis")
    return f"One thruster stuck on: {'; '.join(words)}"


def _stuck(
    inertia: Numbers, actuators: ActuatorSet, place: int, level: float
) -> tuple[float, bool]:
    """Return the share of `opposing_share` with a thruster stuck at a level, and whether the rest
    controls attitude and rate."""
    low = np.where(actuators.two_sided, -1.0, 0.0)
    high = np.ones_like(low)
    low[place] = high[place] = level
    share = opposing_share(actuators.torques, low, high)
    if share > 1 - LEVEL_ROUNDING or torque_reserve(actuators.torques, low, high) > 0:
        return share, share <= 1 - LEVEL_ROUNDING
    judgement = judge_ranges(inertia, actuators, low, high)
    return share, judgement is not None and judgement.verdict in CONTROLLABLE


def judge_ranges(
    inertia: Numbers,
    actuators: ActuatorSet,
    low: Float[np.ndarray, " m"],
    high: Float[np.ndarray, " m"],
) -> Judgement | None:
    """Judge thrusters that are held between two levels each, and all wheels.

    `actuators` are the thrusters at level 1, whose own signs are ignored; those with equal levels
    make a constant torque. None where nothing opposes the constant torque, or others only with
    their whole range (`opposing_share`): slightly weaker thrusters would not. Raises ValueError as
    `judge` does.
    """
    if opposing_share(actuators.torques, low, high) > 1 - LEVEL_ROUNDING:
        return None
    moves = _moves(actuators.torques, low, high)
    if moves is None:
        return None
    down, up = moves
    sign = np.where(up, 1.0, -1.0)
    movable = np.flatnonzero(down | up)
    columns = actuators.torques[:, movable] * sign[movable]
    names = [actuators.thrusters[i] for i in movable]
    return judge(
        inertia,
        actuator_set(
            columns,
            two_sided=[bool(both) for both in (down & up)[movable]],
            names=names,
            wheel_axes=actuators.wheel_axes,
            wheel_names=actuators.wheels,
            momentum=actuators.momentum,
            rotors=actuators.rotors,
            target_turns=actuators.target_turns,
        ),
    )


def _moves(
    torques: Float[np.ndarray, "3 m"], low: Float[np.ndarray, " m"], high: Float[np.ndarray, " m"]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Whether each thruster can make less, and more, about a balance; None without a balance."""
    free = high - low > LEVEL_ROUNDING
    if not np.any(torques @ np.where(free, 0.0, low)) and np.all((low <= 0) | ~free):
        return free & (low < 0), free & (high > 0)  # at rest with all others off
    size = np.abs(torques).max(initial=1e-300)
    bounds = list(zip(low, high, strict=True))
    down, up = np.zeros_like(free), np.zeros_like(free)
    for place in np.flatnonzero(free):
        for sign in (1.0, -1.0):
            aim = np.zeros(len(low))
            aim[place] = sign
            solution = solve(aim, A_eq=torques / size, b_eq=np.zeros(3), bounds=bounds)
            if solution.x is None:
                return None
            up |= solution.x < high - LEVEL_ROUNDING
            down |= solution.x > low + LEVEL_ROUNDING
    if not free.any() and np.any(np.abs(torques @ low) > TOLERANCE * size):
        return None
    return down & free, up & free
