"""Printers of a document as text: for a terminal, and as Markdown."""

import io
import textwrap
from collections.abc import Iterable, Iterator
from typing import Any

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as Grid
from rich.text import Text

from jaxsat.core.text import clean, markdown
from jaxsat.report.document import (
    Cell,
    Document,
    Facts,
    Lines,
    Shown,
    Table,
    cell_text,
    is_number,
    prose,
)

STYLES = {True: "green", False: "red", None: ""}
WIDEST = 10**4
"""Columns of an output that is no terminal, where only sentences in a table are folded."""

SENTENCE = 60
"""Columns beyond which a cell of text is folded."""


def terminal_text(document: Document) -> str:
    """Return the document without plots, replays and listings, which only a page shows.

    Text is coloured, and folded to the width, where standard output is a terminal. A table is as
    wide as its longest words need.
    """
    console = Console(markup=False, highlight=False, soft_wrap=True)
    width = console.width if console.is_terminal else WIDEST
    console.file = io.StringIO()  # what is captured is flushed to it, and may find a closed pipe
    with console.capture() as capture:
        for part in _parts(document):
            if isinstance(part, Table):
                _print_table(console, part, width)
            else:
                console.print(part, soft_wrap=not isinstance(part, Grid))
    return "".join(line.rstrip() + "\n" for line in capture.get().splitlines())


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
            grid.add_column()
            grid.add_column(overflow="fold")  # a path in a command is not cut
            for name, text in block.rows.items():
                grid.add_row(clean(name), clean(text))
            yield grid
        elif isinstance(block, Lines):
            yield from _items(block.lines)
        elif isinstance(block, Table):
            if block.note:
                yield Text(clean(block.note), "dim")
            yield block
            if (more := len(block.rows) - len(block.rows[: block.first])) > 0:
                yield Text(f"and {more:,} more")


def _items(lines: Any) -> Iterator[Text]:
    return (Text(f"- {clean(line)}") for line in lines)


def _print_table(console: Console, table: Table, width: int) -> None:
    """Print a table in `width` columns, with intervals on lines of their own if it is too wide."""
    for below in (False, True):
        grid = _grid(table, below)
        options = console.options.update(width=WIDEST)
        least, most = Measurement.get(console, options, grid)
        if most <= width:
            break
    console.width = max(width, least)
    console.print(grid, soft_wrap=False)


def _grid(table: Table, below: bool) -> Grid:
    """Return the table for rich; with `below` the interval of a number is on its own line."""
    rows = table.rows[: table.first]
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="")
    for place, heading in enumerate(map(clean, table.columns)):
        cells = [row[place] for row in rows]
        if all(is_number(cell) or cell is None for cell in cells):
            lines = [line for cell in cells for line in _cell(cell, below).split("\n")]
            if below:
                heading = textwrap.fill(heading, max(map(len, (*heading.split(), *lines))))
            grid.add_column(Text(heading), justify="right", no_wrap=True)
        else:
            grid.add_column(Text(heading), max_width=SENTENCE)
    for row in rows:
        styles = [STYLES[cell.good] if isinstance(cell, Shown) else "" for cell in row]
        grid.add_row(*map(Text, (_cell(cell, below) for cell in row), styles))
    return grid


def _cell(cell: Cell, below: bool) -> str:
    text = clean(cell_text(cell))
    return text.replace(" (", "\n(", 1) if below and is_number(cell) else text


def markdown_page(document: Document, level: int = 1) -> str:
    """Return the document without plots, replays and listings, which only a page shows.

    Its title is a heading of this `level`.
    """
    verdict, sub = document.verdict, "#" * (level + 1)
    parts = [f"{sub[1:]} {markdown(document.title)}", f"**{_prose(verdict.text)}**"]
    parts += [_markdown_items(verdict.more)] if verdict.more else []
    for block in document.blocks:
        if isinstance(block, Facts):
            lines = [f"{name}: {text}" for name, text in block.rows.items()]
            parts += [f"{sub} {markdown(block.title)}", _markdown_items(lines)]
        elif isinstance(block, Lines):
            parts += [f"{sub} {markdown(block.title)}", _markdown_items(block.lines)]
        elif isinstance(block, Table):
            parts += [f"{sub} {markdown(block.title)}", *_markdown_table(block)]
    return "\n\n".join(parts) + "\n"


def notebook_text(result: Any) -> str:
    """Return the `document` of a result in Markdown, with headings for a cell of a notebook."""
    return markdown_page(result.document, level=4)


def _markdown_table(table: Table) -> Iterator[str]:
    if table.note:
        yield _prose(table.note)
    rows = table.rows[: table.first]
    lines = [table.columns, ["---"] * len(table.columns), *(map(cell_text, row) for row in rows)]
    yield "\n".join(f"| {' | '.join(map(_markdown_cell, line))} |" for line in lines)
    if len(rows) < len(table.rows):
        yield f"And {len(table.rows) - len(rows):,} more."


def _markdown_cell(text: str) -> str:
    return _prose(text) if text != "---" else text


def _markdown_items(lines: Iterable[str]) -> str:
    return "\n".join(f"- {_prose(line)}" for line in lines)


def _prose(text: str) -> str:
    return "".join(
        f"`{clean(piece)}`" if is_code else markdown(piece) for is_code, piece in prose(text)
    )
