"""Plan of a tuning run: objective over many cases, variants of the law, cases and settings."""

import abc
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.synthesis.tuning.cost_evaluator import CostEvaluator
from jaxsat.synthesis.tuning.parameters import SearchSpace

Costs = Float[np.ndarray, " cases"]


class AbstractAggregate(abc.ABC):
    """A weighted sum of costs whose weights depend on the order of the costs alone.

    Its derivative is the sum of the costs' derivatives with the same weights, wherever no two costs
    are equal.
    """

    @abc.abstractmethod
    def weights(self, costs: Costs) -> Costs:
        """Return weights that sum to one."""

    def __call__(self, costs: Costs) -> float:
        """Return the weighted sum."""
        return float(np.sum(self.weights(costs) * costs))


@dataclass(frozen=True)
class Mean(AbstractAggregate):
    """Mean of the costs."""

    def weights(self, costs: Costs) -> Costs:
        """Return equal weights."""
        return np.full(len(costs), 1 / len(costs))


@dataclass(frozen=True)
class ConditionalValueAtRisk(AbstractAggregate):
    """Mean of the worst fraction 1 - α of the cases: conditional value at risk, CVaR(α).

    R. T. Rockafellar, S. Uryasev, J. Risk 2, 2000.
    """

    level: float

    def __post_init__(self):
        _require_level(self.level)

    def weights(self, costs: Costs) -> Costs:
        """Return equal weights on the worst cases, the last of which may count in part."""
        share = (1 - self.level) * len(costs)
        shares = np.clip(share - np.arange(len(costs)), 0, 1) / share
        return _in_order(shares, np.argsort(-costs, kind="stable"))


@dataclass(frozen=True)
class Quantile(AbstractAggregate):
    """Cost that a fraction `level` of the cases do not exceed, linear between cases."""

    level: float

    def __post_init__(self):
        _require_level(self.level)

    def weights(self, costs: Costs) -> Costs:
        """Return weights of the two cases beside the quantile."""
        place = self.level * (len(costs) - 1)
        distance = np.abs(np.arange(len(costs)) - place)
        return _in_order(np.clip(1 - distance, 0, 1), np.argsort(costs, kind="stable"))


@dataclass(frozen=True)
class LargestCost(AbstractAggregate):
    """Largest cost."""

    def weights(self, costs: Costs) -> Costs:
        """Return a weight of one on the worst case."""
        return (np.arange(len(costs)) == np.argmax(costs)).astype(float)


@dataclass(frozen=True)
class TailCompression:
    """The cost itself, or, with a `scale`, scale · log(1 + cost/scale)."""

    scale: float | None = None

    def __post_init__(self):
        if self.scale is not None and not self.scale > 0:
            raise ValueError(f"Argument `scale` must be positive, but got {self.scale}.")

    def __call__(self, costs: np.ndarray) -> np.ndarray:
        """Return the compressed costs."""
        return costs if self.scale is None else self.scale * np.log1p(costs / self.scale)

    def slope(self, costs: np.ndarray) -> np.ndarray:
        """Return their derivative with respect to the costs."""
        return np.ones_like(costs) if self.scale is None else 1 / (1 + costs / self.scale)


class LossGradient(NamedTuple):
    """A loss with its gradient, and the numbers of masked and bounded cases."""

    loss: float
    gradient: Float[np.ndarray, " parameters"]
    masked: int
    bounded: int


