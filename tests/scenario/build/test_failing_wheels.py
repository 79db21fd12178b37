"""`[[failure]]` of wheels, alone and beside thrusters: built, drawn, and its mistakes."""

import jax
import numpy as np
import pytest

from helpers.effectors import effector_of
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.scenario import ScenarioError, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import Wheels, wheel_momentum
from scenario.build.test_thrusters_as_parts import HEAD, PAIRS, REST, written

pytestmark = pytest.mark.filterwarnings("ignore:.*never used. roll")

WHEELS = """\
[[wheel]]
name = "roll"
axis = [0.8, 0.6, 0]
torque_limit_N_m = 5
momentum_limit_N_m_s = 60
momentum_N_m_s = 10
[[wheel]]
axis = [0.6, 0, 0.8]
torque_limit_N_m = 4
coulomb_friction_N_m = 0.1
failed = true
"""
FAILURES = """\
[[failure]]
of = "wheel roll"
at_s = 8.05
kind = "stopped"
[[failure]]
of = "thruster pitch"
at_s = 3
kind = "leaking"
fraction = 0.2
[[failure]]
of = "wheel 2"
at_s = 4
kind = "friction-up"
factor = 5
[[failure]]
of = "wheel 2"
at_s = 6
kind = "friction-up"
friction_N_m = 2
"""


def mixed(tmp_path, more=FAILURES, rest=REST):
    modulation = '[modulation]\nkind = "pwm"\n'
    return load(written(tmp_path, HEAD, PAIRS, modulation, WHEELS, more, rest))


def test_each_failure_strikes_its_own_part_and_a_file_reads_back(tmp_path):
    scenario = mixed(tmp_path)
    assert load(written(tmp_path, dump(scenario))) == scenario
    loop = build(scenario).loop
    wheels, thrusters = effector_of(loop.plant, Wheels).failures, loop.plant.effectors[0].failures
    assert isinstance(wheels, WheelFailures)
    np.testing.assert_array_equal(wheels.number, [0, 1, 1])
    np.testing.assert_array_equal(wheels.at, [8.05, 4, 6])
    kinds = WheelFailureKind
    np.testing.assert_array_equal(
        wheels.kind, [kinds.STOPPED, kinds.FRICTION_BY, kinds.FRICTION_TO]
    )
    np.testing.assert_array_equal(wheels.amount, [0, 5, 2])
    assert isinstance(thrusters, FailureEvents)
    np.testing.assert_array_equal(thrusters.at, [3])
    alone = mixed(tmp_path, FAILURES.split('[[failure]]\nof = "wheel 2"')[0])
    assert effector_of(build(alone).loop.plant, Wheels).failures.count == 1


DRAWN = """
[dispersion.failure_time_s]
distribution = "uniform"
low = [0, 2, 4, 6]
high = [1, 3, 5, 7]
[dispersion.failed_wheel]
distribution = "discrete"
values = [0, 1]
weights = [1, 1]
[dispersion.failure_kind]
distribution = "uniform"
low = -0.5
high = [6.5, 5.5, 5.5, 5.5]
[dispersion.wheel_momentum_N_m_s]
distribution = "uniform"
low = -10
high = 10
"""


