"""A result as a document: a verdict and blocks, which printers turn into text, Markdown and HTML.

Prose is plain text in which `backticks` enclose code. Printers escape all the rest.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from jaxsat.core.text import number_text


@dataclass(frozen=True)
class Shown:
    """A table cell: it displays `text`, sorts by `value` and is `good`, bad or neither (None)."""

    text: str
    value: float | int | None = None
    good: bool | None = None


Cell = Shown | str | float | int | None

Record = Mapping[str, Any]
"""Plain data of a result, as its JSON file has them."""


@dataclass(frozen=True)
class Facts:
    """Named facts, as a list of definitions."""

    block: ClassVar[str] = "facts"
    title: str
    rows: Mapping[str, str]


@dataclass(frozen=True)
class Lines:
    """Sentences, as a list."""

    block: ClassVar[str] = "lines"
    title: str
    lines: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Rows with a cell for each column.

    A page shows all rows and lets a reader sort them. Text shows the `first` ones, by default all.
    """

    block: ClassVar[str] = "table"
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    first: int | None = None


class LegendKey(NamedTuple):
    """Legend entry of a line: name, colour, dashes and width in SVG's form."""

    label: str
    color: str
    dash: str
    width: float


@dataclass(frozen=True)
class Chart:
    """An interactive plot: its Bokeh figure, and a description for screen readers."""

    figure: Any
    title: str
    description: str
    legend: Sequence[LegendKey] = ()


@dataclass(frozen=True)
class Charts:
    """Plots below each other; only on pages."""

    block: ClassVar[str] = "charts"
    title: str
    charts: Sequence[Chart]


@dataclass(frozen=True)
class ReplayScene:
    """3-D replays side by side at one time; `crafts` are those of `jaxsat.report.page.replay`.

    Only on pages.
    """

    block: ClassVar[str] = "replay"
    title: str
    crafts: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Listing:
    """A file, with the name under which it can be saved; only on pages, folded."""

    block: ClassVar[str] = "listing"
    title: str
    text: str
    file: str


Block = Facts | Lines | Table | Charts | ReplayScene | Listing


@dataclass(frozen=True)
class Verdict:
    """The result in words; `good` is None where it is neither good nor bad."""

    good: bool | None
    text: str
    more: Sequence[str] = ()


@dataclass(frozen=True)
class Document:
    """A result; `kind` says what it is and where it came from.

    `plots` is their `TimeWindow`, or None.
    """

    title: str
    verdict: Verdict
    blocks: Sequence[Block] = field(default_factory=tuple)
    kind: str = ""
    plots: Any = None


def cell_text(cell: Cell) -> str:
    """Return the text of a cell; a dash for an empty one."""
    if cell is None:
        return "–"
    if isinstance(cell, Shown):
        return cell.text
    return number_text(cell) if isinstance(cell, float) else str(cell)


def is_number(cell: Cell) -> bool:
    """Whether a cell sorts as a number."""
    value = cell.value if isinstance(cell, Shown) else cell
    return isinstance(value, int | float)


def prose(text: str) -> Iterator[tuple[bool, str]]:
    """Yield the pieces of prose, and for each whether it is code."""
    pieces = text.split("`")
    if len(pieces) % 2 == 0:  # a mark without its pair is no mark
        pieces = [text]
    for place, piece in enumerate(pieces):
        if piece:
            yield place % 2 == 1, piece
