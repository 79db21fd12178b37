"""A flight is the same where inertia, torques and momenta are all multiplied by one number.

Powers of two round nothing, so that any number with a unit of its own shows in the last bit. What
scales is told by the units that the keys declare.
"""

import re

import jax.numpy as jnp
import numpy as np
import pydantic
import pytest

from helpers.every_law import PLANNED, scenario_of
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import WZ
from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build, build_loop
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.trajectory import Outcome
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.studies.changes import controller_of

pytestmark = pytest.mark.slow

FACTORS = (2.0**20, 2.0**-20)
START = PlantState(WZ([0.3, -0.2], 0.4).as_quaternion(), jnp.array([0.02, -0.03, 0.04]))
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


FLIGHTS = {
    "quaternion-feedback": "cubesat-12u",
    "three-slew": "acceptance-hard",
    "switching": "switching",
    "rate": "paper-rate",
    "one-torque": "one-torque-damping",
    "fault-tolerant": "hybrid-wheels",
    "magnetic": "wheel-and-rods",
}
"""Scenarios of the library by their laws."""

ELSEWHERE = ("oscillatory", PLANNED)
"""Flown at other masses in tests/control/test_similarity.py; and parts of three-slew."""


@pytest.mark.slow
@pytest.mark.parametrize("law", FLIGHTS)
def test_a_flight_of_each_law_is_the_same_at_any_mass(law):
    """The limit on the state of a run holds for none of its units of mass, either."""
    scenario = load(FLIGHTS[law])
    assert scenario.law.name == law
    first = build(scenario).simulate()
    for factor in FACTORS:
        require_the_same(build(scaled(scenario, factor)).simulate(), first, factor)


@pytest.mark.slow
@pytest.mark.parametrize("law", [law for law in LAWS if law not in (*FLIGHTS, *ELSEWHERE)])
def test_commands_of_every_other_law_have_the_unit_of_the_mass(law):
    scenario = scenario_of(law)

    def commanded(factor):
        loop = build_loop(scaled(scenario, factor))
        controller, state = controller_of(loop), loop.plant.complete(START)
        sampled = isinstance(controller, AbstractSampledController)
        command = controller.step if sampled else controller
        return np.asarray(command(jnp.array(0.3), state, controller.init(state))[0])

    own = commanded(1.0)
    assert law == "coast" or np.abs(own).max() > 1e-3
    for factor in FACTORS:
        np.testing.assert_array_equal(commanded(factor) / factor, own)


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
