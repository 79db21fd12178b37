"""Probability of violating a requirement: the estimate, and reasons to doubt it."""

from dataclasses import dataclass
from typing import NamedTuple

from jaxsat.core.errors import ArgumentError
from jaxsat.report.document import Document
from jaxsat.report.printers import notebook_text
from jaxsat.report.rare_event_document import rare_event_document
from jaxsat.studies.splitting import LENGTH
from jaxsat.studies.statistics import Interval
from jaxsat.synthesis.execution import plain_data

LEAST_CASES, LEAST_REPLICATIONS = 100, 3


@dataclass(frozen=True)
class EstimateSettings:
    """Settings of an estimate, checked at construction.

    `cases` of a population, number of independent `replications`, `least` probability of interest,
    `confidence` of the interval. Raises `ArgumentError` for invalid numbers.
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
    """A `margin`, in the unit of the requirement, and the probability of not exceeding it.

    `fractions` are those of each replication, given the level before. `moved` and `redrawn` are the
    accepted fractions of proposed cases on the way to the next level; NaN without any.
    """

    margin: float
    probability: float
    fractions: list[float]
    moved: float
    redrawn: float


class Difference(NamedTuple):
    """Difference of violating cases from all in a drawn quantity.

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
    """The probability of violating a requirement.

    `estimates` are those of the replications, of which `probability` is the mean with its interval.
    `violating` flights descend from `independent` draws. `doubts` are reasons to distrust the
    interval; without any it is `trusted`. The margins of `levels` go down to zero, and
    `differences` describe the violating cases in the space of the draws, the clearest first.
    `worst` is the violating case with the least `margin`, in `unit`, and the command `again` flies
    it; None, NaN and "" where no case violates.
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

    _repr_markdown_ = notebook_text

    @property
    def document(self) -> Document:
        """The document that `jaxsat rare` prints."""
        return rare_event_document(plain_data(self))

    @property
    def trusted(self) -> bool:
        """Whether there is no reason to distrust the interval."""
        return not self.doubts
