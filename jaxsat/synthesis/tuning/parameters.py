"""The numbers that are tuned: names inside the controller, bounds, and the space searched."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Values = Float[np.ndarray, "*points parameters"]
"""Numbers of the controller, one column for each entry of a parameter."""

SCALES = ("log", "logit")
AT_BOUND = 0.01
"""Values in the outermost hundredth of their range count as at its end."""

MAX_LOGIT = 12.0
"""Logits beyond ±this are within 1e-5 of a bound, where they would have no slope left."""


@dataclass(frozen=True)
class TunedParameter:
    """A tuned number, or array of numbers, at a dotted `name` inside the controller.

    It is searched in the logarithm of its value, cut off at the bounds ("log"), or in the logit of
    its place between them ("logit"), where the bounds are never reached. `shape` is that of the
    array, `label` its name for a person.
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
        """How many numbers it has."""
        return int(np.prod(self.shape, dtype=int))

    def to_search(self, values: np.ndarray) -> np.ndarray:
        """The points of the search of values, which are taken into the bounds."""
        values = np.clip(values, self.low, self.high)
        if self.scale == "log":
            return np.log(values)
        share = (values - self.low) / (self.high - self.low)
        with np.errstate(divide="ignore"):
            return np.clip(np.log(share) - np.log1p(-share), -MAX_LOGIT, MAX_LOGIT)

    def to_values(self, points: np.ndarray) -> np.ndarray:
        """The values of points of the search, within the bounds."""
        if self.scale == "log":
            return np.clip(np.exp(points), self.low, self.high)
        share = 0.5 * (1 + np.tanh(points / 2))
        return self.low + (self.high - self.low) * share

    def slope(self, points: np.ndarray) -> np.ndarray:
        """Derivative of the values along the search."""
        if self.scale == "log":
            return np.exp(points)
        share = 0.5 * (1 + np.tanh(points / 2))
        return (self.high - self.low) * share * (1 - share)

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest point that the search may be at."""
        if self.scale == "log":
            return float(np.log(self.low)), float(np.log(self.high))
        return -MAX_LOGIT, MAX_LOGIT

    def projected(self, points: np.ndarray) -> np.ndarray:
        """The nearest points that the search may be at."""
        return np.clip(points, *self.ends)

    def place(self, values: np.ndarray) -> np.ndarray:
        """The place of values between the bounds, 0 to 1, of their logarithms in log scale."""
        low, high = self.low, self.high
        if self.scale == "log":
            values, low, high = np.log(values), np.log(low), np.log(high)
        return (values - low) / (high - low)

    def drawn(self, uniform: np.ndarray) -> np.ndarray:
        """Values from numbers uniform in (0, 1): log-uniform, or uniform between the bounds."""
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
        """How many numbers are tuned."""
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
        """The unit of every number."""
        return tuple(p.unit for p in self.parameters for _ in range(p.size))

    @property
    def scales(self) -> tuple[str, ...]:
        """The scale of every number."""
        return tuple(p.scale for p in self.parameters for _ in range(p.size))

    def to_search(self, values: Values) -> Values:
        """The points of the search of values."""
        return self._by_parameter("to_search", values)

    def to_values(self, points: Values) -> Values:
        """The values of points of the search."""
        return self._by_parameter("to_values", points)

    def slope(self, points: Values) -> Values:
        """Derivatives of the values along the search, entry by entry."""
        return self._by_parameter("slope", points)

    @property
    def ends(self) -> tuple[Float[np.ndarray, " parameters"], Float[np.ndarray, " parameters"]]:
        """The least and the largest point that the search may be at."""
        low, high = np.array([p.ends for p in self.parameters for _ in range(p.size)]).T
        return low, high

    def projected(self, points: Values) -> Values:
        """The nearest points that the search may be at."""
        return self._by_parameter("projected", points)

    def drawn(self, count: int, seed: int) -> Values:
        """`count` random values between the bounds, log-uniform for those in log scale."""
        uniform = np.random.default_rng(seed).uniform(size=(count, self.size))
        return self._by_parameter("drawn", uniform)

    def at_bounds(self, values: Float[np.ndarray, " parameters"]) -> dict[str, float]:
        """The bound of every number that is at one, by label."""
        places = self._by_parameter("place", values)
        lows, highs = (
            np.array([getattr(p, end) for p in self.parameters for _ in range(p.size)])
            for end in ("low", "high")
        )
        nearest = np.where(places < 0.5, lows, highs)
        close = np.abs(places - np.round(places)) < AT_BOUND
        return {self.labels[i]: float(nearest[i]) for i in np.flatnonzero(close)}

    def gains(self, values: Values) -> dict[str, np.ndarray]:
        """Values by name, as engines take them, with the leading axes of `values`."""
        return {
            parameter.name: columns.reshape((*values.shape[:-1], *parameter.shape))
            for parameter, columns in self._columns(values)
        }

    def joined(self, gains: Mapping[str, np.ndarray], leading: Sequence[int]) -> Values:
        """The opposite of `gains`: one column for each number, after the axes `leading`."""
        parts = [np.asarray(gains[p.name]).reshape((*leading, p.size)) for p in self.parameters]
        return np.concatenate(parts, axis=-1)

    def _columns(self, values: Values):
        ends = np.cumsum([0, *(parameter.size for parameter in self.parameters)])
        for parameter, begin, end in zip(self.parameters, ends, ends[1:], strict=False):
            yield parameter, values[..., begin:end]

    def _by_parameter(self, method: str, values: Values) -> Values:
        parts = [getattr(p, method)(columns) for p, columns in self._columns(values)]
        return np.concatenate(parts, axis=-1)
