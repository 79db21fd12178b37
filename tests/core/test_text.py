"""Text from outside, made harmless."""

import sys
import unicodedata

import pytest

from jaxsat.core.text import clean, markdown


@pytest.mark.slow
def test_no_character_hides_or_steers():
    everything = "".join(map(chr, range(sys.maxunicode + 1)))
    shown = clean(everything)
    shown.encode("utf-8")  # no lone surrogate is left
    kinds = {unicodedata.category(one) for one in shown if one not in "\u200c\u200d"}
    assert not kinds & {"Cc", "Cf", "Cs", "Zl", "Zp"}


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("ω√ déjà 中 ", "ω√ déjà 中 "),
        ("a\x1b[31mb", "a\\x1b[31mb"),
        ("two\nlines\r\t\0", "two\\nlines\\r\\t\\x00"),
        ("\udcff\ud800", "\\xff\\ud800"),
        ("\u202egnp.exe", "\\u202egnp.exe"),
    ],
)
def test_what_is_hidden_is_shown(text, shown):
    assert clean(text) == shown


def test_long_text_is_cut():
    assert clean("x" * 11, 10) == "x" * 9 + "…"
    assert clean("x" * 10, 10) == "x" * 10


def test_pages_take_no_markup():
    page = markdown("<script> & [a](b) `c` *d* $k_3$\n# e</script>")
    assert "<" not in page
    assert "\n" not in page
    assert page == (
        "&lt;script&gt; &amp; \\[a\\](b) \\`c\\` \\*d\\* \\$k\\_3\\$\\\\n\\# e&lt;/script&gt;"
    )
