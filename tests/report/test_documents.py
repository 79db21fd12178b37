"""One document, printed three ways."""

import errno
import io
import sys

from markdown_it import MarkdownIt

from jaxsat.report.document import Document, Facts, Lines, Listing, Shown, Table, Verdict
from jaxsat.report.page.html import render
from jaxsat.report.printers import markdown_page, terminal_text

NASTY = "a|b <b>*c*</b> \x1b[31m"
TABLE = Table(
    "Rows of |w|",
    ["what", "value"],
    [[NASTY, 2.0], ["none", None], ["shown", Shown("99.9% (99% to 100%)", 0.999)]],
    "Type `jaxsat <this>`.",
    first=2,
)
DOCUMENT = Document(
    NASTY,
    Verdict(True, "It *settles*.", ["So `it` says."]),
    [
        Facts("Facts", {"law": "rate_law"}),
        Lines("Lines", ["one", "an odd ` mark"]),
        TABLE,
        Listing("File", "title", "scenario.toml"),
    ],
)


def test_markdown_escapes_all_but_what_is_typed():
    page = markdown_page(DOCUMENT)
    assert "\n**It \\*settles\\*.**\n\n- So `it` says.\n" in page
    assert "Type `jaxsat <this>`." in page
    assert "| none | – |" in page
    assert "And 1 more." in page
    assert "scenario.toml" not in page
    html = MarkdownIt().enable("table").render(page)
    assert html.count("<td>") == 4
    assert "<td>a|b &lt;b&gt;*c*&lt;/b&gt; " in html
    assert "<h2>Rows of |w|</h2>" in html


def test_a_terminal_shows_each_row_on_a_line_and_nothing_that_moves_the_cursor():
    text = terminal_text(DOCUMENT)
    assert "\x1b" not in text
    lines = text.splitlines()
    assert lines[1] == "It *settles*."
    assert "law  rate_law" in lines
    assert lines[lines.index("Rows of |w|") + 1] == "Type `jaxsat <this>`."
    assert sum(line.startswith("a|b") for line in lines) == 2
    assert any(line.startswith("none") and line.endswith("–") for line in lines)
    assert lines[-1] == "and 1 more"
    rows = [[str(number), *range(10**9, 10**9 + 20)] for number in range(3)]
    wide = Document("t", Verdict(None, "v"), [Table("wide", ["n", *"a" * 20], rows)])
    assert len(terminal_text(wide).splitlines()) == 2 + 2 + 2 + 3


def test_making_text_writes_nothing(monkeypatch):
    """The command writes it, and tells of a standard output that is full or closed."""

    class Full(io.StringIO):
        def write(self, text):
            raise OSError(errno.ENOSPC, "No space left on device")

    expected = terminal_text(DOCUMENT)
    monkeypatch.setattr(sys, "stdout", Full())
    assert terminal_text(DOCUMENT) == expected


def test_sentences_in_a_table_are_folded_and_numbers_never():
    rows = [["1", "word " * 100, Shown("99.90% (99.64% to 99.97%)", 0.999)]]
    told = Document("t", Verdict(None, "v"), [Table("wide", ["n", "text", "settled"], rows)])
    lines = terminal_text(told).splitlines()
    assert max(map(len, lines)) < 100
    assert sum("word" in line for line in lines) == 9
    assert sum(line.endswith("99.90% (99.64% to 99.97%)") for line in lines) == 1


def test_a_narrow_terminal_has_intervals_in_a_line_of_their_own(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    interval = Shown("99.90% (99.64% to 99.97%)", 0.999)
    table = Table("t", ["quantity", *"abcd"], [["settled, of all that there are", *[interval] * 4]])
    text = terminal_text(Document("t", Verdict(None, "v"), [table]))
    assert text.count("99.90%") == text.count("(99.64% to 99.97%)") == 4
    assert text.count("\n") == 2 + 2 + 2 + 2


def test_a_page_shows_all_rows_and_what_is_typed_as_code():
    page = render([DOCUMENT], "t")
    assert "<code>jaxsat &lt;this&gt;</code>" in page
    assert '<td class="number" data-value="0.999">99.9% (99% to 100%)</td>' in page
    assert "<li>an odd ` mark</li>" in page
    assert "<b>" not in page[page.index("<main") : page.index("</main>")]