@dataclass(frozen=True)
class Objective:
    """Objective of a tuning: an aggregate of the cases' costs, each compressed by `tail`.

    No derivative of a case exceeds `case_bound` times the median length of all, so that single
    cases near divergence do not dominate the gradient.
    """

    aggregate: AbstractAggregate
    tail: TailCompression = TailCompression()
    case_bound: float = 10.0

    def __post_init__(self):
        if not self.case_bound > 0:
            raise ValueError(f"Argument `case_bound` must be positive, but got {self.case_bound}.")

    def value(self, costs: Costs) -> float:
        """Return the loss; infinite where no case has a cost."""
        finite = costs[np.isfinite(costs)]
        return self.aggregate(self.tail(finite)) if len(finite) else float("inf")

    def loss_gradient(
        self, costs: Costs, derivatives: Float[np.ndarray, "cases parameters"]
    ) -> LossGradient:
        """Return loss and gradient without cases of infinite or NaN cost or derivative."""
        finite = usable_cases(costs, derivatives)
        masked = int((~finite).sum())
        costs, derivatives = costs[finite], derivatives[finite]
        if not len(costs):
            return LossGradient(float("inf"), np.zeros(derivatives.shape[1]), masked, 0)
        tail_costs = self.tail(costs)
        derivatives = self.tail.slope(costs)[:, None] * derivatives
        lengths = np.linalg.norm(derivatives, axis=1)
        bound = self.case_bound * np.median(lengths)
        excess = lengths > bound if bound > 0 else np.zeros(len(lengths), bool)
        scale = np.where(excess, bound / np.where(excess, lengths, 1.0), 1.0)
        weights = self.aggregate.weights(tail_costs)
        gradient = (weights * scale) @ derivatives
        return LossGradient(
            float(np.sum(weights * tail_costs)), gradient, masked, int(excess.sum())
        )


def usable_cases(
    costs: Costs, derivatives: Float[np.ndarray, "cases parameters"]
) -> Bool[np.ndarray, " cases"]:
    """Return which cases have a finite cost and derivative."""
    return np.isfinite(costs) & np.isfinite(derivatives).all(axis=1)


def _in_order(sorted_weights: np.ndarray, order: np.ndarray) -> np.ndarray:
    weights = np.empty(len(order))
    weights[order] = sorted_weights
    return weights


def _require_level(level: float) -> None:
    if not 0 < level < 1:
        raise ValueError(f"Argument `level` must be between 0 and 1, but got {level}.")


FIRST_VALIDATION_CASE = 2**29
"""First case that validates iterates; those below it are for training."""

FIRST_RECEIPT_CASE = FIRST_VALIDATION_CASE + 2**28
"""First case that checks the gradients."""


@dataclass(frozen=True)
class TuningSettings:
    """Settings of a descent, from the `[tuning]` table.

    Fields with the name of a key of `TuningTable` have its value, which is checked there.
    `horizons` are numbers of intervals, each used for an equal share of the steps, the last one the
    whole run.
    """

    objective: Objective
    descent: OptimiserSettings
    horizons: tuple[int, ...]
    seed: int
    steps: int
    cases: int
    fresh_cases: bool
    starts: int
    screened: int
    screening_cases: int | None
    halve_at: tuple[int, ...]
    validation_cases: int
    validate_every: int
    receipt_cases: int
    held_out_cases: int
    alarm_cost: float | None
    target_loss: float | None
    baseline_cases: int | None
    baseline_trajectories: int | None

    def numbers(self, step: int) -> np.ndarray:
        """Return the cases of a step: the next ones, or always the first."""
        first = step * self.cases if self.fresh_cases else 0
        return np.arange(first, first + self.cases)

    def screening(self) -> np.ndarray:
        """Return the cases on which starts are chosen, the first ones of the first step."""
        return self.numbers(0)[: self.screening_cases]

    def validation(self) -> np.ndarray:
        """Return the cases by which iterates are compared."""
        return FIRST_VALIDATION_CASE + np.arange(self.validation_cases)

    def reached(self, loss: float) -> bool:
        """Whether a loss on the validation cases meets the target."""
        return self.target_loss is not None and loss <= self.target_loss

    def intervals(self, step: int, whole: int) -> int:
        """Return the length of a step's runs, in intervals of the program."""
        if not self.horizons:
            return whole
        stage = min(step * len(self.horizons) // self.steps, len(self.horizons) - 1)
        return self.horizons[stage]


@dataclass(frozen=True)
class TuningPlan:
    """All input of a tuning run.

    Gradients are those of `smooth`; `exact` is the law as it will fly under the same bounded cost,
    `refined` the smooth law in finer steps, and `held_out` the exact law under the plain cost with
    cases of a seed that is never tuned on; `trained_on` is the same for the training's seed.
    `widths` are those of the smoothing; `description` is plain data that identifies the run,
    `remark` a note on the engine.
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
        """Number of intervals of the whole horizon."""
        return self.smooth.program.intervals
