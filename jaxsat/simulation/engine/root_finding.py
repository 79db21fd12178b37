"""Root finding within a step: a bracket and a few safeguarded secants."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar

ITERATIONS = 24
CLOSE_ENOUGH = 1e-6
"""Tolerance on roots, as a fraction of the step. One further step of Newton's method is exact."""

NEXT_TO_NOTHING = 1e-6
"""Largest |value| treated as zero at the begin of a step, relative to the other end's value."""

SECANTS, NEWTON_STEPS = 2, 2


class Bracket(NamedTuple):
    """Fractions of a step with the function at most zero at `low` and positive at `high`."""

    low: RealScalar
    low_value: RealScalar
    high: RealScalar
    high_value: RealScalar


class _RootSearch(NamedTuple):
    bracket: Bracket
    point: RealScalar
    move: RealScalar
    was_low: BoolScalar
    iterations: IntScalar


def find_root(
    function: Callable[[RealScalar], RealScalar], bracket: Bracket, active: BoolScalar
) -> RealScalar:
    """The fraction of the step at which the function becomes positive, to `CLOSE_ENOUGH`.

    Secants with the Illinois rule. Every third point, and every point while the lower end is next
    to zero (a step that begins on a surface, where a secant would not move), halves the bracket. A
    step that is not `active` takes no iteration.
    """

    def unfinished(search: _RootSearch):
        return active & (search.move > CLOSE_ENOUGH) & (search.iterations < ITERATIONS)

    def improve(search: _RootSearch) -> _RootSearch:
        low, low_value, high, high_value = search.bracket
        on_surface = (low == bracket.low) & (low_value >= -NEXT_TO_NOTHING * high_value)
        halve = on_surface | (low_value >= 0) | (search.iterations % 3 == 2)
        slope = jnp.where(halve, 1.0, high_value - low_value)
        secant = low - low_value * (high - low) / slope
        point = jnp.where(halve, (low + high) / 2, jnp.clip(secant, low, high))
        value = function(point)
        is_low = value <= 0
        # Illinois: halve the value of an end that stays twice
        again = (is_low == search.was_low) & ~halve
        keep_low = jnp.where(again, low_value / 2, low_value)
        keep_high = jnp.where(again, high_value / 2, high_value)
        closer = Bracket(
            jnp.where(is_low, point, low),
            jnp.where(is_low, value, keep_low),
            jnp.where(is_low, high, point),
            jnp.where(is_low, keep_high, value),
        )
        move = jnp.abs(point - search.point)
        return _RootSearch(closer, point, move, is_low, search.iterations + 1)

    none = jnp.zeros_like(bracket.low)
    first = _RootSearch(bracket, none - 1.0, none + jnp.inf, none > 0, jnp.array(0))
    return jax.lax.while_loop(unfinished, improve, first).point


def polynomial(
    coefficients: Sequence[Float[Array, "..."]], part: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Σ_p θ^p coefficients[p - 1] at θ = `part`."""
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = coefficient + part * total
    return part * total


def ends_of_parts(parts: int) -> Float[np.ndarray, "parts 1"]:
    """Ends of equal parts of a step."""
    return np.arange(1, parts + 1)[:, None] / parts


def sign_changes(
    coefficients: Float[Array, "degree n"],
    parts: int,
    end: RealScalar,
    active: BoolScalar,
    cold_branch: Callable,
) -> Float[Array, "parts n"]:
    """Fraction at which the derivative of Σ_p θ^p coefficients[p - 1] changes its sign before
    `end`.

    One change is located in each of equal `parts` of a step; without one, the part's end is
    returned. A fixed number of secants with the Illinois rule precedes Newton's steps inside the
    bracket; neither runs where no sign changes, or where the step is not `active`.
    """
    first, *others = coefficients[:, None]
    slopes = [p * row for p, row in enumerate(others, 2)]
    curves = [p * row for p, row in enumerate(slopes, 1)]

    def slope(part):
        return first + polynomial(slopes, part)

    def curve(part):
        return curves[0] + polynomial(curves[1:], part)

    ends = ends_of_parts(parts)
    nowhere = jnp.broadcast_to(ends, (parts, first.size))
    high = jnp.minimum(nowhere, end)
    high_value = slope(high)
    low = jnp.concatenate([jnp.zeros_like(high[:1]), high[:-1]])
    low_value = jnp.concatenate([first, high_value[:-1]])
    changes = low_value * high_value < 0

    def search():
        bracket = Bracket(low, low_value, high, high_value)
        return jnp.where(changes, _sign_change(slope, curve, changes, bracket), nowhere)

    return cold_branch(active & jnp.any(changes), search, nowhere)


def _sign_change(slope, curve, changes, bracket: Bracket) -> Float[Array, "parts n"]:
    low, low_value, high, high_value = bracket
    point = high
    for _ in range(SECANTS):
        difference = jnp.where(changes, high_value - low_value, 1.0)
        point = low - low_value * (high - low) / difference
        value = slope(point)
        is_low = value * low_value > 0
        low, high = jnp.where(is_low, point, low), jnp.where(is_low, high, point)
        low_value, high_value = (
            jnp.where(is_low, value, low_value / 2),
            jnp.where(is_low, high_value / 2, value),
        )
    for _ in range(NEWTON_STEPS):
        bend = curve(point)
        correction = slope(point) / jnp.where(bend == 0, 1.0, bend)
        point = jnp.clip(point - correction, low, high)
    return point
