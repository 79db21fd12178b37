"""Functions of affine forms, with bounds of their second derivatives."""

import numpy as np

from jaxsat.synthesis.enclosure.forms import (
    FUNCTION_ERROR,
    Form,
    Numbers,
    add,
    between,
    both,
    exact,
    multiply,
    negative,
    pick,
    smooth,
    subtract,
)

BEND = 1 / np.sqrt(3)
"""Where the second derivatives of tanh in tanh's value, and of atan in x, have their extremes."""


def _among(first, last, function, *inner):
    """Return bounds of a function with its extremes at the ends and at inner points."""
    points = [first, last, *(np.clip(point, first, last) for point in inner)]
    values = [function(point) for point in points]
    return np.minimum.reduce(values) - FUNCTION_ERROR, np.maximum.reduce(values) + FUNCTION_ERROR


def square(x: Form) -> Form:
    """Return x²."""
    low, high = x.lower, x.upper
    least = np.maximum(np.maximum(low, -high), 0)
    ends = least**2, np.maximum(-low, high) ** 2
    return smooth(x, x.center**2, 2 * x.center, (2.0, 2.0), ends, np.abs(x.center))


def power(x: Form, exponent: float) -> Form:
    """Return x to an exact exponent; where it is no whole number, for x ≥ 0."""
    whole = float(exponent).is_integer()
    if whole and exponent < 0:
        return power(reciprocal(x), -exponent)
    if exponent in (0, 1, 2):
        return (exact(np.ones(x.shape)), x, square(x))[int(exponent)]
    low, high = x.lower if whole else np.maximum(x.lower, 0), x.upper
    middle = x.center if whole else np.clip(x.center, low, high)

    def bend(at):
        return exponent * (exponent - 1) * at ** (exponent - 2)

    bends = [bend(low), bend(high), np.where((low < 0) & (high > 0), 0.0, bend(high))]
    ends = [low**exponent, high**exponent]
    ends.append(np.where((low < 0) & (high > 0), 0.0, ends[1]))
    slope = exponent * middle ** (exponent - 1)
    outside = not whole and x.lower < 0
    bounds = (np.where(outside, -np.inf, np.minimum.reduce(bends)), np.maximum.reduce(bends))
    ends = (np.minimum.reduce(ends), np.maximum.reduce(ends))
    return smooth(x, middle**exponent, slope, bounds, ends, np.abs(slope))


def root(x: Form) -> Form:
    """Return the square root, for x ≥ 0."""
    return power(x, 0.5)


def reciprocal(x: Form) -> Form:
    """Return 1/x; unbounded where x may be 0."""
    low, high, c = x.lower, x.upper, x.center
    zero = (low <= 0) & (high >= 0)
    bends = np.sort([2 / low**3, 2 / high**3], 0)
    ends = np.where(zero, -np.inf, 1 / high), np.where(zero, np.inf, 1 / low)
    value = 1 / c
    return smooth(x, value, -(value**2), np.where(zero, np.inf, bends), ends, value**2)


def exponential(x: Form) -> Form:
    """Return e to the x."""
    value, ends = np.exp(x.center), (np.exp(x.lower), np.exp(x.upper))
    return smooth(x, value, value, ends, ends, value)


def logarithm(x: Form) -> Form:
    """Return the natural logarithm; unbounded where x may be 0."""
    low = np.where(x.lower > 0, x.lower, np.nan)
    ends, bends = (np.log(low), np.log(x.upper)), (-1 / low**2, -1 / x.upper**2)
    slope = 1 / x.center
    return smooth(x, np.log(x.center), slope, bends, ends, np.abs(slope))


def hyperbolic_tangent(x: Form) -> Form:
    """Return tanh x."""
    value, ends = np.tanh(x.center), (np.tanh(x.lower), np.tanh(x.upper))
    bends = _among(*ends, lambda t: -2 * t * (1 - t * t), -BEND, BEND)
    return smooth(x, value, 1 - value**2, bends, ends)


def logistic(x: Form) -> Form:
    """Return 1 / (1 + e to the -x)."""
    half = exact(0.5)
    return add(half, multiply(half, hyperbolic_tangent(multiply(half, x))))


