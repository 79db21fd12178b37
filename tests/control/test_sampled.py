"""The modes of sampled controllers, as files and figures show them."""

import enum

import equinox as eqx
import jax.numpy as jnp
import pytest

from control.laws import FiniteTimeRateLaw, OscillatoryLaw, ThreeSlewLaw
from jaxsat.control.fine import OscillatorySettling
from jaxsat.control.sampled import AbstractSampledController, mode_label
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.control.switching import SwitchingLaw

SHOWN = {
    SwitchingLaw: {0: "three-axis law", 1: "rate law"},
    OscillatorySettling: {3: "oscillating", 4: "holding"},
    ThreeSlewSettling: {1: "stopping", 2: "slewing", 3: "oscillating", 4: "holding"},
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


class _Law(AbstractSampledController):
    period: jnp.ndarray = eqx.field(converter=jnp.asarray, default=0.1)

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return jnp.zeros(2), memory

    def rate_error(self, state, memory):
        return jnp.full(2, jnp.nan)


class _Named(_Law):
    modes = {0: "one"}  # noqa: RUF012


class _Untold(_Law):
    modes = enum.IntEnum("Mode", ["FIRST", "SECOND"])


def test_a_law_of_one_mode_needs_to_tell_nothing():
    assert int(_Law().mode(None)) == 0


@pytest.mark.parametrize(
    ("law", "message"), [(_Named, "_Named.modes must be an enum.IntEnum"), (_Untold, "`mode`")]
)
def test_modes_that_cannot_be_told_are_refused(law, message):
    with pytest.raises(TypeError, match=message):
        law()
