"""Tables `[[gimbal]]`: what is made of them, mistakes, flights and studies."""

import numpy as np
import pytest
from pydantic import ValidationError

from helpers.gyros import document
from jaxsat.core.declaration.gimbals import GimbalFailureKind
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.failure_cautions import failure_cautions
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.gimbals import ControlMomentGyros, GimbalSteering, GyroStates
from simulation.engine.examples import agreed

FAILURES = (
    {"of": "gimbal 2", "at_s": 4.3, "kind": "locked"},
    {"of": "gimbal 4", "at_s": 6.1, "kind": "run-down", "time_constant_s": 20.0},
)


def test_gyros_of_a_scenario_are_steered():
    data = document(FAILURES)
    data["gimbal"][0] |= {"angle_rad": 0.2, "failed": True}
    run = build(Scenario.model_validate(data))
    assert isinstance(run.loop, SampledLoop)
    (gyros,), (steering,) = run.loop.plant.effectors, run.loop.distribution.steering
    assert isinstance(gyros, ControlMomentGyros)
    assert isinstance(steering, GimbalSteering)
    np.testing.assert_array_equal(steering.working, [0.0, 1.0, 1.0, 1.0])
    assert steering.gyros.failures is None
    state = run.start.find(GyroStates)
    assert state is not None
    np.testing.assert_array_equal(state.angle, [0.2, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(state.momentum, np.full(4, 0.8))
    assert gyros.failures is not None
    np.testing.assert_array_equal(gyros.failures.number, [1.0, 3.0])
    kinds = [GimbalFailureKind.LOCKED, GimbalFailureKind.RUN_DOWN]
    np.testing.assert_array_equal(gyros.failures.kind, kinds)
    np.testing.assert_array_equal(gyros.failures.amount, [0.0, 20.0])


def _along(data):
    data["gimbal"][1]["spin_axis"] = [0.0, 1.0, 1.0]


def _still(data):
    data["gimbal"][0]["rotor_momentum_N_m_s"] = 0.0


def _unlimited(data):
    del data["gimbal"][0]["rate_limit_rad_s"]


def _mistyped(data):
    data["gimbal"][0]["angel_rad"] = 0.1


def _renamed(data):
    data["gimbal"][2]["name"] = "1"


def _law(data):
    data["control"] = {"law": "three-slew", "period_s": 0.5}


def _all_locked(data):
    for one in data["gimbal"]:
        one["failed"] = True


def _dead(data):
    data["failure"] = [{"of": "gimbal 1", "at_s": 1.0, "kind": "dead"}]


def _held(data):
    data["spacecraft"]["third_rate"] = "held"


@pytest.mark.parametrize(
    ("mistake", "said"),
    [
        (_along, "must be perpendicular to axis"),
        (_still, "rotor_momentum_N_m_s"),
        (_unlimited, "rate_limit_rad_s"),
        (_mistyped, "angle_rad"),
        (_renamed, "must be a name of its own"),
        (_law, 'commands three torques .*"quaternion-feedback"'),
        (_all_locked, "must leave one that works"),
        (_dead, "must be one of locked, run-down"),
        (_held, "gimbal"),
    ],
)
def test_mistakes_are_told(mistake, said):
    data = document()
    mistake(data)
    with pytest.raises(ValidationError, match=said):
        Scenario.model_validate(data)


def test_a_gimbal_that_turns_again_is_told():
    data = document(({"of": "gimbal 4", "at_s": 3.0, "kind": "locked"}, FAILURES[1]))
    (caution,) = failure_cautions(Scenario.model_validate(data))
    assert 'replace "locked" at 3.0 s, after which gimbal 4 works again' in caution.message


@pytest.mark.slow
def test_gyros_bring_the_body_to_the_orbit_frame():
    """With one gimbal locked from before the start, as the law knows, the other three do."""
    data = document()
    data["gimbal"][1]["failed"] = True
    found = build(Scenario.model_validate(data)).simulate()
    assert int(found.code) == 0
    np.testing.assert_allclose(found.signals.quaternion[-1, 1:], np.zeros(3), atol=2e-4)
    rates = np.abs(np.asarray(found.signals.parts["gimbal_rate"])).max(axis=0)
    assert rates[1] == 0 < rates[[0, 2, 3]].min() <= rates.max() <= 0.5
    assert not found.signals.parts["gimbal_angle"][:, 1].any()


@pytest.mark.slow
def test_engines_agree_on_gyros_that_are_dispersed_and_fail():
    dispersion = {
        "rotor_momentum": {"distribution": "uniform", "low": -0.2, "high": 0.2},
        "failed_gimbal": {"distribution": "uniform", "low": -0.5, "high": 3.5},
        "failure_time_s": {"distribution": "uniform", "low": 0.0, "high": 8.0},
    }
    data = document(FAILURES, dispersion)
    data["simulation"]["duration_s"] = 10.0
    study = build_study(Scenario.model_validate(data), count=4)
    agreed(study.program, study.cases(np.arange(4)), 0.25, apart=1e-7)
    values = study.values(np.arange(4))
    assert set(values["failure_kind"].ravel()) == {16, 17}
    assert np.all(values["torques_left"] == 0)
