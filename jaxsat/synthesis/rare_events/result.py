"""How probable it is that a requirement is violated: the estimate, and whether to trust it."""

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from jaxsat.core.errors import ArgumentError
from jaxsat.studies.splitting import LENGTH
from jaxsat.studies.statistics import Interval

LEAST_CASES, LEAST_REPLICATIONS = 100, 3


@dataclass(frozen=True)
class EstimateSettings:
    """How an estimate is made: `cases` of a population, so many independent `replications`, the
    `least` probability that is looked for, and the `confidence` of the interval.

    Raises `ArgumentError` for numbers that cannot be.
    """

    cases: int = 1000
    replications: int = 10
    least: float = 1e-9
    confidence: float = 0.95

    def __post_init__(self):
        if self.cases < LEAST_CASES or self.cases % LENGTH:
            rule = f"must be at least {LEAST_CASES}, in steps of {LENGTH}"
            raise ArgumentError("cases", rule, self.cases)
        if self.replications < LEAST_REPLICATIONS:
            rule = f"must be at least {LEAST_REPLICATIONS}"
            raise ArgumentError("replications", rule, self.replications)
        for name in ("least", "confidence"):
            if not 0 < getattr(self, name) < 1:
                raise ArgumentError(name, "must be between 0 and 1", getattr(self, name))


class LevelRow(NamedTuple):
    """A `margin`, in the unit of the requirement, and how probable it is not to exceed it.

    `fractions` are those of each replication, given the level before. `moved` and `redrawn` are the
    parts of the proposed cases that were accepted on the way to the next level; NaN without any.
    """

    margin: float
    probability: float
    fractions: list[float]
    moved: float
    redrawn: float


class Difference(NamedTuple):
    """How violating cases differ from all in a drawn quantity.

    `distance` is the largest difference of their distribution functions, from 0 to 1. Both
    distributions are given by their values at `PERCENTS`, or where `shares` is not empty by the
    shares of (value, of all, of the violating).
    """

    quantity: str
    unit: str
    distance: float
    everywhere: list[float]
    violating: list[float]
    shares: list[tuple[float, float, float]]


class RareEvent(NamedTuple):
    """The probability that a requirement is violated.

    `estimates` are those of the replications, of which `probability` is the mean with its interval.
    `violating` flights descend from so many `independent` draws.
    `doubts` say why the interval may not hold; without any it is `trusted`. The margins of `levels`
    go down to zero, and `differences` say where in the space of the draws cases violate, the
    clearest first. `worst` is the violating case with the least `margin`, in `unit`, and `command`
    flies it again; None, NaN and "" where no case violates.
    """

    title: str
    requirement: str
    sentence: str
    settings: EstimateSettings
    probability: Interval
    estimates: list[float]
    flights: int
    violating: int
    independent: int
    doubts: list[str]
    levels: list[LevelRow]
    differences: list[Difference]
    worst: int | None
    margin: float
    unit: str
    again: str

    @property
    def trusted(self) -> bool:
        """Whether nothing is known that speaks against the interval."""
        return not self.doubts

    def as_data(self) -> dict[str, Any]:
        """Plain data for a record, but for numbers that are not finite."""
        return {
            **self._asdict(),
            "settings": asdict(self.settings),
            "levels": [one._asdict() for one in self.levels],
            "differences": [one._asdict() for one in self.differences],
        }
