"""Gradients through whole runs of laws with every default, against central differences."""

import numpy as np
import pytest

from helpers.every_law import PLACES, UPSIDE_DOWN, scenario_of
from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.build.run import build_loop
from jaxsat.studies.changes import controller_of
from jaxsat.studies.dispersions import number_at
from jaxsat.synthesis.tuning.build import build_plan
from jaxsat.synthesis.tuning.receipt import check_gradients

CASES = 2
ROUNDING = 1e-9
"""Of a cost whose derivative counts for nothing, in seconds."""

CORNERED_LAW = "oscillatory"
LEAST = {"exponent": 1.2}
LARGEST = {"share": 0.9}
"""Bounds that a gain's own range asks for, by what its key ends with."""

ELSEWHERE = ("three-axis",)
"""A minute; tests/compiler/test_switched.py has the derivatives of its whole runs by all gains."""

TUNED = [
    name
    for name, law in LAWS.items()
    if law.declaration.tunable
    and name not in ELSEWHERE
    and not law.declaration.searched
    and not law.declaration.commands_actuators
]


def bounds_of(law):
    """Bounds around every gain of a law as it is by default."""
    loop = build_loop(scenario_of(law))
    found = {}
    for key, place in LAWS[law].declaration.tunable.items():
        value = np.asarray(number_at(controller_of(loop), place))
        end = key.rsplit("_", 1)[-1]
        low = max(value.min() / 2, LEAST.get(end, 0.0))
        if value.min() > 0 and "threshold" not in key:
            found[key] = {"low": low, "high": min(value.max() * 2, LARGEST.get(end, np.inf))}
    return found


def plan_of(law, place):
    """Tuning all gains of a law over 20 s from rest in a place, or from a tumble."""
    if place == "a start":  # from which no switch is so near that a difference meets it
        return plan_from(law, [0.8, 0.6, 0.0, 0.0], [0.011, -0.021, 0.03])
    return plan_from(law, PLACES[place], [0.0, 0.0, 0.0])


def plan_from(law, quaternion, rates):
    """The same from an attitude and rates (rad/s)."""
    spread = {"distribution": "uniform", "low": -0.05, "high": 0.05}
    tuning = {"starts": 1, "steps": 1, "cases": CASES, "parameters": bounds_of(law)}
    solver = {} if law == CORNERED_LAW else {"solver": {"name": "tsit5"}}  # half the stages
    scenario = scenario_of(
        law,
        initial={"quaternion": quaternion, "omega_rad_s": rates},
        simulation={"duration_s": 20, "save_every_s": 1.0, **solver},
        orbit={"rate_rad_s": 0.0},
        dispersion={"inertia": spread},
        tuning={**tuning, "cost": {"settling": 1.0}},
    )
    return build_plan(scenario, batch_size=4)


@pytest.mark.slow
@pytest.mark.parametrize("place", [place for place in PLACES if place not in UPSIDE_DOWN])
@pytest.mark.parametrize("law", TUNED)
def test_gradients_through_whole_runs_are_those_of_differences(law, place):
    plan = plan_of(law, place)
    assert plan.remark is None
    point = plan.space.to_search(plan.start[None])[0]
    found = check_gradients(plan.smooth, point, np.arange(CASES))
    assert (found.cases, found.left_out) == (CASES, 0)
    off = np.abs(found.automatic - found.difference)
    assert np.all(off <= 1e-4 * np.abs(found.difference).max() + ROUNDING)
    if place == "a start":
        assert np.abs(found.difference).max() > 1e-3


CORNERED = (
    ([0.0866756, -0.9432953, 0.2610341, 0.1858561], [0.024686, 0.0252223, 0.0066978]),
    ([-0.5746674, -0.6550689, 0.2576006, 0.417475], [-0.0373981, -0.0084835, 0.0168157]),
    ([-0.0030516, 0.8389583, 0.5233678, 0.1490832], [-0.0106335, -0.04804, 0.002775]),
)
NARROW = 1e-7


@pytest.mark.slow
@pytest.mark.parametrize(("quaternion", "rates"), CORNERED)
def test_wide_differences_reach_across_corners_of_a_sampled_law(quaternion, rates):
    """A limit that is just met at one of 200 samples is a corner of the cost as good as anywhere.

    The derivative is that of the side where the gains are: differences of either side agree where
    they are narrower than the way to the corner, and differ from each other where they are wider.
    """
    plan = plan_from(CORNERED_LAW, quaternion, rates)
    point = plan.space.to_search(plan.start[None])[0]
    cases, count = np.arange(CASES), len(point)
    slopes = plan.smooth.differentiate(point[None], cases).derivatives[0]
    cost = plan.smooth.evaluate(point[None], cases).cost[0]

    def one_sided(width):
        shifts = width * np.eye(count)
        return [
            (np.asarray(plan.smooth.evaluate(point + way, cases).cost) - cost).T / np.diag(way)
            for way in (shifts, -shifts)
        ]

    size = np.abs(slopes).max()
    apart = np.abs(np.subtract(*one_sided(1e-5)))
    assert apart.max() > 1e-3 * size
    right, left = one_sided(NARROW)
    assert np.abs((right + left) / 2 - slopes).max() < 2e-5 * size
