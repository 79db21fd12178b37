"""What a tuning run is: the objective, which makes one number of the costs of many cases, the laws
it runs, the cases it takes, and how it descends."""

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
        """Weights that sum to one."""

    def __call__(self, costs: Costs) -> float:
        """The weighted sum."""
        return float(np.sum(self.weights(costs) * costs))


@dataclass(frozen=True)
class Mean(AbstractAggregate):
    """The mean."""

    def weights(self, costs: Costs) -> Costs:
        """Equal weights."""
        return np.full(len(costs), 1 / len(costs))


@dataclass(frozen=True)
class ConditionalValueAtRisk(AbstractAggregate):
    """The mean of the worst part 1 - α of the cases: conditional value at risk, CVaR(α).

    R. T. Rockafellar, S. Uryasev, J. Risk 2, 2000.
    """

    level: float

    def __post_init__(self):
        _require_level(self.level)

    def weights(self, costs: Costs) -> Costs:
        """Equal weights on the worst cases, the last of which may count in part."""
        share = (1 - self.level) * len(costs)
        shares = np.clip(share - np.arange(len(costs)), 0, 1) / share
        return _in_order(shares, np.argsort(-costs, kind="stable"))


@dataclass(frozen=True)
class Quantile(AbstractAggregate):
    """The cost that a part `level` of the cases do not exceed, linear between cases."""

    level: float

    def __post_init__(self):
        _require_level(self.level)

    def weights(self, costs: Costs) -> Costs:
        """The two cases beside the place asked for."""
        place = self.level * (len(costs) - 1)
        distance = np.abs(np.arange(len(costs)) - place)
        return _in_order(np.clip(1 - distance, 0, 1), np.argsort(costs, kind="stable"))


@dataclass(frozen=True)
class WorstCase(AbstractAggregate):
    """The largest cost."""

    def weights(self, costs: Costs) -> Costs:
        """The worst case alone."""
        return (np.arange(len(costs)) == np.argmax(costs)).astype(float)


@dataclass(frozen=True)
class TailCompression:
    """A cost that counts as it is, or, with a `scale`, as scale · log(1 + cost/scale)."""

    scale: float | None = None

    def __post_init__(self):
        if self.scale is not None and not self.scale > 0:
            raise ValueError(f"Argument `scale` must be positive, but got {self.scale}.")

    def __call__(self, costs: np.ndarray) -> np.ndarray:
        """What the costs count."""
        return costs if self.scale is None else self.scale * np.log1p(costs / self.scale)

    def slope(self, costs: np.ndarray) -> np.ndarray:
        """The derivative of that by the costs."""
        return np.ones_like(costs) if self.scale is None else 1 / (1 + costs / self.scale)


class LossGradient(NamedTuple):
    """A loss with its gradient, and how many cases were masked or bounded to get it."""

    loss: float
    gradient: Float[np.ndarray, " parameters"]
    masked: int
    bounded: int


@dataclass(frozen=True)
class Objective:
    """What is minimised: an aggregate of the cases' costs, each seen through `tail`.

    No case's derivative counts for more than `case_bound` times the median length of the others',
    so that single cases near divergence do not own the gradient.
    """

    aggregate: AbstractAggregate
    tail: TailCompression = TailCompression()
    case_bound: float = 10.0

    def __post_init__(self):
        if not self.case_bound > 0:
            raise ValueError(f"Argument `case_bound` must be positive, but got {self.case_bound}.")

    def value(self, costs: Costs) -> float:
        """The loss; infinite where no case has a cost."""
        finite = costs[np.isfinite(costs)]
        return self.aggregate(self.tail(finite)) if len(finite) else float("inf")

    def loss_gradient(
        self, costs: Costs, derivatives: Float[np.ndarray, "cases parameters"]
    ) -> LossGradient:
        """Loss and gradient. Cases without a finite cost or derivative are masked, and counted."""
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
    """Which cases have a finite cost and derivative."""
    return np.isfinite(costs) & np.isfinite(derivatives).all(axis=1)


def _in_order(sorted_weights: np.ndarray, order: np.ndarray) -> np.ndarray:
    weights = np.empty(len(order))
    weights[order] = sorted_weights
    return weights


def _require_level(level: float) -> None:
    if not 0 < level < 1:
        raise ValueError(f"Argument `level` must be between 0 and 1, but got {level}.")


FIRST_VALIDATION_CASE = 2**29
"""Cases from this number on choose the best iterate; those below it are trained on."""

FIRST_RECEIPT_CASE = FIRST_VALIDATION_CASE + 2**28
"""Cases from this number on check the gradients."""


@dataclass(frozen=True)
class TuningSettings:
    """How a run descends: what `[tuning]` says, in the numbers that the run takes.

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
        """The cases of a step: the next ones, or always the first."""
        first = step * self.cases if self.fresh_cases else 0
        return np.arange(first, first + self.cases)

    def screening(self) -> np.ndarray:
        """The cases on which starts are chosen: those of the first step, or the first of them."""
        return self.numbers(0)[: self.screening_cases]

    def validation(self) -> np.ndarray:
        """The cases by which iterates are compared."""
        return FIRST_VALIDATION_CASE + np.arange(self.validation_cases)

    def reached(self, loss: float) -> bool:
        """Whether a loss on the validation cases is the target's."""
        return self.target_loss is not None and loss <= self.target_loss

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