@pytest.mark.slow
def test_failures_of_both_kinds_of_part_are_drawn_in_one_study(tmp_path):
    study = build_study(mixed(tmp_path, rest=REST + DRAWN), 16, seed=3)
    assert study.remark is None  # the native engine
    cases = np.arange(16)
    outputs = study.evaluate(cases)
    copies = jax.vmap(lambda case: study.case_factory(case, None))(study.cases(cases))
    wheels, thrusters = (
        effector_of(copies.loop.plant, Wheels).failures,
        copies.loop.plant.effectors[0].failures,
    )
    drawn = outputs.drawn
    for name, field in (("failure_time", "at"), ("failure_kind", "kind")):
        both = np.concatenate([getattr(thrusters, field), getattr(wheels, field)], axis=1)
        np.testing.assert_allclose(both, drawn[name], rtol=1e-14)
    np.testing.assert_array_equal(wheels.number, drawn["failed_wheel"])
    assert len(np.unique(drawn["failed_wheel"])) == 2
    np.testing.assert_allclose(wheel_momentum(copies.start), drawn["wheel_momentum"], atol=1e-13)
    assert np.ptp(drawn["wheel_momentum"], axis=0).min() > 5
    assert np.all(outputs.code == 0)
    assert np.ptp(outputs.omega, axis=0).min() > 1e-3
    one = study.evaluate(np.array([5]))
    assert one.omega.tobytes() == outputs.omega[5:6].tobytes()


TWO = 'of = "wheel 2"\nat_s = 6\nkind = "friction-up"\nfriction_N_m = 2\n'
MISTAKES = [
    ('of = "wheel roll"', 'of = "wheel 3"', "of", 'must name one of "thruster 1", "thruster pitc'),
    ('of = "wheel roll"', 'of = "roll"', "of", "did you mean wheel roll?"),
    ('of = "wheel roll"', 'of = "gyro 3"', "of", 'must name one of "thruster 1", "thruster pitc'),
    ('kind = "stopped"', 'kind = "stuck-on"', "kind", "must be one of dead, degraded, stopped"),
    ('kind = "leaking"', 'kind = "runaway"', "kind", "must be one of dead, degraded, stuck-on"),
    ('kind = "stopped"', 'kind = "degraded"', "fraction", "must be given for a failure of kind"),
    ("friction_N_m = 2\n", "", "friction_N_m", 'must be given for a failure of kind "friction-up"'),
    ("friction_N_m = 2\n", "friction_N_m = 2\nfactor = 2\n", "friction_N_m", "with factor"),
    ("friction_N_m = 2\n", "fraction = 0.5\nfactor = 2\n", "fraction", "must not be given"),
    ("coulomb_friction_N_m = 0.1\n", "", "factor", "left out where wheel 2 has no friction"),
    (TWO, 'of = "wheel 2"\nat_s = 6\nkind = "runaway"\n', "torque_limit", 'by "runaway"'),
]


@pytest.mark.parametrize(("old", "new", "key", "message"), MISTAKES)
def test_mistakes_are_told(tmp_path, old, new, key, message):
    text = f"{HEAD}{PAIRS}{WHEELS}{FAILURES}{REST}"
    assert old in text
    if "runaway" in new and key == "torque_limit":
        text = text.replace("torque_limit_N_m = 4\n", "")
    with pytest.raises(ScenarioError) as caught:
        load(written(tmp_path, text.replace(old, new, 1)))
    told = [str(problem) for problem in caught.value.problems]
    assert any(key in line and message in line for line in told), told


def test_wheels_that_run_away_without_a_limit_are_not_drawn(tmp_path):
    text = dump(mixed(tmp_path)).replace("torque_limit_N_m = 4.0\n", "")
    drawn = '[dispersion.failure_kind]\ndistribution = "uniform"\nlow = 0\nhigh = 5.0\n'
    with pytest.raises(ScenarioError, match=r"must be at most 4\.5"):
        load(written(tmp_path, text, drawn), purpose="study")


def test_wheels_fail_under_a_continuous_law_but_for_coulomb_friction():
    failure = "failure=[{of='wheel X',at_s=5.0,kind='stopped'}]"
    loop = build(load("two-wheel-telescope", [failure])).loop
    assert isinstance(loop, ContinuousLoop)
    np.testing.assert_array_equal(loop.failure_times, [5.0])
    rubs = failure.replace("stopped", "friction-up").replace("}", ",friction_N_m=0.1}")
    with pytest.raises(ScenarioError, match="Coulomb friction needs a sampled law"):
        load("two-wheel-telescope", [rubs])
