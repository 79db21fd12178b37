"""A document as Markdown."""

from collections.abc import Iterable, Iterator

from jaxsat.core.text import clean, markdown
from jaxsat.report.document import Document, Facts, Lines, Table, cell_text, prose


def markdown_page(document: Document) -> str:
    """The whole document but plots, replays and listings, which only a page shows."""
    verdict = document.verdict
    parts = [f"# {markdown(document.title)}", f"**{_prose(verdict.text)}**"]
    parts += [_items(verdict.more)] if verdict.more else []
    for block in document.blocks:
        if isinstance(block, Facts):
            lines = [f"{name}: {text}" for name, text in block.rows.items()]
            parts += [f"## {markdown(block.title)}", _items(lines)]
        elif isinstance(block, Lines):
            parts += [f"## {markdown(block.title)}", _items(block.lines)]
        elif isinstance(block, Table):
            parts += [f"## {markdown(block.title)}", *_table(block)]
    return "\n\n".join(parts) + "\n"


def _table(table: Table) -> Iterator[str]:
    if table.note:
        yield _prose(table.note)
    rows = table.rows[: table.first]
    lines = [table.columns, ["---"] * len(table.columns), *(map(cell_text, row) for row in rows)]
    yield "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)
    if len(rows) < len(table.rows):
        yield f"And {len(table.rows) - len(rows):,} more."


def _cell(text: str) -> str:
    return _prose(text) if text != "---" else text


def _items(lines: Iterable[str]) -> str:
    return "\n".join(f"- {_prose(line)}" for line in lines)


def _prose(text: str) -> str:
    return "".join(
        f"`{clean(piece)}`" if typed else markdown(piece) for typed, piece in prose(text)
    )
