"""What a run found, for a person: the page that is written and printed."""

from collections.abc import Sequence

from jaxsat.core.numerals import number_text
from jaxsat.core.text import markdown
from jaxsat.studies import Interval, ends_text, fraction_text
from jaxsat.synthesis.tuning.baselines import BaselineResult, missing_packages
from jaxsat.synthesis.tuning.receipt import GradientCheck, Receipt
from jaxsat.synthesis.tuning.verdict import GainEvaluation, TuningVerdict

DOMINANT_FRACTION = 0.5
"""Part of the cost from which on it is told where it comes from."""


def summary_page(
    title: str, receipt: Receipt, verdict: TuningVerdict, baselines: Sequence[BaselineResult] = ()
) -> str:
    """Markdown: distrust first if there is reason for it, then gains, verdict and receipt."""
    blocks = [f"# Tuning: {markdown(title)}", *_warnings(receipt, verdict)]
    blocks += ["## Gains", _gains(verdict)]
    blocks += ["## Verdict: the exact law on cases never tuned on", _verdict(verdict)]
    blocks += [_conclusion(verdict)]
    if baselines:
        blocks += ["## Other ways, at an equal budget of trajectories", _baselines(baselines)]
        absent = missing_packages()
        if absent:
            blocks += [f"Left out, as their packages are not installed: {', '.join(absent)}."]
    if receipt.derivative_free:
        blocks += ["## Receipt", _receipt_without_derivatives(receipt)]
    else:
        blocks += ["## Receipt: can the gradients be trusted?", *_receipt(receipt)]
    return "\n\n".join(blocks) + "\n"


def _warnings(receipt: Receipt, verdict: TuningVerdict) -> list[str]:
    found = []
    if receipt.problems:
        reasons = "; ".join(receipt.problems)
        found.append(f"**The gradient of this run is not trustworthy:** {reasons}.")
    if receipt.first_masked:
        found.append(
            f"**{receipt.masked} of {receipt.gradient_samples} runs had no usable gradient** and "
            f"were left out: {receipt.first_masked}."
        )
    if not verdict.after.loss < verdict.before.loss:
        found.append("**By the objective tuned, the new gains are no better on held-out cases.**")
    if verdict.at_bounds:
        listed = ", ".join(f"{label} at {bound:g}" for label, bound in verdict.at_bounds.items())
        found.append(
            f"**Gains are at their bounds:** {listed}. What is best may lie beyond them; see "
            "[tuning.parameters]."
        )
    if verdict.singular is not None and verdict.singular > DOMINANT_FRACTION:
        found.append(
            f"**The cost is dominated by the singularity of (w, z):** {verdict.singular:.1%} of it "
            "on held-out cases is what |w|, which has no bound upside down, and z, which counts "
            'turns, add to the cost of the rotation; see simulation.attitude_cost = "rotation".'
        )
    return found


def _gains(verdict: TuningVerdict) -> str:
    rows = zip(verdict.labels, verdict.gains_before, verdict.gains_after, strict=True)
    return _table(
        ["gain", "before", "after"],
        [[label, f"{before:.6g}", f"{after:.6g}"] for label, before, after in rows],
    )


def _verdict(verdict: TuningVerdict) -> str:
    columns = {
        "held out, before": verdict.before,
        "held out, after": verdict.after,
        "training seed, before": verdict.trained_before,
        "training seed, after": verdict.trained_after,
    }
    rows = [
        ["cases", *(str(entry.summary.cases) for entry in columns.values())],
        ["settled", *(fraction_text(entry.summary.settled) for entry in columns.values())],
    ]
    for percent in (50.0, 90.0):
        row = [f"settling time of those, {percent:g} % (s)"]
        rows.append([*row, *(_at(e.summary.settling_time, percent) for e in columns.values())])
    rows.append(
        ["effort, median (N m s)", *(_at(e.summary.effort, 50.0) for e in columns.values())]
    )
    rows.append(["mean cost of those that end", *(_number(e.cost) for e in columns.values())])
    rows.append(["failed", *(fraction_text(entry.failed) for entry in columns.values())])
    if verdict.before.alarming is not None:
        rows.append(["failed or above the alarm", *(_alarm(e) for e in columns.values())])
    rows.append(["objective", *(f"{entry.loss:.5g}" for entry in columns.values())])
    return _table(["", *columns], rows) + "\n\nIntervals are of 95 %."


