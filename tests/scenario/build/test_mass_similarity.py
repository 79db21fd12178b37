"""A flight is the same where inertia, torques and momenta are all multiplied by one number.

Powers of two round nothing, so that any number with a unit of its own shows in the last bit. What
scales is told by the units that the keys declare.
"""

import re

import numpy as np
import pydantic
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.trajectory import Outcome

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


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "cubesat-12u",
        "acceptance-hard",
        "switching",
        "paper-rate",
        "one-torque-damping",
        "hybrid-wheels",
        "wheel-and-rods",
    ],
)
def test_a_flight_of_each_law_is_the_same_at_any_mass(name):
    """The limit on the state of a run holds for none of its units of mass, either."""
    scenario = load(name)
    first = build(scenario).simulate()
    for factor in FACTORS:
        require_the_same(build(scaled(scenario, factor)).simulate(), first, factor)


@pytest.mark.slow
@pytest.mark.parametrize("rotor", ["", "rotor_inertia_kg_m2=0.1, "])
def test_steps_of_both_integrators_are_the_same_at_any_mass(rotor):
    """Until a wheel is at its momentum limit; diffrax chooses its first step by itself.

    It locates the limit in the same way with a rotor and without: with one is enough.
    """
    scenario = load("two-wheel-telescope", [with_limits(rotor), "simulation.duration_s=60"])
    runs = [build(scaled(scenario, factor)) for factor in (1.0, *FACTORS)]
    for fly in (by_machine_code, by_diffrax) if rotor else (by_machine_code,):
        first, *others = [fly(run) for run in runs]
        largest = np.abs(first.signals.parts["wheel_momentum"]).max()
        assert largest == pytest.approx(3.0, abs=1e-6)
        for factor, other in zip(FACTORS, others, strict=True):
            require_the_same(other, first, factor)
            assert other.steps == first.steps


def with_limits(rotor):
    """Wheels about body x and y that come to the limit of their momentum."""
    numbers = f"torque_limit_N_m=0.4, momentum_limit_N_m_s=3.0, {rotor}"
    axes = "[1.0, 0.0, 0.0]", "[0.0, 1.0, 0.0]"
    return f"wheel=[{', '.join(f'{{{numbers}axis={axis}}}' for axis in axes)}]"


def by_machine_code(run):
    return run.simulate()


def by_diffrax(run):
    return simulate(run.loop, run.start, run.times, method=run.method)


def require_the_same(other, first, factor):
    assert other.code == first.code == Outcome.SUCCESS
    for signal in ("quaternion", "omega", "mode"):
        found, right = (np.asarray(getattr(run.signals, signal)) for run in (other, first))
        np.testing.assert_array_equal(found, right)
    if "wheel_momentum" in first.signals.parts:
        found, right = (np.asarray(run.signals.parts["wheel_momentum"]) for run in (other, first))
        np.testing.assert_array_equal(found / factor, right)
