"""Cases without a usable gradient: numbers, gains, and the operation that made it NaN."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

import jaxsat
from jaxsat.core.errors import JaxsatError
from jaxsat.core.jax_internals import Place
from jaxsat.simulation.engine.nan_origin import nan_in_run
from jaxsat.simulation.trajectory import Outcome
from jaxsat.synthesis.tuning.cost_evaluator import CaseGradients, CostEvaluator
from jaxsat.synthesis.tuning.plan import usable_cases

LISTED = 8
"""Largest number of cases that are listed one by one."""


class NoGradient(JaxsatError):
    """No case of a step has a usable gradient at any of its points."""

    failure = True


class Unusable(NamedTuple):
    """Cases at one point of the search whose cost or derivative is not finite.

    `cases` are their numbers among `total` cases, and `impossible` counts those that cannot exist;
    `gains` are the labels of derivatives that are not finite. `reason` is a sentence on the first
    one.
    """

    cases: list[int]
    total: int
    impossible: int
    gains: list[str]
    reason: str

    def __str__(self) -> str:
        which = ", ".join(map(str, self.cases[:LISTED]))
        more = f" and {len(self.cases) - LISTED} more" if len(self.cases) > LISTED else ""
        text = f"{len(self.cases)} of {self.total} cases have no usable gradient ({which}{more})"
        if self.impossible:
            text += f", {self.impossible} of them as they cannot exist"
        return f"{text}{self.reason and ': '}{self.reason}"


def unusable(
    evaluator: CostEvaluator,
    point: Float[np.ndarray, " parameters"],
    numbers: Int[np.ndarray, " cases"],
    intervals: int | None,
    gradients: CaseGradients | None = None,
) -> Unusable | None:
    """Diagnose the cases `numbers` at a point of the search; None where all are usable.

    `gradients` are those of the cases at this point, if known.
    """
    if gradients is None:
        gradients = evaluator.differentiate(point[None], numbers, intervals)
    costs, derivatives = np.asarray(gradients.outputs.cost)[0], gradients.derivatives[0]
    bad = ~usable_cases(costs, derivatives)
    if not bad.any():
        return None
    code = np.asarray(gradients.outputs.code)[0]
    wrong = ~np.isfinite(derivatives) & bad[:, None]
    labels = np.array(evaluator.space.labels)
    report = Unusable(
        numbers[bad].tolist(),
        len(numbers),
        int((code == int(Outcome.IMPOSSIBLE_CASE)).sum()),
        labels[wrong.any(axis=0)].tolist(),
        "",
    )
    places = np.argwhere(wrong)
    if not len(places):
        return report
    case, gain = map(int, places[np.isnan(derivatives[tuple(places.T)]).argmax()])
    why = _why(
        evaluator, point, int(numbers[case]), gain, intervals, float(derivatives[case, gain])
    )
    others = f"by {', '.join(report.gains)}; " if len(report.gains) > 1 else ""
    return report._replace(
        reason=f"{others}the derivative of case {numbers[case]} by {labels[gain]} {why}"
    )


def _why(evaluator: CostEvaluator, point, number: int, gain: int, intervals, value: float) -> str:
    """Complete a sentence with the reason why a derivative is not finite."""
    if not np.isnan(value):
        return "is infinite"
    if evaluator.gradient == "differences":
        return "is NaN, as the cost is beside the point"
    nan = nan_in_run(*evaluator.derivative_of_one(point, number, gain, intervals))
    if nan is None:
        return "is NaN in reverse mode" if evaluator.gradient == "reverse" else "is NaN"
    text = f"becomes NaN at {nan.time:g} s by the operation `{nan.origin.operation}`"
    return text + _in_source(nan.origin.place)


def _in_source(place: tuple[Place, ...]) -> str:
    """Describe the innermost known call, a file of jaxsat relative to its package."""
    if not place:
        return ""
    last, package = place[-1], Path(jaxsat.__file__).parent.parent
    file = Path(last.file)
    source_file = file.relative_to(package) if file.is_relative_to(package / "jaxsat") else file
    return f" in {source_file}, line {last.line} ({last.function})"
