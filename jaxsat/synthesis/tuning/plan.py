"""What a tuning run is: the laws it runs, the cases it takes, and how it descends."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.synthesis.tuning.aggregates import Mean, Objective
from jaxsat.synthesis.tuning.cost_evaluator import CostEvaluator
from jaxsat.synthesis.tuning.parameters import SearchSpace

FIRST_VALIDATION_CASE = 2**29
"""Cases from this number on choose the best iterate; those below it are trained on."""

FIRST_RECEIPT_CASE = FIRST_VALIDATION_CASE + 2**28
"""Cases from this number on check the gradients."""


@dataclass(frozen=True)
class TuningSettings:
    """How a run descends; see `docs/tuning.md`.

    `horizons` are numbers of intervals, each used for an equal share of the steps, the last one
    the whole run. `screening_cases` of the first step's cases choose the starts (None: all), and
    `halvings` are steps at which the worse half of the starts is given up. A run ends early when
    the loss on the validation cases is down to `target`. `baseline_cases` and
    `baseline_trajectories` are what other methods take in a round and in all (None: as the
    descent).
    """

    objective: Objective = field(default_factory=lambda: Objective(Mean()))
    descent: OptimiserSettings = field(default_factory=OptimiserSettings)
    steps: int = 60
    cases: int = 32
    fresh: bool = True
    starts: int = 4
    screened: int = 32
    screening_cases: int | None = None
    horizons: tuple[int, ...] = ()
    halvings: tuple[int, ...] = ()
    validation_cases: int = 128
    validate_every: int = 5
    receipt_cases: int = 16
    held_out_cases: int = 1024
    alarm: float | None = None
    target: float | None = None
    baseline_cases: int | None = None
    baseline_trajectories: int | None = None
    seed: int = 0

    def __post_init__(self):
        for name in (
            "steps",
            "cases",
            "starts",
            "validation_cases",
            "validate_every",
            "receipt_cases",
            "held_out_cases",
        ):
            if getattr(self, name) < 1:
                raise ValueError(
                    f"Argument `{name}` must be at least 1, but got {getattr(self, name)}."
                )
        if self.screened and self.screened < self.starts:
            raise ValueError(
                f"Argument `screened` must be 0 or at least `starts` = {self.starts}, "
                f"but got {self.screened}."
            )

    def numbers(self, step: int) -> np.ndarray:
        """The cases of a step: the next ones, or always the first."""
        first = step * self.cases if self.fresh else 0
        return np.arange(first, first + self.cases)

    def screening(self) -> np.ndarray:
        """The cases on which starts are chosen: those of the first step, or the first of them."""
        return self.numbers(0)[: self.screening_cases]

    def validation(self) -> np.ndarray:
        """The cases by which iterates are compared."""
        return FIRST_VALIDATION_CASE + np.arange(self.validation_cases)

    def reached(self, loss: float) -> bool:
        """Whether a loss on the validation cases is the target's."""
        return self.target is not None and loss <= self.target

    def intervals(self, step: int, whole: int) -> int:
        """How long the runs of a step are, in intervals of the program."""
        if not self.horizons:
            return whole
        stage = min(step * len(self.horizons) // self.steps, len(self.horizons) - 1)
        return self.horizons[stage]


@dataclass(frozen=True)
class TuningPlan:
    """All that a run needs.

    `smooth` is what gradients are taken of, `exact` the law as it will fly under the same bounded
    cost, `refined` the smooth law in finer steps, and `held_out` the exact law under the plain cost
    with cases of a seed that is never tuned on; `trained_on` is the same for the seed of the
    training. `widths` says how the smooth law is rounded; `description` is plain data that tells
    runs apart, `remark` something to be told about the engine.
    """

    space: SearchSpace
    start: np.ndarray
    smooth: CostEvaluator
    exact: CostEvaluator
    refined: CostEvaluator
    held_out: CostEvaluator
    trained_on: CostEvaluator
    settings: TuningSettings
    widths: Mapping[str, float] = field(default_factory=dict)
    description: Mapping[str, Any] = field(default_factory=dict)
    remark: str | None = None

    @property
    def intervals(self) -> int:
        """Intervals of the whole horizon."""
        return self.smooth.program.intervals
