"""Tubes that contain every flight of a sampled loop from a box of starts.

In each period the state is x(t) = Σ tᵏ/k! x⁽ᵏ⁾, with the derivatives at the sample as forms of the
state, and a remainder from the highest derivative on a box that contains the state in the whole
period (a Picard enclosure). The command is a form of the same symbols, so that state and command
keep their correlation. At each sample the rest of a component becomes a symbol of its own. When
there are many, the shortest are replaced by an orthogonal frame that holds them, as in R. J.
Lohner's method (N. S. Nedialkov, K. R. Jackson and G. F. Corliss, Applied Mathematics and
Computation 105, 1999).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import ArrayLike

from jaxsat.core.checks import require_counts, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.core.jax_internals import without_own_rules
from jaxsat.synthesis.enclosure.forms import (
    SLACK,
    TINY,
    UNIT,
    Form,
    add,
    between,
    box,
    exact,
    multiply,
    start_box,
    subtract,
)
from jaxsat.synthesis.enclosure.program import FormProgram

Box = tuple[ArrayLike | Sequence[float], ArrayLike | Sequence[float]]
"""Lower and upper ends of a vector's components."""

ENDS = ("lower", "upper")
HALVINGS = 6
"""How often a period is halved at most to find a box that contains the state in it."""


@dataclass(frozen=True)
class Tube:
    """Boxes that contain every flight.

    `lower` and `upper` have a row for each sample at `times`, the start included. `piece_lower` and
    `piece_upper` have one for each piece of time between successive `piece_times`. All is infinite
    from the period on for which no box was found.
    """

    times: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    piece_times: np.ndarray
    piece_lower: np.ndarray
    piece_upper: np.ndarray

    @property
    def is_finite(self) -> bool:
        """Whether all components have bounds to the end."""
        return bool(np.isfinite(self.piece_upper - self.piece_lower).all())

    def avoids(self, unsafe: Box) -> bool:
        """Whether the tube meets a box nowhere, so that no flight does."""
        lower, upper = (np.asarray(end, float) for end in unsafe)
        apart = (self.piece_upper < lower) | (self.piece_lower > upper)
        return bool(apart.any(1).all())


def _down(values: np.ndarray) -> np.ndarray:
    return np.nextafter(values, -np.inf)


def _up(values: np.ndarray) -> np.ndarray:
    return np.nextafter(values, np.inf)


class _Piece(NamedTuple):
    """A box that contains the state in a piece of time up to an end."""

    end: float
    lower: np.ndarray
    upper: np.ndarray


class _Hold(NamedTuple):
    """The state while a command is held: coefficients of a polynomial in time, and a deviation."""

    coefficients: Sequence[Form]
    deviation: Form

    def at(self, time: Form) -> Form:
        """Return the state at a time, or over an interval of it."""
        value = self.coefficients[-1]
        for one in self.coefficients[-2::-1]:
            value = add(multiply(value, time), one)
        return add(value, self.deviation)


def _along(rate: Callable, function: Callable, state):
    """Return the derivative of a function of the state along its motion."""
    return jax.jvp(function, (state,), (rate(state),))[1]


