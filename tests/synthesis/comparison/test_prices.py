"""Prices of laws: from columns and limits made by hand."""

import numpy as np
import pytest

import jaxsat
from jaxsat.report.comparison_document import price_table
from jaxsat.synthesis.comparison.verdict import NO_PRICES, Prices, prices_of

COLUMNS = {
    "code": np.array([0, 0, 0, 1]),  # the last case ends early, and counts nowhere
    "ended_at": np.array([1200.0, 1200.0, 1200.0, 1.0]),
    "propellant": np.array([0.01, 0.03, 0.02, 9.0]),
    "peak_wheel_momentum": np.array([[5, 1, 1, 1], [1, 1, 8, 1], [1, 6, 1, 1], [20, 20, 20, 20.0]]),
    "pointing_error": np.array([0.5, 0.1, 0.2, 90.0]),
}


@pytest.fixture(scope="module")
def mix():
    return jaxsat.load("hybrid-wheels", purpose="text")


def test_prices_of_a_mix_are_medians_of_completed_cases(mix):
    """0.02 kg in 1200 s are 1.44 kg a day; the wheels hold up to 20 N m s, and 6 of it."""
    prices = prices_of(mix, COLUMNS)
    assert prices.propellant_kg_day == pytest.approx(1.44)
    assert prices.momentum_margin == pytest.approx(1 - 6 / 20)
    assert prices.pointing_error_deg == 0.2


def test_what_a_vehicle_lacks_has_no_price(mix):
    no_wheels = mix.model_copy(update={"wheel": (), "thruster": ()})
    assert prices_of(no_wheels, COLUMNS) == Prices(pointing_error_deg=0.2)
    failed = {**COLUMNS, "code": np.ones(4)}
    assert prices_of(mix, failed) == NO_PRICES
    rows = [{"law": "one", "prices": Prices(momentum_margin=0.5)._asdict()}, {"law": "old"}]
    (table,) = price_table(rows)
    assert (list(table.columns), table.rows) == (["law", "momentum margin"], [["one", 0.5]])
    assert not list(price_table([{"law": "one", "prices": NO_PRICES._asdict()}]))
