"""How much a design computes, and by which seeds."""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from jaxsat.core.checks import require_counts
from jaxsat.scenario.build.study import EngineName

SCREENING_CASES, VALIDATION_CASES, SURE_CASES = 500, 1000, 2000

MAX_SEED = 2**63 - 4
"""So that three more follow which a scenario can have."""

Attitude = Literal["wanted", "nearest"]
Goal = Literal["quickest", "settled"]


class Seeds(NamedTuple):
    """One for every step, so that no step sees the cases of another."""

    screening: int
    tuning: int
    validation: int
    verification: int


@dataclass(frozen=True)
class DesignSettings:
    """What is asked of a design.

    `law` is one law, "all" or "quick", `settled` the fraction of cases that must settle, `cases`
    those of the verification, `steps` those of the tuner (0 leaves tuning out). With `attitude`
    "nearest" the controller is designed for the nearest attitude that can be held. The `goal`
    "quickest" is the quickest law of those that settle most; "settled" is done with the first one
    that surely settles the wanted fraction. Raises `ValueError` for numbers that cannot be.
    """

    law: str
    settled: float = 0.99
    cases: int = 2000
    steps: int = 16
    seed: int = 0
    attitude: Attitude = "wanted"
    goal: Goal = "quickest"
    engine: EngineName = "auto"

    def __post_init__(self):
        require_counts(cases=self.cases)
        if self.steps < 0:
            raise ValueError(f"Argument `steps` must not be negative, but got {self.steps}.")
        if not 0 <= self.seed <= MAX_SEED:
            raise ValueError(f"Argument `seed` must be from 0 to {MAX_SEED}, but got {self.seed}.")
        if not 0 < self.settled <= 1:
            raise ValueError(
                f"Argument `settled` must be above 0 and at most 1, but got {self.settled}."
            )
        if self.attitude not in ("wanted", "nearest"):
            raise ValueError(
                f"Argument `attitude` must be wanted or nearest, but got {self.attitude}."
            )
        if self.goal not in ("quickest", "settled"):
            raise ValueError(f"Argument `goal` must be quickest or settled, but got {self.goal}.")

    @property
    def seeds(self) -> Seeds:
        """Consecutive ones from `seed` on."""
        return Seeds(*range(self.seed, self.seed + 4))

    @property
    def screening_cases(self) -> int:
        """Cases on which candidates are screened, at most."""
        return min(SCREENING_CASES if self.goal == "quickest" else SURE_CASES, self.cases)

    @property
    def validation_cases(self) -> int:
        """Cases on which tuned gains must be better."""
        return min(VALIDATION_CASES, self.cases)

    def identity(self) -> dict[str, Any]:
        """What a folder is resumed by: all but the verification's size."""
        return {
            "goal": self.goal,
            "settled": self.settled,
            "law": self.law,
            "steps": self.steps,
            "seed": self.seed,
            "attitude": self.attitude,
            "engine": self.engine,
            "screening_cases": self.screening_cases,
            "validation_cases": self.validation_cases,
        }