def _wave(x: Form, value, slope) -> Form:
    reach = x.reach + FUNCTION_ERROR
    ends = np.maximum(value - reach, -1.0), np.minimum(value + reach, 1.0)
    bends = -ends[1] - FUNCTION_ERROR, -ends[0] + FUNCTION_ERROR
    return smooth(x, value, slope, bends, ends)


def sine(x: Form) -> Form:
    """Return sin x."""
    return _wave(x, np.sin(x.center), np.cos(x.center))


def cosine(x: Form) -> Form:
    """Return cos x."""
    return _wave(x, np.cos(x.center), -np.sin(x.center))


def arctangent(x: Form) -> Form:
    """Return atan x."""
    bends = _among(x.lower, x.upper, lambda at: -2 * at / (1 + at * at) ** 2, -BEND, BEND)
    ends = np.arctan(x.lower), np.arctan(x.upper)
    return smooth(x, np.arctan(x.center), 1 / (1 + x.center**2), bends, ends)


def magnitude(x: Form) -> Form:
    """Return |x|; where x may have either sign, by the chord above and the parallel below."""
    low, high = x.lower, x.upper
    slope = np.where(low >= 0, 1.0, np.where(high <= 0, -1.0, (high + low) / (high - low)))
    gap = np.where((low < 0) & (high > 0), high * (1 - slope), 0.0)
    error = FUNCTION_ERROR * np.where(gap > 0, high - low, 0.0)
    return add(multiply(exact(slope), x), between(-error, gap + error))


def sign(x: Form) -> Form:
    """Return sgn x, between -1 and 1 where it is undecided."""
    return between(np.sign(x.lower), np.sign(x.upper))


def floor(x: Form) -> Form:
    """Return the largest whole number that is not above x."""
    return between(np.floor(x.lower), np.floor(x.upper))


def larger(x: Form, y: Form) -> Form:
    """Return max(x, y)."""
    less, more = y.lower >= x.upper, x.lower >= y.upper
    mean = multiply(exact(0.5), add(add(x, y), magnitude(subtract(x, y))))
    return pick(more, x, pick(less, y, mean))


def smaller(x: Form, y: Form) -> Form:
    """Return min(x, y)."""
    return negative(larger(negative(x), negative(y)))


def quotient(x: Form, y: Form) -> Form:
    """Return x / y; unbounded where y may be 0."""
    return multiply(x, reciprocal(y))


def _truth(certain, possible) -> Form:
    return between(1.0 * certain, 1.0 * possible)


def is_certain(truth: Form) -> Numbers:
    """Return where a truth certainly holds."""
    return truth.lower > 0.5


def is_possible(truth: Form) -> Numbers:
    """Return where a truth possibly holds."""
    return truth.upper > 0.5


def below(x: Form, y: Form) -> Form:
    """Return the truth of x < y: 1, 0, or between 0 and 1 where it is undecided."""
    return _truth(x.upper < y.lower, x.lower < y.upper)


def at_most(x: Form, y: Form) -> Form:
    """Return the truth of x ≤ y."""
    return _truth(x.upper <= y.lower, x.lower <= y.upper)


def equal(x: Form, y: Form) -> Form:
    """Return the truth of x = y."""
    same = (x.reach == 0) & (y.reach == 0) & (x.center == y.center)
    return _truth(same, (x.lower <= y.upper) & (y.lower <= x.upper))


def opposite(x: Form) -> Form:
    """Return the opposite of a truth."""
    return _truth(~is_possible(x), ~is_certain(x))


def conjunction(x: Form, y: Form) -> Form:
    """Return whether both truths hold."""
    return _truth(is_certain(x) & is_certain(y), is_possible(x) & is_possible(y))


def alternative(x: Form, y: Form) -> Form:
    """Return whether one of two truths holds."""
    return opposite(conjunction(opposite(x), opposite(y)))


def choice(truth: Form, otherwise: Form, then: Form) -> Form:
    """Return one of two by a truth, and a set that contains both where that is undecided."""
    undecided = pick(is_possible(truth), both(otherwise, then), otherwise)
    return pick(is_certain(truth), then, undecided)
