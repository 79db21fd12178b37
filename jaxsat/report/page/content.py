"""The content of a page: sections of blocks. Plain data, turned into HTML by the template."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

Cell = str | float | int | None


@dataclass(frozen=True)
class Facts:
    """Names and what there is to say of each, as a list of definitions."""

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
    """Rows that a reader can sort by any column; numbers are right-aligned and sort as numbers.

    `code` names the columns that hold commands; `command` is one for the whole table.
    """

    block: ClassVar[str] = "table"
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    code: frozenset[str] = frozenset()
    command: str = ""


class Key(NamedTuple):
    """What a line is in a legend: its name, colour, dashes and width as SVG has them."""

    label: str
    color: str
    dash: str
    width: float


@dataclass(frozen=True)
class Chart:
    """An interactive plot: its Bokeh figure and what it shows, for who cannot see it."""

    figure: Any
    title: str
    description: str
    legend: Sequence[Key] = ()


@dataclass(frozen=True)
class Charts:
    """Plots below each other."""

    block: ClassVar[str] = "charts"
    title: str
    charts: Sequence[Chart]


@dataclass(frozen=True)
class Replay:
    """3-D replays side by side with one time; `crafts` are those of `jaxsat.report.page.replay`."""

    block: ClassVar[str] = "replay"
    title: str
    crafts: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Listing:
    """A text as it stands, folded away; `file` is the name under which it can be saved."""

    block: ClassVar[str] = "listing"
    title: str
    text: str
    file: str


Block = Facts | Lines | Table | Charts | Replay | Listing


@dataclass(frozen=True)
class Verdict:
    """What came out, in words; `good` is None where it is neither good nor bad."""

    good: bool | None
    text: str
    more: Sequence[str] = ()


@dataclass(frozen=True)
class Section:
    """One result of the page; `plots` are its `TimePlots`, if it has any."""

    title: str
    kind: str
    verdict: Verdict
    blocks: Sequence[Block] = field(default_factory=tuple)
    plots: Any = None
