"""Document of a controller design, from the record `design.json`."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from jaxsat.core.text import capitalised, number_text, vector_text
from jaxsat.report.comparison_document import LAW_COLUMNS, LAWS_NOTE, law_cells, price_table
from jaxsat.report.document import Block, Cell, Document, Lines, Record, Shown, Table, Verdict
from jaxsat.report.study_document import interval_of, percentile_table

DESIGNED = "designed.toml"
"""File of the designed scenario."""

SHOWN_CASES = 20
"""Number of failing cases that are listed."""

LINES = {
    "assumed": "Assumptions, where the file gives no value",
    "left_out": "Laws left out",
    "cautions": "Outside the verified range of the laws",
}


def design_document(record: Record) -> Document:
    """Return the document: verdict, remaining authority, choice of the law, verification, remedies.

    Raises `KeyError` or `TypeError` for a record of another form.
    """
    remark = record["controllability"]["misses_attitude"]
    verdict = Verdict(
        record["outcome"] == "reached", record["headline"], [remark] if remark else []
    )
    blocks: list[Block] = [Lines("Remaining control authority", record["controllability"]["lines"])]
    blocks += [Lines(title, record[name]) for name, title in LINES.items() if record[name]]
    if record["screening"] is not None:
        blocks += _choice(record)
    if record["verification"] is not None:
        blocks += _verification(record, record["verification"])
    return Document(f"Design: {record['title']}", verdict, blocks)


def _choice(record: Record) -> Iterator[Block]:
    steps = {name: record[name] for name in ("screening", "validation") if record[name]}
    rows = [[name, *law_cells(row)] for name, step in steps.items() for row in step["rows"]]
    yield Table("Laws in screening and validation", ["step", *LAW_COLUMNS], rows, LAWS_NOTE)
    yield from price_table(
        ({"step": name, **row} for name, step in steps.items() for row in step["rows"]), ["step"]
    )
    sentences = [
        f"{capitalised(name)}, seed {record['seeds'][name]}: {step['taken'] or 'none'} is best. "
        f"{capitalised(step['reason'])}."
        for name, step in steps.items()
    ]
    if record["tuning"] is not None:
        sentences.insert(1, _tuning(record["tuning"]))
    gains = ", ".join(f"{name} = {_gain(value)}" for name, value in record["gains"].items())
    sentences.append(f"Chosen: {record['chosen']}{f' with {gains}' if gains else ''}.")
    yield Lines("Choice of the law", sentences)


def _tuning(tuning: Record) -> str:
    if "left_out" in tuning:
        return f"Tuning was skipped: {tuning['left_out']}."
    losses = tuning["loss_before"], tuning["loss_after"]
    before, after = (math.inf if one is None else one for one in losses)  # a record has no inf
    better = "" if after < before else "; no better gains were found"
    return (
        f"Tuning: {tuning['steps']} steps give {tuning['candidate']}; its loss on the validation "
        f"cases of the tuner changes from {number_text(before)} to {number_text(after)}{better}."
    )


def _gain(value: Any) -> str:
    if isinstance(value, list | tuple):
        return vector_text(value)
    return number_text(value)


def _verification(record: Record, verification: Record) -> Iterator[Block]:
    outcomes = ", ".join(f"{count:,} {name}" for name, count in verification["outcomes"].items())
    seed, failing = record["seeds"]["verification"], verification["failing_cases"]
    times = {
        label: {float(percent): interval_of(one) for percent, one in verification[name].items()}
        for name, label in (("settling_time_s", "settling_time"), ("effort_N_m_s", "effort"))
    }
    note = f"Seed {seed}, not used before. Outcomes: {outcomes}."
    yield from percentile_table(times, "Verification", note)
    if not failing:
        return
    more = len(failing) - SHOWN_CASES
    rest = f" and {more:,} more, all of them in design.json" if more > 0 else ""
    command = f"jaxsat montecarlo {DESIGNED} --seed {seed} --case {failing[0]}"
    numbers = ", ".join(map(str, failing[:SHOWN_CASES]))
    sentences = [f"{numbers}{rest}.", f"To rerun one of them, with figures: `{command}`."]
    yield Lines("Cases that do not settle", sentences)
    if record["outcome"] != "reached":
        yield from _common_features(verification)


def _common_features(verification: Record) -> Iterator[Block]:
    title = "Common features of the failing cases"
    if verification["separations"]:
        rows: list[list[Cell]] = [
            [one["name"], one["share"], _three(one["failing"]), _three(one["settled"])]
            for one in verification["separations"]
        ]
        columns = ["number", "share explained", "failing: 10, 50, 90 %", "settled: 10, 50, 90 %"]
        yield Table(title, columns, rows)
    else:
        message = "No dispersed quantity separates them significantly from the settled cases."
        yield Lines(title, [message])
    if verification["limit"] is not None:
        limit = verification["limit"]
        sentence = f"With {limit['change']} {limit['settled']} of {limit['flown']} settle."
        yield Lines("Limiting factor", [sentence, *([limit["cause"]] if limit["cause"] else [])])
    if verification["remedies"]:
        rows = [[one["change"], _share_cell(one)] for one in verification["remedies"]]
        note = "The failing cases simulated again, each time with one change."
        yield Table("Possible remedies", ["change", "cases that then settle"], rows, note)


def _share_cell(one: Record) -> Shown:
    share = one["settled"] / one["flown"]
    return Shown(f"{one['settled']} of {one['flown']} ({share:.0%})", share)


def _three(values: Sequence[float | int]) -> str:
    return ", ".join(number_text(one, 3) for one in values)
