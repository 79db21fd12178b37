"""Receipt of a run: accuracy of its gradients, and effects of smoothing and steps.

Derivatives are compared with central differences of the same cases' costs, which are independent of
automatic differentiation. For the exact law the comparison shows whether tuning it was possible:
where its torque jumps, automatic differentiation misses part of the derivative.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.simulation.trajectory import Outcome
from jaxsat.synthesis.execution import plain_data
from jaxsat.synthesis.tuning.cost_evaluator import CostEvaluator
from jaxsat.synthesis.tuning.descent import DescentState
from jaxsat.synthesis.tuning.plan import FIRST_RECEIPT_CASE, TuningPlan
from jaxsat.synthesis.tuning.unusable import unusable

HALF_WIDTHS = (1e-2, 1e-3, 1e-4, 1e-5)
"""Half widths of the central differences, along the search."""

MAX_RELATIVE_ERROR = 0.01
"""Largest relative error of a trusted derivative."""

DERIVATIVE_FLOOR = 0.01
"""Errors of derivatives below this fraction of the largest are relative to that fraction."""


class GradientCheck(NamedTuple):
    """Derivatives of the mean cost at one point by both methods, one entry per tuned number.

    `step` is the half width whose difference agrees best, `error` the deviation, relative to the
    difference (or to a hundredth of the largest). Cases that fail or have no finite derivative at
    any of the points are `left_out`; `undefined` of them reached their end everywhere and have no
    finite derivative.
    """

    automatic: Float[np.ndarray, " parameters"]
    difference: Float[np.ndarray, " parameters"]
    step: Float[np.ndarray, " parameters"]
    error: Float[np.ndarray, " parameters"]
    cases: int
    left_out: int
    undefined: int = 0

    @property
    def trusted(self) -> bool:
        """Whether every derivative is within one percent."""
        return self.cases > 0 and bool(np.all(self.error <= MAX_RELATIVE_ERROR))

    def as_data(self) -> dict[str, Any]:
        """Return the data of a record, see `plain_data`."""
        return {**self._asdict(), "trusted": self.trusted}


@dataclass(frozen=True)
class Receipt:
    """Checks of a run; `problems` are sentences, none where all is well."""

    labels: tuple[str, ...]
    start: GradientCheck
    end: GradientCheck
    exact_start: GradientCheck
    exact_end: GradientCheck
    widths: dict[str, float]
    smoothing_bias: float
    largest_smoothing_bias: float
    step_sensitivity: float
    largest_step_sensitivity: float
    gradient_samples: int
    failed: int
    masked: int
    bounded: int
    derivative_free: bool = False
    first_masked: str = ""

    @property
    def problems(self) -> list[str]:
        """Reasons to distrust the gradients; none where none are taken."""
        problems: list[str] = []
        if self.derivative_free:
            return problems
        for place, comparison in (("start", self.start), ("end", self.end)):
            without = comparison.undefined
            if without:
                problems.append(
                    f"at the {place} {without} of {without + comparison.cases} cases that reached "
                    "their end have no finite derivative"
                )
            elif not comparison.cases:
                problems.append(f"at the {place} no case reached its end, so there is no check")
            for label, error in zip(self.labels, comparison.error, strict=True):
                if comparison.cases and not error <= MAX_RELATIVE_ERROR:
                    problems.append(
                        f"at the {place} the derivative with respect to {label} differs by "
                        f"{error:.1%} from the best central difference"
                    )
        return problems

    def as_data(self) -> dict[str, Any]:
        """Convert to plain data."""
        return plain_data({**vars(self), "problems": self.problems})


def make_receipt(plan: TuningPlan, state: DescentState) -> Receipt:
    """Compare derivatives at the first point of the run and at the best one."""
    first, best = state.validations[0].best_point, state.best_point
    free = plan.settings.descent.derivative_free
    numbers = FIRST_RECEIPT_CASE + np.arange(plan.settings.receipt_cases)
    smooth, exact, refined = (
        np.asarray(evaluator.evaluate(np.stack([first, best]), numbers).cost)
        for evaluator in (plan.smooth, plan.exact, plan.refined)
    )
    differs = bool(plan.widths) or not np.array_equal(smooth, exact, equal_nan=True)
    runs = [] if free else [plan.smooth, plan.exact] if differs else [plan.smooth]
    checks = [check_gradients(one, point, numbers) for one in runs for point in (first, best)]
    checks = (checks or [_no_check(plan.space.size)] * 2) * (2 if len(runs) < 2 else 1)
    bias = _relative(smooth, exact)
    usual = float(np.nanmean(np.abs(refined))) if free else 0.0  # costs may be zero there
    steps = _relative(smooth, refined, usual)
    return Receipt(
        plan.space.labels,
        *checks,
        widths=dict(plan.widths),
        smoothing_bias=_median(bias),
        largest_smoothing_bias=_largest(bias),
        step_sensitivity=_median(steps),
        largest_step_sensitivity=_largest(steps),
        gradient_samples=sum(
            plan.settings.cases * int(np.isfinite(record.loss).sum()) for record in state.steps
        ),
        failed=sum(int(record.failed.sum()) for record in state.steps),
        masked=sum(int(record.masked.sum()) for record in state.steps),
        bounded=sum(int(record.bounded.sum()) for record in state.steps),
        derivative_free=free,
        first_masked="" if free else _first_masked(plan, state),
    )


def _first_masked(plan: TuningPlan, state: DescentState) -> str:
    """Describe the first cases left out, with the reason; empty without any."""
    for step, record in enumerate(state.steps):
        if record.masked.any():
            start = int(np.argmax(record.masked > 0))
            numbers = plan.settings.numbers(step)
            reason = unusable(plan.smooth, record.points[start], numbers, record.horizon)
            return f"at step {step + 1}, start {start + 1}, {reason}"
    return ""


def _no_check(size: int) -> GradientCheck:
    none = np.full(size, np.nan)
    return GradientCheck(none, none, none, none, 0, 0)


def check_gradients(
    evaluator: CostEvaluator, point: Float[np.ndarray, " parameters"], numbers: np.ndarray
) -> GradientCheck:
    """Compare derivatives of the mean cost at a point with central differences.

    A point at a bound is moved inside by the largest half width, so that both sides exist.
    """
    size, space = len(point), evaluator.space
    low, high = space.ends
    margin = max(HALF_WIDTHS)
    point = np.clip(point, low + margin, high - margin)
    shifts = np.array(HALF_WIDTHS)[:, None, None] * np.eye(size)[None]
    shifted_points = np.concatenate([point + shifts, point - shifts]).reshape(-1, size)
    around = evaluator.evaluate(shifted_points, numbers)
    slopes = evaluator.differentiate(point[None], numbers)
    complete = np.all(around.code == int(Outcome.SUCCESS), axis=0)
    complete &= slopes.outputs.code[0] == int(Outcome.SUCCESS)
    good = complete & np.isfinite(slopes.derivatives[0]).all(axis=1)
    counts = int(good.sum()), int((~good).sum()), int((complete & ~good).sum())
    if not good.any():
        nothing = np.full(size, np.nan)
        return GradientCheck(nothing, nothing, nothing, nothing, *counts)
    means = np.asarray(around.cost)[:, good].mean(axis=1).reshape(2, len(HALF_WIDTHS), size)
    differences = (means[0] - means[1]) / (2 * np.array(HALF_WIDTHS)[:, None])
    automatic = slopes.derivatives[0][good].mean(axis=0)
    floor = DERIVATIVE_FLOOR * np.abs(differences).max(axis=1, keepdims=True)
    scale = np.maximum(np.maximum(np.abs(differences), floor), np.finfo(float).tiny)
    errors = np.abs(automatic - differences) / scale
    best = np.argmin(errors, axis=0)
    columns = np.arange(size)
    return GradientCheck(
        automatic,
        differences[best, columns],
        np.array(HALF_WIDTHS)[best],
        errors[best, columns],
        *counts,
    )


def _relative(one: np.ndarray, other: np.ndarray, least: float = 0.0) -> np.ndarray:
    both = np.isfinite(one) & np.isfinite(other)
    return np.abs(one[both] - other[both]) / np.maximum(np.abs(other[both]), max(least, 1e-300))


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _largest(values: np.ndarray) -> float:
    return float(values.max()) if len(values) else float("nan")
