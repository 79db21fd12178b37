"""Text from outside, made harmless."""

import math
import sys
import unicodedata

import pytest

from jaxsat.core.text import (
    at_least_digits,
    clean,
    fixed_text,
    markdown,
    number_text,
    suggestion,
    vector_text,
)


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


@pytest.mark.parametrize(
    ("word", "close"),
    [("thee-axis", "three-axis"), ("THREE-AXIS", "three-axis"), ("pd", "PD"), ("thr", "three-axis"),
     ("magnetic", None), ("three-axis" * 7, None)],
)  # fmt: skip
def test_the_closest_of_some_words_is_suggested(word, close):
    expected = f", did you mean {close}?" if close else ""
    assert suggestion(word, ["three-axis", "PD"]) == expected


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


@pytest.mark.parametrize(
    ("value", "scale", "shown"),
    [
        (1 / 3, 0.0, "0.3333"),
        (-0.0, 0.0, "0"),
        (math.nan, 0.0, "-"),
        (math.inf, 0.0, "inf"),
        (6.939e-18, 0.0, "6.939e-18"),  # a size of its own: nothing says that it is rounding
        (6.939e-18, 1.0, "0"),
        (-2e-14, 1.0, "-2e-14"),
    ],
)
def test_numbers_have_significant_digits(value, scale, shown):
    assert number_text(value, scale=scale) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [(-0.0004, "0.000"), (-0.0006, "-0.001"), (-0.0, "0.000"), (math.nan, "-"), (12.0, "12.000")],
)
def test_places_show_no_negative_zero(value, shown):
    assert fixed_text(value, 3) == shown


def test_entries_of_a_vector_are_rounded_by_the_largest():
    assert vector_text([6.939e-18, -1.0, -0.0]) == "(0, -1, 0)"
    assert vector_text([6.939e-18, 1e-17]) == "(6.939e-18, 1e-17)"
    assert vector_text([6.939e-18, math.nan], scale=1.0) == "(0, -)"


def test_more_digits_are_shown_where_they_are_asked_for():
    with at_least_digits(8):
        assert number_text(1 / 3) == "0.33333333"
        assert fixed_text(123.456789, 2) == "123.45679"
        assert fixed_text(0.5, 2) == "0.50000000"
        assert number_text(1 / 3, 10) == "0.3333333333"
    with at_least_digits(None):
        assert number_text(1 / 3) == "0.3333"
    assert number_text(1 / 3) == "0.3333"