def _conclusion(verdict: TuningVerdict) -> str:
    better = verdict.better
    unsure = ", which does not exclude zero" if better.low <= 0 <= better.high else ""
    return (
        f"Mean cost before less after, case by case: {_number(better)}{unsure}. The objective "
        f"on held-out cases is {abs(verdict.overfitting):.1%} "
        f"{'above' if verdict.overfitting > 0 else 'below'} that on the training seed's."
    )


def _baselines(found: Sequence[BaselineResult]) -> str:
    rows = []
    for entry in found:
        summary = entry.evaluation.summary
        rows.append(
            [
                entry.method,
                f"{entry.trajectories:.0f}{' (target reached)' if entry.reached else ''}",
                f"{entry.loss:.5g}",
                f"{entry.evaluation.loss:.5g}",
                _number(entry.evaluation.cost),
                fraction_text(summary.settled),
                fraction_text(entry.evaluation.failed),
                _alarm(entry.evaluation),
            ]
        )
    head = ["method", "trajectories", "objective on validation", "objective held out"]
    rest = ["mean cost of those that end", "settled", "failed", "failed or above the alarm"]
    return _table([*head, *rest], rows)


def _receipt_without_derivatives(receipt: Receipt) -> str:
    return (
        "- The run takes no derivatives: it compares points of the exact law on the same cases, "
        f"{receipt.failed} runs of which ended early.\n"
        f"- Finer steps change what cases count by {receipt.step_sensitivity:.1e} (median), at "
        f"most {receipt.largest_step_sensitivity:.1e}, relative to their mean. Where pulses and "
        "alarms fall otherwise, single cases differ; the verdict is of many."
    )


def _receipt(receipt: Receipt) -> list[str]:
    places = {
        "start": receipt.start,
        "end": receipt.end,
        "exact law, start": receipt.exact_start,
        "exact law, end": receipt.exact_end,
    }
    blocks = [
        "Derivatives of the mean cost as the run takes them and by the central difference that "
        "agrees best. What the run rests on is the law it differentiates, in the rows `start` and "
        "`end`; those of the exact law show what the same way makes of it."
    ]
    rows = [row for place, entry in places.items() for row in _compared(place, receipt, entry)]
    head = ["where", "gain", "derivative", "difference", "half width", "relative error", "cases"]
    blocks.append(_table(head, rows))
    widths = ", ".join(f"{name} = {value:g}" for name, value in receipt.widths.items())
    blocks.append(
        f"- Smoothing: {widths or 'no widths'}. Costs of the law that is differentiated, with "
        "thrust in place of pulses where thrusters push, differ from the exact law's by "
        f"{receipt.smoothing_bias:.2%} (median), at most {receipt.largest_smoothing_bias:.2%}.\n"
        f"- Finer steps change the costs by {receipt.step_sensitivity:.1e} (median), at most "
        f"{receipt.largest_step_sensitivity:.1e}, relative.\n"
        f"- Of {receipt.gradient_samples} runs that gradients were taken of, {receipt.failed} "
        f"ended early and were charged for it, {receipt.masked} were left out and "
        f"{receipt.bounded} counted for less than their derivative."
    )
    return blocks


def _compared(place: str, receipt: Receipt, entry: GradientCheck) -> list[list[str]]:
    columns = (entry.automatic, entry.difference, entry.step, entry.error)
    return [
        [
            place,
            label,
            f"{automatic:.6g}",
            f"{difference:.6g}",
            f"{step:.0e}",
            f"{error:.1e}",
            f"{entry.cases}{f' ({entry.left_out} left out)' if entry.left_out else ''}",
        ]
        for label, automatic, difference, step, error in zip(receipt.labels, *columns, strict=True)
    ]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _number(value: Interval) -> str:
    return f"{number_text(value.value)} ({ends_text(value)})"


def _at(percentiles: dict[float, Interval], percent: float) -> str:
    return _number(percentiles[percent]) if percent in percentiles else "-"


def _alarm(evaluation: GainEvaluation) -> str:
    return "-" if evaluation.alarming is None else fraction_text(evaluation.alarming)
