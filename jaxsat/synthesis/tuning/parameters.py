"""Tuned numbers: their paths in the controller, bounds, and the search space."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Values = Float[np.ndarray, "*points parameters"]
"""Numbers of the controller, one column for each entry of a parameter."""

SCALES = ("log", "logit")
AT_BOUND = 0.01
"""Distance to a bound, over the range, within which a value counts as at it."""

MAX_LOGIT = 12.0
"""Largest logit: beyond it values are within 1e-5 of a bound, without slope."""


@dataclass(frozen=True)
class TunedParameter:
    """A tuned number, or array of numbers, at a dotted `name` inside the controller.

    The search variable is the logarithm of its value, clipped at the bounds ("log"), or the logit
    of its place between them ("logit"), which never reaches the bounds. `shape` is that of the
    array, `label` its displayed name.
    """

    name: str
    low: float
    high: float
    scale: str = "log"
    shape: tuple[int, ...] = ()
    label: str = ""
    unit: str = "1"

    def __post_init__(self):
        if self.scale not in SCALES:
            raise ValueError(f"Argument `scale` must be one of {SCALES}, but got {self.scale!r}.")
        if not -np.inf < self.low < self.high < np.inf:
            raise ValueError(
                f"The bounds of {self.name} must be low < high, but got {self.low}, {self.high}."
            )
        if self.scale == "log" and not self.low > 0:
            raise ValueError(
                f"The bounds of {self.name} must be positive in log scale, but got {self.low}."
            )

    @property
    def size(self) -> int:
        """Number of entries."""
        return int(np.prod(self.shape, dtype=int))

    def to_search(self, values: np.ndarray) -> np.ndarray:
        """Return search points of values, clipped to the bounds."""
        values = np.clip(values, self.low, self.high)
        if self.scale == "log":
            return np.log(values)
        share = (values - self.low) / (self.high - self.low)
        with np.errstate(divide="ignore"):
            return np.clip(np.log(share) - np.log1p(-share), -MAX_LOGIT, MAX_LOGIT)

    def to_values(self, points: np.ndarray) -> np.ndarray:
        """Return the values of search points, within the bounds."""
        if self.scale == "log":
            return np.clip(np.exp(points), self.low, self.high)
        share = 0.5 * (1 + np.tanh(points / 2))
        return self.low + (self.high - self.low) * share

    def slope(self, points: np.ndarray) -> np.ndarray:
        """Return the derivative of the values along the search."""
        if self.scale == "log":
            return np.exp(points)
        share = 0.5 * (1 + np.tanh(points / 2))
        return (self.high - self.low) * share * (1 - share)

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest search point."""
        if self.scale == "log":
            return float(np.log(self.low)), float(np.log(self.high))
        return -MAX_LOGIT, MAX_LOGIT

    def projected(self, points: np.ndarray) -> np.ndarray:
        """Return the nearest points within the search space."""
        return np.clip(points, *self.ends)

    def place(self, values: np.ndarray) -> np.ndarray:
        """Return the place of values between the bounds, 0 to 1, in log scale by logarithms."""
        low, high = self.low, self.high
        if self.scale == "log":
            values, low, high = np.log(values), np.log(low), np.log(high)
        return (values - low) / (high - low)

    def drawn(self, uniform: np.ndarray) -> np.ndarray:
        """Map uniform numbers in (0, 1) to values: log-uniform, or uniform between the bounds."""
        if self.scale == "log":
            return self.low * (self.high / self.low) ** uniform
        return self.low + (self.high - self.low) * uniform


@dataclass(frozen=True)
class SearchSpace:
    """All parameters side by side, as vectors with one entry for each number."""

    parameters: tuple[TunedParameter, ...]

    def __post_init__(self):
        names = [parameter.name for parameter in self.parameters]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"Parameters must be some, each named once, but got {names}.")

    @property
    def size(self) -> int:
        """Number of tuned numbers."""
        return sum(parameter.size for parameter in self.parameters)

    @property
    def labels(self) -> tuple[str, ...]:
        """A name for every number, entries of arrays counted from 1."""
        labels: list[str] = []
        for parameter in self.parameters:
            name = parameter.label or parameter.name
            several = [f"{name}[{i + 1}]" for i in range(parameter.size)]
            labels += [name] if parameter.shape == () else several
        return tuple(labels)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every number."""
        return tuple(p.unit for p in self.parameters for _ in range(p.size))

    @property
    def scales(self) -> tuple[str, ...]:
        """Scale of every number."""
        return tuple(p.scale for p in self.parameters for _ in range(p.size))

    def to_search(self, values: Values) -> Values:
        """Return the search points of values."""
        return self._by_parameter("to_search", values)

    def to_values(self, points: Values) -> Values:
        """Return the values of search points."""
        return self._by_parameter("to_values", points)

    def slope(self, points: Values) -> Values:
        """Return derivatives of the values along the search, entry by entry."""
        return self._by_parameter("slope", points)

    @property
    def ends(self) -> tuple[Float[np.ndarray, " parameters"], Float[np.ndarray, " parameters"]]:
        """Least and largest search point."""
        low, high = np.array([p.ends for p in self.parameters for _ in range(p.size)]).T
        return low, high

    def projected(self, points: Values) -> Values:
        """Return the nearest points within the search space."""
        return self._by_parameter("projected", points)

    def drawn(self, count: int, seed: int) -> Values:
        """Draw `count` values between the bounds, log-uniform for those in log scale."""
        uniform = np.random.default_rng(seed).uniform(size=(count, self.size))
        return self._by_parameter("drawn", uniform)

    def at_bounds(self, values: Float[np.ndarray, " parameters"]) -> dict[str, float]:
        """Return the bound of every number that is at one, by label."""
        places = self._by_parameter("place", values)
        lows, highs = (
            np.array([getattr(p, end) for p in self.parameters for _ in range(p.size)])
            for end in ("low", "high")
        )
        nearest = np.where(places < 0.5, lows, highs)
        close = np.abs(places - np.round(places)) < AT_BOUND
        return {self.labels[i]: float(nearest[i]) for i in np.flatnonzero(close)}

    def gains(self, values: Values) -> dict[str, np.ndarray]:
        """Return values by name, as engines take them, with the leading axes of `values`."""
        return {
            parameter.name: columns.reshape((*values.shape[:-1], *parameter.shape))
            for parameter, columns in self._columns(values)
        }

    def joined(self, gains: Mapping[str, np.ndarray], leading: Sequence[int]) -> Values:
        """Invert `gains`: one column for each number, after the axes `leading`."""
        parts = [np.asarray(gains[p.name]).reshape((*leading, p.size)) for p in self.parameters]
        return np.concatenate(parts, axis=-1)

    def _columns(self, values: Values):
        ends = np.cumsum([0, *(parameter.size for parameter in self.parameters)])
        for parameter, begin, end in zip(self.parameters, ends, ends[1:], strict=False):
            yield parameter, values[..., begin:end]

    def _by_parameter(self, method: str, values: Values) -> Values:
        parts = [getattr(p, method)(columns) for p, columns in self._columns(values)]
        return np.concatenate(parts, axis=-1)
