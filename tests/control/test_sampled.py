"""The modes of sampled controllers, as files and figures show them."""

import enum

import pytest

from jaxsat.control import (
    FiniteTimeRateLaw,
    OscillatoryLaw,
    OscillatorySettling,
    SwitchingLaw,
    ThreeSlewLaw,
    ThreeSlewSettling,
)
from jaxsat.control.sampled import mode_label

SHOWN = {
    SwitchingLaw: {0: "three-axis law", 1: "rate law"},
    OscillatorySettling: {3: "oscillating", 4: "regulating"},
    ThreeSlewSettling: {1: "stopping", 2: "slewing", 3: "oscillating", 4: "regulating"},
    ThreeSlewLaw: {0: "first slew", 1: "second slew", 2: "third slew", 3: "slewed"},
    FiniteTimeRateLaw: {0: "one law"},
    OscillatoryLaw: {0: "one law"},
}
"""Files of earlier versions hold these numbers and names."""


@pytest.mark.parametrize("law", SHOWN)
def test_numbers_and_names_of_modes_stay(law):
    assert {int(mode): mode_label(mode) for mode in law.modes} == SHOWN[law]


def test_a_plain_enumeration_needs_no_labels():
    mode = enum.IntEnum("Mode", {"DE_TUMBLING": 7})
    assert [mode_label(member) for member in mode] == ["de tumbling"]
