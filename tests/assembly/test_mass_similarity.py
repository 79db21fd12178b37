"""A flight is the same where inertia, torques and momenta are all multiplied by one number.

Powers of two round nothing, so that any number with a unit of its own shows in the last bit. What
scales is told by the units that the keys declare.
"""

import re

import numpy as np
import pydantic
import pytest

from jaxsat.assembly.load import load
from jaxsat.assembly.run import build
from jaxsat.simulation import Outcome

pytestmark = pytest.mark.slow

FACTORS = (2.0**20, 2.0**-20)
WITH_MASS = re.compile(r"\bkg\b|\bN\b|\bA\b")


def scaled(value, factor, unit=None):
    """A table, or the value of a key with this unit, with what has a mass in it multiplied."""
    if isinstance(value, pydantic.BaseModel):
        fields = type(value).model_fields.items()
        return value.model_copy(
            update={
                name: scaled(getattr(value, name), factor, unit_of(field)) for name, field in fields
            }
        )
    if isinstance(value, tuple):
        return tuple(scaled(one, factor, unit) for one in value)
    has_mass = unit is not None and WITH_MASS.search(unit) and "/(" not in unit
    return value * factor if has_mass and value is not None else value


def unit_of(field):
    extra = field.json_schema_extra
    return extra.get("unit") if isinstance(extra, dict) else None


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("cubesat-12u", 0),
        ("failures-12u", 0),
        ("acceptance-hard", 0),
        ("oscillatory-dispersed", 0),
        ("switching", 0),
        ("paper-rate", 0),
        ("one-torque-damping", 1e-9),  # quotients and roots kept finite by 1e-30
        ("two-wheel-telescope", 1e-6),  # the absolute tolerance of momenta is in N m s
        ("wheels-fail", 1e-5),  # friction stops a wheel at 1e-300 N m s, or at zero
    ],
)
def test_a_flight_of_each_law_is_the_same_at_any_mass(name, tolerance):
    """The limit on the state of a run holds for none of its units of mass, either."""
    scenario = load(name)
    first = build(scenario).simulate()
    assert first.code == Outcome.SUCCESS
    for factor in FACTORS:
        other = build(scaled(scenario, factor)).simulate()
        assert other.code == Outcome.SUCCESS
        for signal in ("quaternion", "omega", "mode"):
            found, right = (np.asarray(getattr(run.signals, signal)) for run in (other, first))
            np.testing.assert_allclose(found, right, rtol=0, atol=tolerance)
