"""A document as text for a terminal."""

from collections.abc import Iterator
from typing import Any

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as Grid
from rich.text import Text

from jaxsat.core.text import clean
from jaxsat.report.document import Document, Facts, Lines, Shown, Table, cell_text, is_number

STYLES = {True: "green", False: "red", None: ""}
WIDEST = 10**4
"""Columns of an output that is no terminal: a reader of lines finds a row on one line."""


def terminal_text(document: Document) -> str:
    """The whole document but plots, replays and listings, which only a page shows.

    Coloured, and folded to the width, where standard output is a terminal. A table is as wide as
    its longest words need.
    """
    console = Console(markup=False, highlight=False, soft_wrap=True)
    width = console.width if console.is_terminal else WIDEST
    with console.capture() as caught:
        for part in _parts(document):
            if isinstance(part, Grid):
                options = console.options.update(width=WIDEST)
                console.width = max(width, Measurement.get(console, options, part).minimum)
            console.print(part, soft_wrap=not isinstance(part, Grid))
    return "".join(line.rstrip() + "\n" for line in caught.get().splitlines())


def _parts(document: Document) -> Iterator[Any]:
    verdict = document.verdict
    yield Text(clean(document.title), "bold")
    yield Text(clean(verdict.text), STYLES[verdict.good])
    yield from _items(verdict.more)
    for block in document.blocks:
        if isinstance(block, Facts | Lines | Table):
            yield Text(f"\n{clean(block.title)}", "bold")
        if isinstance(block, Facts):
            grid = Grid.grid(padding=(0, 2, 0, 0))
            for name, text in block.rows.items():
                grid.add_row(clean(name), clean(text))
            yield grid
        elif isinstance(block, Lines):
            yield from _items(block.lines)
        elif isinstance(block, Table):
            yield from _table(block)


def _items(lines: Any) -> Iterator[Text]:
    return (Text(f"- {clean(line)}") for line in lines)


def _table(table: Table) -> Iterator[Any]:
    if table.note:
        yield Text(clean(table.note), "dim")
    rows = table.rows[: table.first]
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="")
    for place, column in enumerate(table.columns):
        numbers = all(is_number(row[place]) or row[place] is None for row in rows)
        grid.add_column(Text(clean(column)), justify="right" if numbers else "left")
    for row in rows:
        styles = [STYLES[cell.good] if isinstance(cell, Shown) else "" for cell in row]
        texts = [clean(cell_text(cell)) for cell in row]
        grid.add_row(*map(Text, texts, styles))
    yield grid
    if len(rows) < len(table.rows):
        yield Text(f"and {len(table.rows) - len(rows):,} more")
