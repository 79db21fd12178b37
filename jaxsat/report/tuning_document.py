"""Document and plots of a tuning, from `verdict.json`, `receipt.json` and `baselines.json`."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import xarray as xr

from jaxsat.report.document import Block, Cell, Document, Lines, Record, Shown, Table, Verdict
from jaxsat.report.plot import Axis, Line, Plot
from jaxsat.report.study_document import INTERVALS, fraction_cell, interval_cell, interval_of

DOMINANT_FRACTION = 0.5
"""Fraction of the cost from which its source is reported."""

EVALUATIONS = {
    "before": "held out, before",
    "after": "held out, after",
    "trained_before": "training seed, before",
    "trained_after": "training seed, after",
}

PLACES = {
    "start": "start",
    "end": "end",
    "exact_start": "exact law, start",
    "exact_end": "exact law, end",
}


def tuning_document(
    title: str,
    verdict: Record,
    receipt: Record,
    baselines: Sequence[Record] = (),
    absent: Sequence[str] = (),
) -> Document:
    """Return the document: verdict, gains, evaluations and receipt.

    `absent` are packages whose methods were left out. Raises `KeyError` or `TypeError` for records
    of another form.
    """
    blocks: list[Block] = [_gains(verdict), _evaluations(verdict)]
    if baselines:
        blocks.append(_baselines(baselines, absent))
    if receipt["derivative_free"]:
        blocks.append(Lines("Receipt", list(_without_derivatives(receipt))))
    else:
        blocks.append(_derivatives(receipt))
        blocks.append(Lines("What the gradients rest on", list(_receipt(receipt))))
    return Document(f"Tuning: {title}", _verdict(verdict, receipt), blocks)


def _verdict(verdict: Record, receipt: Record) -> Verdict:
    before, after = (verdict[name]["loss"] for name in ("before", "after"))
    better = None not in (before, after) and after < before
    first = "The tuned gains are better" if better else "No better gains"
    how = f"the objective on held-out cases goes from {_form(before)} to {_form(after)}"
    good = better and not receipt["problems"]
    return Verdict(good, f"{first}: {how}.", [*_warnings(verdict, receipt), _conclusion(verdict)])


def _warnings(verdict: Record, receipt: Record) -> Iterator[str]:
    for one in receipt["problems"]:
        yield f"The gradient of this run is not trustworthy: {one}."
    if receipt["first_masked"]:
        yield (
            f"{receipt['masked']} of {receipt['gradient_samples']} runs had no usable gradient and "
            f"were left out: {receipt['first_masked']}."
        )
    if verdict["at_bounds"]:
        bounds = ", ".join(f"{label} at {at:g}" for label, at in verdict["at_bounds"].items())
        yield (
            f"Gains are at their bounds: {bounds}. What is best may lie beyond them; see "
            "`[tuning.parameters]`."
        )
    singular = verdict["singular"]
    if singular is not None and singular > DOMINANT_FRACTION:
        yield (
            f"The cost is dominated by the singularity of (w, z): {singular:.1%} of it on held-out "
            "cases is what |w|, which has no bound upside down, and z, which counts turns, add to "
            'the cost of the rotation; see `simulation.attitude_cost = "rotation"`.'
        )


def _conclusion(verdict: Record) -> str:
    better, overfitting = verdict["better"], verdict["overfitting"]
    ends = [better["low"], better["high"]]
    unsure = "" if None not in ends and ends[0] * ends[1] > 0 else ", which does not exclude zero"
    text = f"Mean cost before minus after, case by case: {_cell(better).text}{unsure}."
    if overfitting is None:
        return text
    side = "above" if overfitting > 0 else "below"
    return (
        f"{text} The objective on held-out cases is {abs(overfitting):.1%} {side} that on the "
        "training seed's."
    )


def _gains(verdict: Record) -> Table:
    rows = [
        [name, *(Shown(_form(one[when], ".6g"), one[when]) for when in ("before", "after"))]
        for name, one in verdict["gains"].items()
    ]
    return Table("Gains", ["gain", "before", "after"], rows)


def _evaluations(verdict: Record) -> Table:
    evaluations = [verdict[name] for name in EVALUATIONS]
    rows: list[list[Cell]] = [
        ["cases", *(one["cases"] for one in evaluations)],
        ["settled", *(_fraction(one["settled"]) for one in evaluations)],
    ]
    for percent in (50, 90):
        times = [_percentile(one["settling_time"], percent) for one in evaluations]
        rows.append([f"settling time over settled cases, {percent} % (s)", *times])
    rows.append(
        ["effort, median (N m s)", *(_percentile(one["effort"], 50) for one in evaluations)]
    )
    rows.append(["mean cost over completed cases", *(_cell(one["cost"]) for one in evaluations)])
    rows.append(["failed", *(_fraction(one["failed"]) for one in evaluations)])
    if evaluations[0]["alarming"] is not None:
        rows.append(
            ["failed or above the alarm", *(_fraction(one["alarming"]) for one in evaluations)]
        )
    rows.append(["objective", *(one["loss"] for one in evaluations)])
    note = f"The exact law; no gain was tuned on the held-out cases. {INTERVALS}"
    return Table("Before and after", ["quantity", *EVALUATIONS.values()], rows, note)


def _baselines(results: Sequence[Record], absent: Sequence[str]) -> Table:
    rows: list[list[Cell]] = []
    for entry in results:
        evaluation, remark = entry["evaluation"], " (target reached)" if entry["reached"] else ""
        rows.append(
            [
                entry["method"],
                Shown(f"{entry['trajectories']:.0f}{remark}", entry["trajectories"]),
                entry["loss"],
                evaluation["loss"],
                _cell(evaluation["cost"]),
                *(_fraction(evaluation[name]) for name in ("settled", "failed", "alarming")),
            ]
        )
    columns = ["method", "trajectories", "objective on validation", "objective held out",
               "mean cost over completed cases", "settled", "failed",
               "failed or above the alarm"]  # fmt: skip
    note = f"Left out, as their packages are not installed: {', '.join(absent)}." if absent else ""
    return Table("Other methods, with the same number of trajectories", columns, rows, note)


def _derivatives(receipt: Record) -> Table:
    rows: list[list[Cell]] = [
        row for name, place in PLACES.items() for row in _check_rows(place, receipt, receipt[name])
    ]
    note = (
        "Derivatives of the mean cost as the run takes them, and the central difference that "
        "agrees best. The run rests on the law it differentiates, in the rows start and end; the "
        "rows of the exact law show what the same method gives for that law."
    )
    columns = ["where", "gain", "derivative", "difference", "half width", "relative error",
               "cases"]  # fmt: skip
    return Table("Receipt: can the gradients be trusted?", columns, rows, note)


def _check_rows(place: str, receipt: Record, entry: Record) -> Iterator[list[Cell]]:
    left_out = f" ({entry['left_out']} left out)" if entry["left_out"] else ""
    columns = (entry[name] for name in ("automatic", "difference", "step", "error"))
    for label, *values in zip(receipt["labels"], *columns, strict=True):
        forms = (".6g", ".6g", ".0e", ".1e")
        numbers = (Shown(_form(*one), one[0]) for one in zip(values, forms, strict=True))
        yield [place, label, *numbers, Shown(f"{entry['cases']}{left_out}", entry["cases"])]


def _receipt(receipt: Record) -> Iterator[str]:
    widths = ", ".join(f"{name} = {value:g}" for name, value in receipt["widths"].items())
    yield (
        f"Smoothing: {widths or 'no widths'}. Costs of the law that is differentiated, with thrust "
        "in place of pulses where thrusters push, differ from the exact law's by "
        f"{_form(receipt['smoothing_bias'], '.2%')} (median), at most "
        f"{_form(receipt['largest_smoothing_bias'], '.2%')}."
    )
    yield f"Finer steps change the costs by {_steps(receipt)}, relative."
    yield (
        f"Of {receipt['gradient_samples']} runs with gradients, {receipt['failed']} ended early "
        f"and were penalised, {receipt['masked']} were left out, and the derivatives of "
        f"{receipt['bounded']} were clipped."
    )


def _without_derivatives(receipt: Record) -> Iterator[str]:
    yield (
        "The run takes no derivatives: it compares points of the exact law on the same cases, "
        f"{receipt['failed']} runs of which ended early."
    )
    yield (
        f"Finer steps change the cost of a case by {_steps(receipt)}, relative to the mean cost. "
        "Single cases differ where pulses and alarms shift; the verdict averages over many cases."
    )


def _steps(receipt: Record) -> str:
    usual, most = receipt["step_sensitivity"], receipt["largest_step_sensitivity"]
    return f"{_form(usual, '.1e')} (median), at most {_form(most, '.1e')}"


def _form(value: float | None, form: str = ".4g") -> str:
    return "–" if value is None else format(value, form)


def _cell(record: Record | None) -> Shown:
    return interval_cell(interval_of(record))


def _percentile(record: Record, percent: int) -> Shown:
    return _cell(record.get(f"{percent}.0"))


def _fraction(record: Record | None) -> Cell:
    interval = interval_of(record)
    return None if interval is None else fraction_cell(interval)


STEP = Axis("step")


def loss_plots(history: xr.Dataset) -> list[Plot]:
    """Plot loss in training and validation, gradient norm, and the fraction settled."""
    checks, best = history["validation"].values, history["best_loss"].values
    settled = history["validation_settled"].max("start", skipna=True).values
    ends = f"On the validation cases the best so far ends at {best[-1]:.4g}."
    most = f"On the validation cases {settled[-1]:.1%} at the end, the highest of the starts."
    validation = Line(checks, best, "validation, best so far (exact law)")
    highest = Line(checks, settled, "validation, highest of the starts")
    share = Axis("fraction settled", limits=(-0.02, 1.02))
    loss, norm = Axis("loss", log=True), Axis("gradient norm", log=True)
    gradients = list(_starts(history, "gradient_norm"))
    return [
        Plot("Loss", ends, STEP, loss, [validation, *_starts(history, "loss")]),
        Plot("Gradient norm", "In training, every start.", STEP, norm, gradients),
        Plot("Fraction settled", most, STEP, share, [highest, *_starts(history, "settled")]),
    ]


def gain_plots(history: xr.Dataset) -> list[Plot]:
    """Plot every gain over the steps, of all starts, and that of the best iterate so far."""
    checks, plots = history["validation"].values, []
    scales = np.atleast_1d(history.attrs["parameter_scales"])
    units = np.atleast_1d(history.attrs["parameter_units"])
    for label, scale, unit in zip(
        map(str, history["parameter"].values), scales, units, strict=True
    ):
        one = history.sel(parameter=label)
        best = one["best_gain"].values
        axis = Axis(label, str(unit), log=scale == "log")
        lines = [Line(checks, best, "best so far", steps=True), *_starts(one, "gain")]
        sentence = f"The best so far ends at {best[-1]:.4g}."
        plots.append(Plot(label, sentence, STEP, axis, lines))
    return plots


def _starts(history: xr.Dataset, name: str) -> Iterator[Line]:
    for number, values in enumerate(history[name].transpose("start", "step").values):
        label = "" if number else "training, every start"
        yield Line(history["step"].values, values, label, faint=True)


def before_after_plots(
    before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray]
) -> list[Plot]:
    """Plot the fraction of held-out cases below a settling time, effort or cost."""
    quantities = {
        "settling_time": Axis("settling time", "s"),
        "effort": Axis("effort", "N m s", log=True),
        "cost": Axis("cost", "1", log=True),
    }
    share = Axis("fraction below", "1", limits=(-0.02, 1.02))
    plots = []
    for name, axis in quantities.items():
        lines = []
        for columns, who in ((after, "after"), (before, "before")):
            values = columns[name]
            finite_values = np.sort(values[np.isfinite(values)])
            shares = np.arange(1, len(finite_values) + 1) / len(values)
            lines.append(Line(finite_values, shares, f"{who}, {len(values)} cases", steps=True))
        plots.append(Plot(axis.label, "", axis, share, lines))
    return plots


def methods_plot(traces: Mapping[str, np.ndarray]) -> Plot:
    """Plot validation loss of the best point so far over trajectories, a line for each method."""
    axis = Axis("trajectories computed (a gradient of n gains: n + 1)", linear_to=100.0)
    loss = Axis("validation loss, exact law", log=True)
    lines = [Line(one[:, 0], one[:, 1], name, steps=True) for name, one in traces.items()]
    return Plot("the best point so far of each method", "", axis, loss, lines)
