"""Units as text: to read, in data sets, and in names."""

import pytest

from jaxsat.core.declaration.actuators import SIGNALS
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.declaration.units import UNITS, data_unit, shown_unit


@pytest.mark.parametrize(
    ("shown", "stored"),
    [("rad/s", "rad s-1"), ("rad/s²", "rad s-2"), ("kg m²", "kg m2"), ("N m s", "N m s"),
     ("1", "1"), ("rad/s/√Hz", "rad s-1 Hz-0.5"), ("√kg m", "kg0.5 m"), ("1/s", "s-1")],
)  # fmt: skip
def test_a_factor_of_a_data_set_has_its_exponent_behind(shown, stored):
    assert data_unit(shown) == stored
    assert shown_unit(stored) == ("" if shown == "1" else shown)


def test_every_unit_has_both_forms():
    units = {*UNITS, *(one.unit for one in DISPERSIBLE.values())} - {"1"}
    assert units == {shown_unit(data_unit(one)) for one in units}
    stored = {one.units for one in SIGNALS.values()} - {"1", "degree"}
    assert stored == {data_unit(shown_unit(one)) for one in stored}


def test_other_units_stay():
    assert [shown_unit(one) for one in ("degree", "%", "m/s")] == ["°", "%", "m/s"]