class _Loop:
    """Dynamics and controller of a loop as programs of forms."""

    def __init__(
        self,
        dynamics: Callable,
        controller: Callable,
        states: int,
        disturbance: Box | None,
        order: int,
    ):
        self.disturbed = () if disturbance is None else (between(*disturbance),)
        middle = tuple(one.center for one in self.disturbed)
        state = np.zeros(states)
        with jax.enable_x64(True):
            command = jax.eval_shape(controller, state)
        examples = (state, np.zeros(command.shape), *middle)

        with jax.enable_x64(True):
            plain = without_own_rules(dynamics, *examples)

        def coefficients(state, *inputs):
            """Taylor coefficients of the state in time from the first on, with constant inputs."""

            def rate(at):
                return plain(at, *inputs)[0]

            derivatives: list[Callable] = [rate]
            for _ in range(order - 1):
                derivatives.append(partial(_along, rate, derivatives[-1]))
            return [one(state) / math.factorial(1 + k) for k, one in enumerate(derivatives)]

        self.command = FormProgram(controller, state)
        self.rate = FormProgram(dynamics, *examples, smooth=True)
        self.coefficients = FormProgram(lambda *at: coefficients(*at)[:-1], *examples, smooth=True)
        self.last = FormProgram(lambda *at: coefficients(*at)[-1], *examples, smooth=True)
        self.jacobian = (
            FormProgram(jax.jacfwd(lambda *at: plain(*at)[0]), *examples) if middle else None
        )

    def hold(self, state: Form, command: Form, duration: float) -> _Hold | None:
        """Return the state over a hold, None where no box that contains it was found."""
        level = between(command.lower, command.upper)
        around = self._around(state, level, duration)
        deviation = None if around is None else self._deviation(around, level, duration)
        if around is None or deviation is None:
            return None
        middle = [exact(one.center) for one in self.disturbed]
        (last,) = self.last(around, level, *middle)
        if not np.isfinite(last.rest).all():
            return None
        last = between(last.lower, last.upper)  # its symbols are those of the box
        return _Hold([state, *self.coefficients(state, command, *middle), last], deviation)

    def period(
        self, state: Form, command: Form, duration: float, pieces: int, halvings: int = HALVINGS
    ) -> "tuple[Form, list[_Piece]] | None":
        """Return the state after a hold and the pieces of it; it is halved where that helps."""
        hold = self.hold(state, command, duration)
        if hold is not None:
            times = np.linspace(0.0, duration, pieces + 1)
            spans = [(end, hold.at(between(first, end))) for first, end in pairwise(times)]
            segments = [_Piece(end, form.lower, form.upper) for end, form in spans]
            return hold.at(exact(duration)), segments
        if not halvings:
            return None
        segments = []
        for half in range(2):
            part = self.period(state, command, duration / 2, pieces, halvings - 1)
            if part is None:
                return None
            state = part[0]
            segments += [one._replace(end=half * duration / 2 + one.end) for one in part[1]]
        return state, segments

    def _around(self, state: Form, level: Form, duration: float) -> Form | None:
        """Return a box that contains the state over a hold, with a symbol for each component."""
        first_low, first_high = low, high = state.lower, state.upper
        for _ in range(12):
            (rate,) = self.rate(box(low, high), level, *self.disturbed)
            down = _down(first_low + _down(np.minimum(duration * rate.lower, 0.0)))
            up = _up(first_high + _up(np.maximum(duration * rate.upper, 0.0)))
            if not np.isfinite(up - down).all():
                return None
            if (down >= low).all() and (up <= high).all():
                return box(down, up)
            margin = 0.1 * (up - down) + 1e-12 * (np.abs(up) + np.abs(down)) + 1e-300
            low, high = np.minimum(low, down - margin), np.maximum(high, up + margin)
        return None

    def _deviation(self, around: Form, level: Form, duration: float) -> Form | None:
        """Return what the disturbance adds to the state, which it has in its middle, over a hold.

        Where |∂f/∂x| ≤ A and the disturbance changes the rate by at most w, the deviation is at
        most e if T (w + A e) ≤ 0.99 e, so at most s (w + A e) at time s, and at the end at most
        T w + A T² / 2 (w + A e).
        """
        if self.jacobian is None or not self.disturbed:
            return exact(np.zeros(around.shape))
        disturbed = self.disturbed[0]
        sets, ends = (around, level, disturbed), np.cumsum([len(around.center), len(level.center)])
        lower, upper = (np.concatenate([getattr(one, end) for one in sets]) for end in ENDS)
        state, command, whole = map(Form, np.split(box(lower, upper).rows, ends, axis=1))
        (rate,) = self.rate(state, command, whole)
        (nominal,) = self.rate(state, command, exact(disturbed.center))
        change, (slopes,) = subtract(rate, nominal), self.jacobian(state, command, whole)
        change, sizes = (np.maximum(-one.lower, one.upper) for one in (change, slopes))
        bound = 2 * duration * change + 1e-300
        for _ in range(12):
            radius = duration * (change + sizes @ bound) * (1 + SLACK)
            if (radius <= 0.99 * bound).all():
                later = duration * change + sizes @ (change + sizes @ radius) * (duration**2 / 2)
                radius = np.minimum(radius, later * (1 + SLACK))
                return between(-radius, radius)
            bound = 2 * radius
        return None


