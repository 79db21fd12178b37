"""The table of what is left: the verdict before the flight, and what the law does in it."""

import jax.numpy as jnp
import pytest

from helpers.compiling import interpreted
from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.scenario.build.actuator_set import judge_scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.studies.torques_left import _LEFT, _UNFLOWN

REST = ["initial.omega_rad_s=[0,0,0]", "failure=[]"]
SPUN = ["initial.omega_rad_s=[1e-3,5e-4,-8e-4]", "failure=[]"]


def without(scenario, kind, *failed):
    """A scenario with some actuators of a kind, numbered from 0, failed before the start."""
    own = [
        one.model_copy(update={"failed": place in failed})
        for place, one in enumerate(getattr(scenario, kind))
    ]
    return scenario.model_copy(update={kind: tuple(own)})


def wheels_of(scenario, *failed):
    return without(scenario, "wheel", *failed)


CASES = {
    "three torques": lambda: wheels_of(load("wheels-fail", REST), 0),
    "two torques": lambda: without(load("thruster-dies", REST), "thruster", 5),
    "two wheels": lambda: wheels_of(load("wheels-fail", REST), 0, 1),
    "nearest attitude": lambda: wheels_of(load("wheels-fail", SPUN), 0, 1),
    "magnetic": lambda: wheels_of(load("cubesat-3w3m", REST), 0),
    "none": lambda: wheels_of(load("wheels-fail", REST), 0, 1, 2),
}


SLOW = ("two torques", "magnetic")


@pytest.mark.parametrize(
    "laws", [pytest.param(one, marks=[pytest.mark.slow] * (one in SLOW)) for one in CASES]
)
def test_the_law_does_what_controllability_says(laws):
    scenario = CASES[laws]()
    assert judge_scenario(scenario).laws == laws
    run = build(scenario)
    law, start = run.loop.controller, run.loop.plant.complete(run.start)
    _, memory = interpreted(law.step, jnp.zeros(()), start, law.init(start))
    assert int(law.mode(memory)) in FLYABLE[laws].modes


def test_every_verdict_that_a_law_flies_has_its_row():
    assert {laws for laws, one in FLYABLE.items() if one.everywhere} == set(_LEFT)
    assert {laws for laws, one in FLYABLE.items() if one.laws == ()} == {"none"}
    modes = [mode for one in FLYABLE.values() for mode in one.modes]
    assert len(modes) == len(set(modes))
    assert not set(_UNFLOWN.values()) & {_LEFT["three torques"], _LEFT["magnetic"]}
