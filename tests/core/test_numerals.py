"""Numbers as a person reads them."""

import math

import pytest

from jaxsat.core.numerals import at_least_digits, fixed_text, number_text, vector_text


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
