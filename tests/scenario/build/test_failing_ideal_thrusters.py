"""`[[failure]]` of thrusters that make a torque of either sign, under any law."""

import numpy as np
import pytest

from jaxsat.core.declaration.failures import FailureKind
from jaxsat.scenario import ScenarioError, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.studies.quantities import QUANTITIES

FAILURES = (
    "failure=[{of='thruster 2',at_s=5.0,kind='stuck-at',fraction=-0.5},"
    "{of='thruster 1',at_s=9.0,kind='turned',turn_rad=[0.0,0.0,1.5707963267948966]},"
    "{of='thruster 3',at_s=1.0,kind='dead'}]"
)
LIMIT = "spacecraft.torque_limit_N_m=5.0"


def test_events_strike_the_torques_that_work():
    """Of free-third-rate, whose third thruster has failed before the start."""
    with pytest.warns(ScenarioWarning, match='works at the start, .* got "thruster 3"'):
        scenario = load("free-third-rate", [FAILURES, LIMIT])
    loop = build(scenario).loop
    assert isinstance(loop, ContinuousLoop)
    assert not loop.is_smooth()
    failures = loop.plant.effectors[0].failures
    assert isinstance(failures, FailureEvents)
    np.testing.assert_array_equal(failures.number, [1, 0])
    np.testing.assert_array_equal(failures.at, [5, 9])
    np.testing.assert_array_equal(failures.kind, [FailureKind.STUCK_AT, FailureKind.TURNED])
    assert failures.amount[0] == -0.5
    np.testing.assert_allclose(failures.turned[1][:, 0], [0, 1, 0], atol=1e-15)


def test_they_strike_under_a_sampled_law():
    loop = build(load("switching", ["failure=[{of='thruster 1',at_s=5.0,kind='dead'}]"])).loop
    assert isinstance(loop, SampledLoop)
    np.testing.assert_array_equal(loop.plant.effectors[0].failure_times, [5.0])


def test_the_printed_law_flies_at_torque_level_where_something_fails():
    """Error coordinates have no thrusters that could fail."""
    plain = build(load("paper-three-axis")).loop
    assert not isinstance(plain, ContinuousLoop | SampledLoop)
    failing = "failure=[{of='thruster 1',at_s=5.0,kind='dead'}]"
    assert isinstance(build(load("paper-three-axis", [failing])).loop, ContinuousLoop)


DEAD = "failure=[{of='thruster 1',at_s=5.0,kind='dead'}]"


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("free-third-rate", ["failure=[{of='thruster 4',at_s=1,kind='dead'}]"], '"thruster 3"'),
        ("free-third-rate", [DEAD.replace("dead", "leaking")], "must be one of dead, degraded"),
        ("free-third-rate", [DEAD.replace("dead", "stuck-on")], "torque_limit_N_m"),
        (
            "free-third-rate",
            ["failure=[{of='thruster 1',at_s=5.0,kind='degraded',fraction=-0.5}]"],
            "must be at least 0",
        ),
        ("paper-three-axis", [DEAD, "simulation.coordinates=error"], "something fails in flight"),
        (
            "free-third-rate",
            [DEAD, "simulation.solver.steps=fixed", "simulation.solver.step_s=0.1"],
            "must be left to adaptive steps",
        ),
    ],
)
def test_what_cannot_be_is_told(name, changes, said):
    with pytest.raises(ScenarioError, match=said):
        load(name, changes)


@pytest.mark.parametrize(
    ("changes", "last"),
    [([], FailureKind.DEGRADED), (["spacecraft.torque_limit_N_m=5.0"], FailureKind.STUCK_AT)],
)
def test_studies_draw_kinds_that_a_thruster_of_either_sign_can_have(changes, last):
    loop = build(load("free-third-rate", [DEAD, *changes])).loop
    assert float(QUANTITIES["failure_kind"].limits(loop).high) == last + 0.5


def test_reversal_is_of_torques_of_either_sign():
    with pytest.raises(ScenarioError, match="must be one of dead, degraded, stuck-on, stuck-at"):
        load("cubesat-12u", ["failure=[{of='thruster 1',at_s=5.0,kind='reversed'}]"])
    assert isinstance(build(load("cubesat-12u")).loop.plant.effectors[0], PulsedThrusters)
