"""Several `[[failure]]` of one actuator, drawn and not; those that contradict or never strike."""

import dataclasses
import warnings

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.effectors import effector_of
from jaxsat.core.checks import as_float
from jaxsat.scenario import ScenarioError, ScenarioWarning, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import study_program
from jaxsat.spacecraft.wheels import Wheels
from jaxsat.studies.dispersions import StudyCase
from jaxsat.studies.failure_codes import FAILURES
from jaxsat.studies.recovery import failed_thrusters
from scenario.build.test_failing_wheels import mixed
from scenario.build.test_thrusters_as_parts import pushing, written

pytestmark = pytest.mark.filterwarnings("ignore:.*never used. roll")


def tables(*failures):
    """`[[failure]]` of (what, kind, time); those that take one have half of it."""
    return "".join(
        f'[[failure]]\nof = "{of}"\nkind = "{kind}"\nat_s = {at}\n'
        + ("fraction = 0.5\n" if kind in ("degraded", "leaking", "stuck-at") else "")
        for of, kind, at in failures
    )


def drawn(key, low, high):
    return f'[dispersion.{key}]\ndistribution = "uniform"\nlow = {low}\nhigh = {high}\n'


def test_a_failure_of_a_two_sided_thruster_has_one_time(tmp_path):
    """Of both ways of `pitch`, the third and fourth columns."""
    text = dump(pushing(tmp_path, tables(("thruster pitch", "degraded", 5.0)), "pwm"))
    scenario = load(written(tmp_path, text, drawn("failure_time_s", 1, 15)))
    copies, _ = study_program(scenario, build(scenario), seed=1)
    assert copies.dimensions() == {"failure_time": 1}
    case = StudyCase(np.zeros(1, np.uint32)[0], np.array([0.25]))
    np.testing.assert_allclose(copies(case, None).loop.plant.effectors[0].failures.at, [4.5])


def test_events_strike_both_ways_but_for_what_is_stuck(tmp_path):
    """Of the four columns, whatever the order of the tables; the two of `pitch` come last."""
    struck = ("thruster pitch", "dead", 9.0), ("thruster pitch", "stuck-on", 4.0)
    events = build(pushing(tmp_path, tables(*struck), "pwm")).loop.plant.effectors[0].failures
    assert events.count == 2
    instants, torque = jnp.array([3.0, 5.0, 10.0]), jnp.eye(3, 4)
    conditions = [events.condition(t, 0 * t, torque) for t in instants]
    np.testing.assert_array_equal([one.floor[2:] for one in conditions], [[0, 0], [1, 0], [0, 0]])
    np.testing.assert_array_equal([one.gain[2:] for one in conditions], [[1, 1], [1, 1], [0, 0]])
    assert all(np.all(one.gain[:2] == 1) for one in conditions)


def test_what_has_failed_in_the_end_is_the_last_in_time():
    """Columns of a study: a two-sided thruster, and one that is not."""
    dead, stuck, leaking = map(FAILURES.index, ("dead", "stuck on", "leaking"))
    found = {
        "failure_time": np.array([[9.0, 4.0], [4.0, 9.0], [1.0, 2.0]]),
        "failure_kind": np.array([[dead, stuck], [dead, stuck], [leaking, 0]]),
        "failed_part": np.array([[0, 0], [0, 0], [2, 1]]),
        "isolated_kind": np.zeros((3, 3), int),
    }
    truth = failed_thrusters(found, ("thruster a", "thruster a", "thruster b"))
    np.testing.assert_array_equal(truth, [[dead, dead, 0], [stuck, dead, 0], [0, 0, leaking]])


CONTRADICTIONS = [
    (("thruster pitch", "dead", 5.0), ("thruster pitch", "stuck-on", 5.0), "must differ from"),
    (("wheel roll", "dead", 5.0), ("wheel roll", "runaway", 5), '"dead" and "runaway"'),
]


@pytest.mark.parametrize(("first", "second", "said"), CONTRADICTIONS)
def test_two_failures_at_one_instant_are_refused(tmp_path, first, second, said):
    with pytest.raises(ScenarioError, match=said):
        mixed(tmp_path, tables(first, second))


CAUTIONS = [
    (tables(("thruster 1", "dead", 20.0)), "", "failure.at_s: .* never strikes, got 20"),
    (tables(("wheel 2", "dead", 5.0)), "", 'works at the start, .* got "wheel 2"'),
    (
        tables(("wheel roll", "dead", 5.0), ("wheel roll", "degraded", 6.0)),
        "",
        'replace "dead" at 5.0 s, after which wheel roll works again',
    ),
    (
        tables(("wheel roll", "dead", 5.0)),
        drawn("failure_time_s", 30, 40),
        r"dispersion.failure_time_s.low: .* got 30",
    ),
]


@pytest.mark.parametrize(("failures", "dispersed", "said"), CAUTIONS)
def test_what_never_strikes_or_ends_a_failure_is_told(tmp_path, failures, dispersed, said):
    text = dump(mixed(tmp_path, ""))
    with pytest.warns(ScenarioWarning, match=said):
        load(written(tmp_path, text, failures, dispersed))


@pytest.mark.parametrize("sensor", ["star_tracker", "gyro"])
def test_an_outage_after_the_end_is_told(sensor):
    said = rf"{sensor}\.outage_start_s: .* never strikes, got 100000"
    with pytest.warns(ScenarioWarning, match=said):
        load("thruster-dies", [f"{sensor}.outage_start_s=1e5", f"{sensor}.outage_s=10"])


def test_failures_in_time_are_not_remarked_on(tmp_path):
    text = dump(mixed(tmp_path, tables(("wheel roll", "degraded", 5.0), ("wheel roll", "dead", 9))))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScenarioWarning)
        warnings.filterwarnings("ignore", ".*never used. roll", ScenarioWarning)
        load(written(tmp_path, text, drawn("failure_time_s", 1, 40)))


def test_a_wheel_that_has_seized_is_not_freed_under_a_continuous_law():
    """Its momentum is in the body, which that loop cannot undo."""
    stopped = "failure=[{of='wheel X',at_s=5.0,kind='stopped'},{of='wheel X',at_s=AT,kind='dead'}]"
    with pytest.raises(ScenarioError, match="only a sampled law lets one that has seized turn"):
        load("two-wheel-telescope", [stopped.replace("AT", "9.0")])
    loop = build(load("two-wheel-telescope", [stopped.replace("AT", "4.0")])).loop
    later = eqx.tree_at(
        lambda one: effector_of(one.plant, Wheels).failures.at, loop, as_float([5.0, 9.0])
    )
    with pytest.raises(ValueError, match="has seized must not fail once more"):
        dataclasses.replace(later)
