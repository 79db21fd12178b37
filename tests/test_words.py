"""Habits of wording that readers stumble over: none in pages, docstrings and messages."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

HABITS = {
    r"\b(is|are|was|were|as|been|nothing) told\b": "reports, warns of, names, receives",
    r"\btold (by|of|from|before|beside|at once)\b": "reported, distinguished",
    r"\btells? of\b": "reports, names, warns of",
    r"\bwhat (both |they |it |one |NumPy |gcc )?makes? of\b": "the result of, computes from",
    r"\bwhat counts as\b": "tolerance, or the term of what it is",
    r"\b(is|are) no numbers?\b|\bno number is\b": "NaN, or text",
    r"\bless sure\b": "with lower confidence, significantly fewer",
    r"\bsurely\b": "with 95 % confidence, always",
    r"\bwanted (were|was)\b|\bthe wanted (fraction|accuracy)\b": "required",
    r"\bany return from\b": "cannot",
    r"\bof those that end\b": "over completed cases",
    r"\bmain job\b": "the published study",
    r"\bgo(es)? on with\b": "resumes, continues with",
}
"""Pattern of a habit, and what plain technical English says instead."""


def _comments_and_text(source: str) -> Iterator[tuple[int, str]]:
    """Yield comments, and strings of several words that are not code, with their lines."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
            if " " in text.strip() and ";\n" not in text and not text.rstrip().endswith(";"):
                yield node.lineno, text
    for number, line in enumerate(source.splitlines(), 1):
        if "#" in line:  # in a text as well, which is looked at twice then
            yield number, line[line.index("#") :]


def _prose(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the prose of a file by piece: number of its first line, text."""
    source = file.read_text(encoding="utf-8")
    if file.suffix == ".py":
        yield from _comments_and_text(source)
    elif file.suffix == ".ipynb":
        cells = json.loads(source)["cells"]
        yield from ((1, "".join(c["source"])) for c in cells if c["cell_type"] == "markdown")
    else:
        yield 1, source


def _files() -> list[Path]:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
    return [*pages, *(ROOT / "notebooks").glob("*.ipynb"), *(ROOT / "jaxsat").rglob("*.py")]


def habits(text: str, line: int = 1) -> Iterator[str]:
    """Yield each habit of a text, with its line and what to write in its place."""
    for pattern, better in HABITS.items():
        for match in re.finditer(pattern.replace(" ", r"\s+"), text, re.IGNORECASE):
            number = line + text.count("\n", 0, match.start())
            yield f"{number}: {' '.join(match.group().split())!r}: {better}"


@pytest.mark.parametrize(
    "text",
    [
        "A wheel is\ntold of.",
        "It surely settles.",
        "99 % of those that end",
        "Any row that is no number.",
    ],
)
def test_habits_are_found(text: str) -> None:
    assert list(habits(text))


def test_no_habit_in_what_users_and_readers_read() -> None:
    faults = [
        f"{file.relative_to(ROOT)}:{fault}"
        for file in _files()
        for line, text in _prose(file)
        for fault in habits(text, line)
    ]
    assert not faults, "\n".join(faults)
