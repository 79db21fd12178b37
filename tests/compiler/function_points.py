"""Arguments over the whole domain of every elementary function."""

import numpy as np

TWO_ARGUMENTS = ("atan2", "pow")


def _spread(rng: np.random.Generator, least: float, most: float, count: int) -> np.ndarray:
    """Both signs, evenly over the logarithms."""
    sizes = np.exp(rng.uniform(np.log(least), np.log(most), count))
    return sizes * rng.choice([-1.0, 1.0], count)


def _any_double(rng: np.random.Generator, count: int) -> np.ndarray:
    numbers = rng.integers(0, 2**64, count, dtype=np.uint64).view(float)
    return numbers[np.isfinite(numbers)]


def _near(points, rng: np.random.Generator, count: int) -> np.ndarray:
    """Doubles within some units of the points where a function changes its formula."""
    bits = np.repeat(np.asarray(points, float), count).view(np.int64)
    return (bits + rng.integers(-1000, 1000, bits.size)).view(float)


def points(name: str, rng: np.random.Generator, count: int) -> np.ndarray:
    if name in ("sin", "cos", "tan"):
        multiples = np.arange(1, count // 4 + 1) * (np.pi / 2)
        worst = [6381956970095103 * 2.0**797, 5.31937264832654141671e255, 2.0**20, 1e22]
        return np.concatenate(
            [
                *(rng.uniform(-10, 10, count), _spread(rng, 1e-5, 1e9, count), multiples, worst),
                *(_any_double(rng, count), _near([2.0**20, np.pi / 4], rng, 20)),
            ]
        )
    if name == "acosh":
        from_one = [rng.uniform(1, 4, count), 1 + np.abs(_spread(rng, 1e-15, 1.0, count))]
        large = np.exp(rng.uniform(0, 709, count))
        return np.concatenate([*from_one, large, _near([1.5, 2.0**28], rng, 20)])
    if name in ("asin", "acos", "atanh", "erf_inv"):
        ends = 1 - np.abs(_spread(rng, 1e-16, 0.3, count))
        middle = _near([0.5, 0.99903], rng, 20)
        return np.concatenate(
            [rng.uniform(-1, 1, count), ends, -ends, _spread(rng, 1e-300, 1.0, count), middle]
        )
    if name in ("log", "log1p"):
        near_one = 1 + _spread(rng, 1e-12, 0.5, count)
        every = np.abs(_any_double(rng, count))
        shift = 1.0 if name == "log1p" else 0.0
        close = _spread(rng, 1e-300, 0.9, count) if shift else _near([0.7071, 1.4142], rng, 20)
        return np.concatenate([rng.uniform(0.01, 4, count) - shift, near_one - shift, every, close])
    if name in ("erf", "erfc"):
        edges = _near([0.5, 0.9, 4.0], rng, 20)
        tail = rng.uniform(4, 28, count)
        small = _spread(rng, 1e-300, 1.0, count)
        return np.concatenate([rng.uniform(-6, 6, count), tail, small, edges, -edges])
    edges = _near([0.34657, 0.5, 0.55, 1.0, 22.0, 2.0**28], rng, 20)
    large = rng.uniform(-740, 705, count)
    return np.concatenate(
        [rng.uniform(-3, 3, count), large, _spread(rng, 1e-300, 30, count), edges]
        + ([_any_double(rng, count)] if name in ("asinh", "atan", "cbrt") else [])
    )


def _pairs(name: str, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    if name == "atan2":
        first = [rng.uniform(-2, 2, count), _spread(rng, 1e-4, 1e4, count)]
        second = [rng.uniform(-2, 2, count), _spread(rng, 1e-4, 1e4, count)]
    else:
        first = [rng.uniform(0, 4, count), 1 + _spread(rng, 1e-9, 0.4, count)]
        second = [rng.uniform(-20, 20, count), _spread(rng, 1, 1e9, count)]
        first += [rng.uniform(-4, 4, count), np.exp(rng.uniform(-700, 700, count))]
        second += [rng.integers(-30, 30, count).astype(float), rng.uniform(-1, 1, count)]
    numbers, others = _any_double(rng, count), _any_double(rng, count)
    both = min(numbers.size, others.size)
    return np.concatenate([*first, numbers[:both]]), np.concatenate([*second, others[:both]])


def arguments_of(name: str, seed: int, count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    return _pairs(name, rng, count) if name in TWO_ARGUMENTS else (points(name, rng, count),)
