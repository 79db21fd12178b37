"""Descent along gradients of the margin, as far as they can be trusted.

A gradient consists of differences over steps so small that the margin is linear there if it has a
derivative. Differences need no derivative of the program, and a flight in machine code takes less
time than one of the tangents of forward mode, of which there is one for each number as well.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.studies.splitting import Evaluate, cube_points
from jaxsat.synthesis.worst_case.ball import Ball

STEP = 1e-4
"""Step of differences, in standard deviations."""

AGREEMENT = 0.1
"""Largest relative difference of the slope along a gradient, by a central difference, from the
length of a gradient that can be trusted."""

FRACTIONS = 0.5 ** np.arange(10)
"""Tried steps, as parts of the way to where the margin would be least if it were linear."""

LEAST_GAIN = 1e-4
"""Relative gain of a step below which a descent ends."""


class Flown(NamedTuple):
    """A case that was flown: its normal numbers, the number of its noise, and its margin."""

    x: Float[np.ndarray, " d"]
    noise: int
    margin: float


class Descent(NamedTuple):
    """The case at the `end` of a descent, the number of all `flights`, and that of gradients, of
    which so many were `trusted`."""

    end: Flown
    flights: int
    gradients: int
    trusted: int


def descend(
    evaluate: Evaluate, ball: Ball, whole: Bool[np.ndarray, " d"], start: Flown, most: int
) -> Descent:
    """Descend from a case with the same noise, by at most so many flights.

    Coordinates of which the meaning jumps, `whole`, stay. A descent ends where a gradient cannot be
    trusted, or where no step along it gains. It stays so far inside the ball that differences do.
    """
    inner = ball._replace(radius=ball.radius - 2 * STEP)
    if np.linalg.norm(start.x) > inner.radius + STEP:
        most = 0
    moves = np.flatnonzero(~whole)
    offsets = STEP * np.eye(ball.dimension)[moves]
    each = len(moves) + len(FRACTIONS) + 2
    now, flights, gradients, trusted = start, 0, 0, 0
    while flights + each <= most and len(moves) and np.isfinite(now.margin):
        ahead = _margins(evaluate, now.x + offsets, now.noise)
        flights += len(ahead)
        gradient = np.zeros(ball.dimension)
        gradient[moves] = (ahead - now.margin) / STEP
        gradients += 1
        slope = float(np.linalg.norm(gradient))
        if not np.isfinite(slope) or slope == 0:
            break
        along = STEP * gradient / slope
        way = inner.least_along(gradient, np.where(whole, now.x, 0.0)) - now.x
        x = np.stack([now.x + along, now.x - along, *(now.x + FRACTIONS[:, None] * way)])
        margins = _margins(evaluate, x, now.noise)
        flights += len(margins)
        with np.errstate(invalid="ignore"):  # of two infinite margins
            central = (margins[0] - margins[1]) / (2 * STEP)
        agrees = bool(abs(central - slope) <= AGREEMENT * slope)
        trusted += agrees
        least = 2 + int(np.argmin(margins[2:]))
        gain = now.margin - margins[least]
        if gain > 0:
            now = Flown(x[least], now.noise, float(margins[least]))
        if not agrees or gain <= LEAST_GAIN * abs(now.margin):
            break
    return Descent(now, flights, gradients, trusted)


def _margins(evaluate: Evaluate, x: np.ndarray, noise: int) -> Float[np.ndarray, " n"]:
    return evaluate(cube_points(x), np.full(len(x), noise, np.uint32))