def _renewed(state: Form, symbols: int) -> Form:
    """Return the state with a symbol of its own for the rest of each component, and at most some
    symbols besides those of the start: of more, the shortest become a frame."""
    starts = state.starts
    count = starts + starts * (starts + 1) // 2
    fixed, slopes = state.slopes[:count], state.slopes[count:]
    slopes, rest = np.concatenate([slopes, np.diag(state.rest)]), np.zeros(state.shape)
    if len(slopes) > symbols:
        slopes = slopes[np.argsort(-np.linalg.norm(slopes, axis=1), kind="stable")]
        half = symbols // 2
        frame, rest = _framed(slopes[half:])
        slopes = np.concatenate([slopes[:half], frame])
    return Form(np.concatenate([[state.center, rest], fixed, slopes]), starts)


def _framed(slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return as few slopes as there are components, and a rest, in place of slopes, longest first.

    They are the columns of an orthogonal Q, scaled; y = Q (Qᵀ y) + (I - Q Qᵀ) y for any matrix.
    """
    columns = slopes.T
    count = len(columns)
    frame = np.linalg.qr(columns)[0]
    size = np.abs(columns).sum(1) * (1 + SLACK)
    error = 4 * (count + 2) * UNIT
    bound = np.abs(frame.T @ columns).sum(1) + error * (np.abs(frame.T) @ size)
    bound = bound * (1 + SLACK)
    gap = np.abs(np.eye(count) - frame @ frame.T) + error * (1 + np.abs(frame) @ np.abs(frame.T))
    rest = (gap @ size + np.abs(frame) @ bound * UNIT) * (1 + SLACK) + TINY
    return (frame * bound).T, rest


def _box(name: str, ends: Box) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = (np.atleast_1d(np.asarray(end, float)) for end in ends)
    if lower.shape != upper.shape or not (lower <= upper).all():
        raise ArgumentError(name, "must have lower ends at or below the upper ends")
    return lower, upper


def enclose(
    dynamics: Callable,
    controller: Callable,
    start: Box,
    period: float,
    periods: int,
    *,
    disturbance: Box | None = None,
    order: int = 4,
    symbols: int = 200,
    pieces: int = 4,
) -> Tube:
    """Return a tube that contains every flight of a sampled loop from a box of starts.

    `dynamics(x, u)` is the rate of the state vector, and `controller(x)` the command vector, which
    is computed at each sample and held for a `period` (s). With a box `disturbance` the rate is
    `dynamics(x, u, d)`, and d any measurable function of time in that box. Time, and what a
    controller remembers, must be components of the state. Both functions are in `jax.numpy`, of
    operations that have rules (`jaxsat.synthesis.enclosure.program.RULES`). The controller may have
    corners and jumps, which widen the tube; where the dynamics have some, the tube ends.

    The tube is that of exact real numbers: it contains no round-off of a controller. `order` is
    that of the Taylor polynomials in time; `symbols` describe the state besides those of the start,
    more of them narrower; `pieces` divide each period in the result.

    Raises `ArgumentError` for an operation without a rule, if `start` or `disturbance` is no box,
    or if a count or the period is not positive.
    """
    require_counts(periods=periods, order=order, symbols=symbols, pieces=pieces)
    require_positive("period", period)
    lower, upper = _box("start", start)
    if disturbance is not None:
        disturbance = _box("disturbance", disturbance)
    loop = _Loop(dynamics, controller, len(lower), disturbance, order)
    boxes, segments = [(lower, upper)], [_Piece(0.0, lower, upper)]
    with np.errstate(all="ignore"):
        state = start_box(lower, upper)
        for number in range(periods):
            (command,) = loop.command(state)
            outcome = loop.period(state, command, period, pieces)
            if outcome is None or not np.isfinite(outcome[0].rows).all():
                break
            state = _renewed(outcome[0], symbols)
            boxes.append((state.lower, state.upper))
            segments += [one._replace(end=number * period + one.end) for one in outcome[1]]
    return _tube(boxes, segments, period * np.arange(periods + 1))


def _tube(boxes: list, segments: "list[_Piece]", times: np.ndarray) -> Tube:
    """Return the tube, infinite where boxes are missing."""
    missing, infinite = len(times) - len(boxes), np.full(len(boxes[0][0]), np.inf)
    boxes = boxes + [(-infinite, infinite)] * missing
    segments = segments + [_Piece(times[-1], -infinite, infinite)] * (missing > 0)
    lower, upper = (np.array(ends) for ends in zip(*boxes, strict=True))
    ends, low, high = (np.array(values) for values in zip(*segments, strict=True))
    return Tube(times, lower, upper, ends, low[1:], high[1:])
