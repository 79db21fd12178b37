"""Affine forms: sets of numbers in an arithmetic that never loses one.

A form is the set of all c + Σ gᵢ εᵢ + ρ with the symbols |εᵢ| ≤ 1, which forms share, and |ρ| ≤ r,
which they do not (J. Stolfi and L. H. de Figueiredo, Self-Validated Numerical Methods and
Applications, 1997). Some symbols are those of the start, whose products are symbols, too, so that
operations are exact in them to second order, and in the others to first. What an operation leaves
out it adds to r: a bound of higher orders, and for its round-off the unit of round-off times the
magnitudes of all that it summed. So the results hold for exact real numbers.
"""

from typing import Any, NamedTuple

import numpy as np

Numbers = Any
"""An array, or a number of NumPy in place of one without dimensions."""

UNIT = 2.0**-53
"""Largest relative error of one operation of IEEE 754 arithmetic."""

FUNCTION_ERROR = 2.0**-48
"""Relative error of NumPy's functions that is allowed for: 16 units in the last place, where NumPy
states at most 4."""

SLACK = 2.0**-44
"""Relative margin of bounds, for the round-off of computing them from less than 500 numbers."""

TINY = 2.0**-1000
"""Absolute margin, for underflow."""


class Form(NamedTuple):
    """An array of sets. `rows` has c, r, and then the gᵢ, each of the array's shape.

    The first symbols are as many `starts`, and the next their products in pairs, in the order of
    `numpy.triu_indices`: εᵢ εⱼ, and 2 εᵢ² - 1.
    """

    rows: np.ndarray
    starts: int = 0

    @property
    def center(self) -> Numbers:
        """The middle c."""
        return self.rows[0]

    @property
    def rest(self) -> Numbers:
        """The bound r."""
        return self.rows[1]

    @property
    def slopes(self) -> Numbers:
        """The slopes gᵢ, one row for each symbol."""
        return self.rows[2:]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array."""
        return self.rows.shape[1:]

    @property
    def reach(self) -> Numbers:
        """A bound of the distance from the middle."""
        return (self.rest + np.abs(self.slopes).sum(0)) * (1 + SLACK)

    @property
    def lower(self) -> Numbers:
        """Lower ends."""
        return self._end(-1)

    @property
    def upper(self) -> Numbers:
        """Upper ends."""
        return self._end(1)

    def _end(self, side: int) -> Numbers:
        reach = self.reach
        end = np.nextafter(self.center + side * reach, side * np.inf)
        return np.where(reach == 0, self.center, end)


def exact(values) -> Form:
    """Return the form of numbers."""
    values = np.asarray(values, float)
    return Form(np.stack([values, np.zeros_like(values)]))


def between(lower, upper) -> Form:
    """Return the form of intervals, without symbols."""
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    with np.errstate(invalid="ignore"):
        center = lower + (upper - lower) / 2
        rest = np.maximum(upper - center, center - lower)
    return _form(center, np.empty((0, *center.shape)), rest, 0.0)


def box(lower, upper) -> Form:
    """Return the form of a vector between two others, with a symbol for each component."""
    form = between(lower, upper)
    return Form(np.stack([form.center, np.zeros_like(form.center), *np.diag(form.rest)]))


def start_box(lower, upper) -> Form:
    """Return the form of a vector between two others, whose symbols are starts."""
    form, count = box(lower, upper), len(lower)
    pairs = np.zeros((count * (count + 1) // 2, count))
    return Form(np.concatenate([form.rows, pairs]), count)


def _above(bound: Numbers, terms: int = 0) -> Numbers:
    return bound * (1 + SLACK + 4 * terms * UNIT) + TINY


def _form(center, slopes, rest, magnitude, terms: int = 4, starts: int = 0) -> Form:
    """Return a form whose round-off is that of `terms` operations on numbers of a magnitude."""
    rest = _above(rest + (terms * UNIT) * magnitude, terms)
    rows = np.concatenate([center[None], rest[None], slopes])
    bad = ~np.isfinite(rows).all(0)
    if bad.any():
        rows = np.where(bad, 0.0, rows)
        rows[1] = np.where(bad, np.inf, rows[1])
    return Form(rows, starts)


def aligned(*forms: Form) -> list[Form]:
    """Return forms of the same shape and number of symbols."""
    shape = np.broadcast_shapes(*(one.shape for one in forms))
    count = max(len(one.rows) for one in forms)
    starts = max(one.starts for one in forms)
    return [_aligned(one, shape, count, starts) for one in forms]


def _aligned(form: Form, shape: tuple[int, ...], count: int, starts: int) -> Form:
    rows = form.rows
    if form.shape != shape:
        dimensions = (len(rows), *(1,) * (len(shape) - len(form.shape)), *form.shape)
        rows = np.broadcast_to(rows.reshape(dimensions), (len(rows), *shape))
    if len(rows) < count:
        rows = np.concatenate([rows, np.zeros((count - len(rows), *shape))])
    return Form(rows, starts)


def negative(form: Form) -> Form:
    """Return -x."""
    rows = np.concatenate([-form.rows[:1], form.rows[1:2], -form.rows[2:]])
    return Form(rows, form.starts)


def add(a: Form, b: Form) -> Form:
    """Return x + y."""
    a, b = aligned(a, b)
    center, slopes = a.center + b.center, a.slopes + b.slopes
    magnitude = np.abs(center) + np.abs(slopes).sum(0)
    return _form(center, slopes, a.rest + b.rest, magnitude, starts=a.starts)


def subtract(a: Form, b: Form) -> Form:
    """Return x - y."""
    return add(a, negative(b))


def multiply(a: Form, b: Form) -> Form:
    """Return x y. Products of two starts are kept; of the others only the middle, as 0 ≤ ε² ≤ 1."""
    a, b = aligned(a, b)
    count = a.starts
    center, slopes = a.center * b.center, a.center * b.slopes + b.center * a.slopes
    size_a, size_b = np.abs(a.slopes).sum(0), np.abs(b.slopes).sum(0)
    first_a, first_b = np.abs(a.center), np.abs(b.center)
    rest = (first_a + size_a) * b.rest + (first_b + size_b) * a.rest + a.rest * b.rest
    magnitude = (first_a + size_a) * (first_b + size_b)
    if size_a.any() and size_b.any():
        squares = a.slopes * b.slopes
        center = center + squares.sum(0) / 2
        second = size_a * size_b - np.abs(squares[count:]).sum(0) / 2
        if count:
            ours, theirs = a.slopes[:count], b.slopes[:count]
            second = second - np.abs(ours).sum(0) * np.abs(theirs).sum(0)
            products = ours[:, None] * theirs[None]
            products = (products + products.swapaxes(0, 1))[np.triu_indices(count)]
            twice = _pair_weights(count).reshape(-1, *(1,) * len(a.shape))
            slopes[count : count + len(products)] += products * twice
        rest = rest + np.maximum(second, 0.0)
    return _form(center, slopes, rest, magnitude, 8 + 5 * len(slopes), count)


def _pair_weights(count: int) -> Numbers:
    """Return the weights of gᵢ hⱼ + gⱼ hᵢ for the symbols of pairs: 2 gᵢ hᵢ εᵢ² = gᵢ hᵢ (1 + ζ)."""
    first, second = np.triu_indices(count)
    return np.where(first == second, 0.25, 1.0)


def total(form: Form, axes: tuple[int, ...]) -> Form:
    """Return the sum over axes of the array."""
    rows = form.rows.sum(tuple(axis + 1 for axis in axes))
    magnitude = (np.abs(form.center) + np.abs(form.slopes).sum(0)).sum(axes)
    count = int(np.prod([form.shape[axis] for axis in axes]))
    return _form(rows[0], rows[2:], rows[1], magnitude, 4 + count, form.starts)


def smooth(form: Form, value, slope, bends, ends, scale=1.0) -> Form:
    """Return f(x) by Taylor's theorem.

    `value` and `slope` are f and f' in the middle, `bends` two bounds of f'' on the set, and `ends`
    two of f, which replace the theorem where its remainder is larger than they allow. `scale`
    bounds the numbers from which f' was computed.
    """
    reach, middle, apart = form.reach, bends[0] / 2 + bends[1] / 2, bends[1] / 2 - bends[0] / 2
    sizes = np.abs(value) + scale * reach + (np.abs(bends[0]) + np.abs(bends[1])) * reach**2
    error = _above(apart * reach**2 / 2 + FUNCTION_ERROR * sizes)
    low, high = (np.broadcast_to(end, form.shape) for end in ends)
    low, high = low - FUNCTION_ERROR * np.abs(low), high + FUNCTION_ERROR * np.abs(high)
    bounds = between(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))
    change = form.rows.copy()
    change[0] = 0
    change = Form(change, form.starts)
    curve = multiply(exact(middle / 2), multiply(change, change))
    taylor = add(exact(value), add(multiply(exact(slope), change), curve))
    taylor.rows[1] += error
    return pick(error < bounds.rest, taylor, bounds)


def pick(condition: Numbers, form: Form, other: Form) -> Form:
    """Return x where a condition holds, and y elsewhere."""
    form, other = aligned(form, other)
    return Form(np.where(condition, form.rows, other.rows), form.starts)


def unbounded(condition: Numbers, form: Form) -> Form:
    """Return x, and all numbers where a condition holds."""
    infinite = np.full(form.shape, np.inf)
    return pick(np.broadcast_to(condition, form.shape), between(-infinite, infinite), form)


def both(form: Form, other: Form) -> Form:
    """Return a set that contains x and y."""
    form, other = aligned(form, other)
    apart, half = subtract(other, form), multiply(add(form, other), exact(0.5))
    rest = _above(half.rest + (np.abs(apart.center) + apart.reach) / 2)
    return Form(np.concatenate([half.rows[:1], rest[None], half.slopes]), form.starts)
