"""Result of a verification: verdicts on requirements by condition, and recoveries by failure."""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from jaxsat.core.checks import require_counts
from jaxsat.core.errors import ArgumentError
from jaxsat.report.document import Document
from jaxsat.report.printers import notebook_text
from jaxsat.report.verification_document import verification_document
from jaxsat.studies.statistics import Interval, WhenDecided
from jaxsat.synthesis.execution import plain_data

VerdictName = Literal["met", "violated", "undecided", "not judged", "not tried"]

Severity = Literal["critical", "major", "minor"]

ORDER: tuple[VerdictName, ...] = ("violated", "undecided", "not judged", "met", "not tried")
"""Verdicts, the worst first; a condition that does not try a requirement overrides none."""


@dataclass(frozen=True)
class Criterion:
    """Criterion of each requirement: met by at least `fraction` of all cases.

    `confidence` is that for all requirements and conditions together; each condition flies at most
    `cases` cases. Raises `ArgumentError` for invalid numbers.
    """

    fraction: float = 0.99
    confidence: float = 0.95
    cases: int = 20_000

    def __post_init__(self):
        for name, low in (("fraction", 0.0), ("confidence", 0.5)):
            if not low < getattr(self, name) < 1:
                raise ArgumentError(name, f"must be between {low:g} and 1", getattr(self, name))
        require_counts(cases=self.cases)

    def rule(self, decisions: int) -> WhenDecided:
        """Return the stop rule for this number of joint decisions."""
        return WhenDecided(self.fraction, decisions, 2 * self.confidence - 1)


class Demonstration(NamedTuple):
    """Evidence of one condition on a requirement.

    Of `cases` cases `met` have a margin from 0 on; `fraction` is theirs with the interval of the
    sequential test, None for a single run. The least `margin`, in `unit`, was decided by `signal`
    at `time` (s) in the case `worst`; it is NaN where a run ended before it was judged, and
    infinite where there was nothing to judge. `command` flies the case again.
    """

    requirement: str
    condition: str
    verdict: VerdictName
    cases: int
    met: int
    fraction: Interval | None
    margin: float
    unit: str
    signal: str
    time: float
    worst: int | None
    command: str


class FailureRow(NamedTuple):
    """Outcome of one kind of failure of one device, or of two, over the cases that drew it.

    `severity` is "critical" if some case does not recover, "major" if all recover but some violate
    a requirement, else "minor". The times (s) are medians: from the failure to its detection, and
    until recovered cases had settled; NaN where there are none. `detected` and `isolated` are None
    for a law that does not diagnose. `left` is the most frequent class of remaining torques,
    `propellant` (kg) a median or NaN. `met` counts the cases that meet each requirement. `margin`,
    in `unit`, is the least one of the `requirement` that fewest meet, in the case `worst`;
    `command` flies it again.
    """

    device: str
    failure: str
    severity: Severity
    cases: int
    left: str
    detected: int | None
    detection_time: float
    isolated: int | None
    recovered: int
    settling_time: float
    propellant: float
    met: dict[str, int]
    requirement: str
    margin: float
    unit: str
    worst: int
    command: str


class Verification(NamedTuple):
    """Result of a verification; `sentences` are the requirements' texts, by id.

    `not_tried` has sentences on conditions that were left out.
    """

    title: str
    demand: Criterion
    sentences: dict[str, str]
    shown: list[Demonstration]
    failures: list[FailureRow]
    not_tried: list[str]

    _repr_markdown_ = notebook_text

    @property
    def document(self) -> Document:
        """The document that `jaxsat verify` prints."""
        return verification_document(plain_data(self))

    def verdict(self, requirement: str) -> VerdictName:
        """Return the worst verdict on a requirement under any condition."""
        verdicts = {one.verdict for one in self.shown if one.requirement == requirement}
        return next(one for one in ORDER if one in verdicts)

    @property
    def verdicts(self) -> dict[str, VerdictName]:
        """The verdict on each requirement."""
        return {name: self.verdict(name) for name in self.sentences}

    @property
    def verified(self) -> bool:
        """Whether every requirement is met under every condition."""
        return set(self.verdicts.values()) == {"met"}

    def as_data(self) -> dict[str, Any]:
        """Return the data of a record, see `plain_data`."""
        requirements = [
            {"id": name, "text": text, "verdict": self.verdict(name)}
            for name, text in self.sentences.items()
        ]
        data = self._asdict() | {"requirements": requirements}
        del data["sentences"]
        return data
