"""Document of the worst case of a requirement, from `worst-case.json`."""

from collections.abc import Iterator

from jaxsat.core.text import number_text
from jaxsat.report.document import Document, Facts, Record, Shown, Table, Verdict


def worst_case_document(record: Record) -> Document:
    """Return the document: the least margin, the case that has it, and random cases beside it.

    Raises `KeyError` or `TypeError` for a record of another form.
    """
    within = f"{100 * record['settings']['within']:.6g} %"
    holds = record["margin"] is not None and record["margin"] >= 0
    how = "holds" if holds else "is violated"
    text = f"{record['requirement']} {how} in the worst case found: {_margin(record, 'margin')}."
    search = (
        f"It is the worst of {record['flights']:,} flights among the likeliest {within} of all."
    )
    verdict = Verdict(holds, text, [search])
    title = f"Worst case: {record['title']}, {record['requirement']}"
    return Document(title, verdict, [Facts("Search", dict(_facts(record))), _quantities(record)])


def _facts(record: Record) -> Iterator[tuple[str, str]]:
    yield "requirement", record["sentence"]
    if record["margin"] is None:
        yield "outcome", f"the case {record['outcome']}"
    else:
        yield "decided by", f"{record['signal']} at {number_text(record['time'], 6)} s"
    yield (
        "distance",
        f"{record['distance']:.2f} sigma from the middle of all cases, at most "
        f"{record['radius']:.2f}",
    )
    count = f"{record['settings']['flights']:,}"
    yield f"{count} flights of the search", _margin(record, "searched")
    yield f"{count} random flights", _margin(record, "random")
    yield (
        "gradients of the margin",
        f"{record['gradients']:,}, of which central differences agree with {record['trusted']:,}",
    )
    less = "less" if record["beats_random"] else "no less"
    yield "search or chance", f"the search found {less} than random flights"
    yield "flown again by", f"`{record['again']}`"


def _margin(record: Record, key: str) -> str:
    if record[key] is None:
        return "no margin, as a case ended early"
    return f"a margin of {number_text(record[key])} {record['unit']}".strip()


def _quantities(record: Record) -> Table:
    rows = [
        [
            one["quantity"] + (f" ({one['unit']})" if one["unit"] else ""),
            _numbers(one["values"], 4),
            Shown(_numbers(one["sigmas"], 3), max(map(abs, one["sigmas"]), default=0.0)),
        ]
        for one in record["quantities"]
    ]
    note = "Sigmas are standard normal numbers with the same quantiles; an attitude has three."
    return Table("Its draws", ["quantity", "values", "sigmas"], rows, note)


def quantity_text(one: Record) -> str:
    """Return a quantity of a record as a line: "omega: 0.1, -0.2, 0.03 rad/s"."""
    return f"{one['quantity']}: {_numbers(one['values'], 6)} {one['unit']}".rstrip()


def _numbers(values: list[float], digits: int) -> str:
    return ", ".join(number_text(one, digits) for one in values)
