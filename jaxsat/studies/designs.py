"""Designs: the points of a study's cases in the unit cube.

Every named quantity has coordinates of its own. Point `i` depends on the seed, `i` and the names
alone (and, for Latin hypercubes, on the study's size), whatever other points are requested.
"""

import abc
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.core import noise
from jaxsat.core.checks import require_counts
from jaxsat.core.once import latest

MAX_CASE_SIZE = 2**32 - 1
_BITS = 52


class AbstractDesign(eqx.Module):
    """A rule for points in the open unit cube."""

    seed: eqx.AbstractVar[int]

    @abc.abstractmethod
    def points(self, numbers: np.ndarray, dimensions: Mapping[str, int]) -> np.ndarray:
        """Points (cases, dimensions) of the cases `numbers`, with the coordinates name by name."""

    def noise(self, numbers: np.ndarray) -> np.ndarray:
        """Numbers that seed the noise of cases: the case numbers themselves."""
        return numbers


class Listed(AbstractDesign):
    """Cases from a list: `listed_points` (cases, dimensions), and the noise number of each."""

    seed: int = eqx.field(static=True)
    listed_points: np.ndarray
    listed_noise: np.ndarray

    def points(self, numbers: np.ndarray, dimensions: Mapping[str, int]) -> np.ndarray:
        """Rows of the list."""
        _require_numbers(numbers, len(self.listed_points) - 1)
        return self.listed_points[np.asarray(numbers)]

    def noise(self, numbers: np.ndarray) -> np.ndarray:
        """Noise numbers of the list."""
        return self.listed_noise[np.asarray(numbers)]


LAST_OF_SOBOL = 2**30 - 1
"""Largest number of a case in a Sobol sequence."""


class SamePoint(AbstractDesign):
    """Cases at one point of the unit cube, which differ in their noise alone."""

    seed: int = eqx.field(static=True)
    point: tuple[float, ...] = eqx.field(static=True)

    def points(self, numbers: np.ndarray, dimensions: Mapping[str, int]) -> np.ndarray:
        """The point once for each number."""
        _require_numbers(numbers)
        return np.broadcast_to(self.point, (len(numbers), len(self.point))).copy()


class Independent(AbstractDesign):
    """Independent draws; the case and the name are folded into the seed's key."""

    seed: int = eqx.field(static=True)

    def points(self, numbers: np.ndarray, dimensions: Mapping[str, int]) -> np.ndarray:
        """Points of uniform draws; each depends on its own case number alone."""
        _require_numbers(numbers)
        key = np.asarray(noise.key_of_seed(self.seed))
        own = _fold(key, np.asarray(numbers).astype(np.uint32))
        columns = [
            _draws(_fold(own, np.array(noise.name_number(name), np.uint32)), count)
            for name, count in dimensions.items()
        ]
        return _join(columns, len(numbers))


class Sobol(AbstractDesign):
    """Points of the Sobol sequence, each coordinate with a random digital shift.

    The shift depends on the seed and the name. A quantity added to a study may change the
    coordinate of the sequence that others take.
    """

    seed: int = eqx.field(static=True)

    def points(self, numbers: np.ndarray, dimensions: Mapping[str, int]) -> np.ndarray:
        """Points of SciPy's sequence, shifted; fast for consecutive `numbers`."""
        _require_numbers(numbers, LAST_OF_SOBOL)
        total = sum(dimensions.values())
        if not total or not len(numbers):
            return np.zeros((len(numbers), total))
        breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
        runs = np.split(np.asarray(numbers, dtype=np.int64), breaks)
        plain = np.concatenate([_sobol_run(total, int(run[0]), len(run)) for run in runs])
        shifts = [_shift(self.seed, name, count) for name, count in dimensions.items()]
        whole = (plain * 2.0**_BITS).astype(np.uint64) ^ np.concatenate(shifts)[None, :]
        return (whole.astype(np.float64) + 0.5) / 2.0**_BITS


class LatinHypercube(AbstractDesign):
    """One case in each of `size` equal slices of every coordinate, SciPy's `LatinHypercube`.

    The size is part of a case's identity. The coordinates of all cases are kept in memory.
    """

    seed: int = eqx.field(static=True)
    size: int = eqx.field(static=True)

    def __check_init__(self):
        require_counts(size=self.size)

    def points(self, numbers: np.ndarray, dimensions: Mapping[str, int]) -> np.ndarray:
        """Rows of the hypercube; raises `ValueError` for a case beyond its size."""
        _require_numbers(numbers, self.size - 1)
        columns = [
            _hypercube(self.seed, name, count, self.size)[np.asarray(numbers)]
            for name, count in dimensions.items()
        ]
        return _join(columns, len(numbers))


def open_uniform(key: noise.Key, count: int):
    """Uniform draws in the open interval (0, 1): the centres of the cells of `noise.uniform`."""
    draws = noise.uniform(key, count)
    return draws + jnp.finfo(draws.dtype).epsneg


def _fold(key: Any, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`noise.fold_in` by NumPy: a key (two words) for every number, or for every key given."""
    return noise.threefry(key, np.zeros_like(numbers), numbers)


def _draws(keys: tuple[np.ndarray, np.ndarray], count: int) -> np.ndarray:
    """`open_uniform` by NumPy, without compilation: (keys, count)."""
    low = np.arange(count, dtype=np.uint32)[None, :]
    first, second = noise.threefry([word[:, None] for word in keys], np.zeros_like(low), low)
    dtype = jax.dtypes.canonicalize_dtype(float)
    info = np.finfo(dtype)
    words = first ^ second
    if info.bits == 64:
        words = first.astype(np.uint64) << np.uint64(32) | second
    one = np.ones((), dtype).view(words.dtype)
    mantissa = words >> words.dtype.type(info.bits - info.nmant)
    return (mantissa | one).view(dtype) - dtype.type(1) + info.epsneg


@latest(64)
def _hypercube(seed: int, name: str, count: int, size: int) -> np.ndarray:
    from scipy.stats import qmc  # takes its time, and most studies draw independently

    generator = np.random.Generator(np.random.Philox(_name_seed(seed, name)))
    draws = qmc.LatinHypercube(count, rng=generator).random(size)
    return np.clip(draws, 2.0**-53, 1 - 2.0**-53)


def _sobol_run(dimension: int, first: int, count: int) -> np.ndarray:
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimension, scramble=False)
    if first:
        sequence.fast_forward(first)
    # SciPy warns of a first piece that is not a power of two, but not of one number
    return np.concatenate([sequence.random(1), sequence.random(count - 1)])


def _shift(seed: int, name: str, count: int) -> np.ndarray:
    generator = np.random.Generator(np.random.Philox(_name_seed(seed, name)))
    return generator.integers(0, 2**_BITS, size=count, dtype=np.uint64)


def _name_seed(seed: int, name: str) -> list[int]:
    return [seed, noise.name_number(name)]


def _join(columns: list[np.ndarray], count: int) -> np.ndarray:
    return np.concatenate([np.zeros((count, 0)), *columns], axis=1)


def _require_numbers(numbers: np.ndarray, largest: int = MAX_CASE_SIZE) -> None:
    numbers = np.asarray(numbers)
    if len(numbers) and not (numbers.min() >= 0 and numbers.max() <= largest):
        raise ValueError(
            f"Case numbers must be from 0 to {largest}, but got {numbers.min()} to {numbers.max()}."
        )
