"""Failures in flight of a study: what came of each case, by kind, against replays and by hand."""

import csv
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.tolerances import Tolerances
from jaxsat.report.document import Shown
from jaxsat.report.study_document import recovery_line, recovery_tables
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.failure_record import DiagnosisRecord, FailureRecord
from jaxsat.simulation.trajectory import Signals
from jaxsat.store.tables import open_study, save_case_table
from jaxsat.studies.failure_codes import FAILURES
from jaxsat.studies.recovery import Recovery
from jaxsat.studies.recovery_summary import recovery_by_devices, summarise_recovery
from jaxsat.studies.run import run_study
from jaxsat.studies.statistics import wilson
from jaxsat.studies.summary import summarise
from jaxsat.studies.torques_left import TorquesLeft, torques_left

NAMES = ("thruster a", "thruster b")
DEAD, STUCK = FAILURES.index("dead"), FAILURES.index("stuck at")

BY_HAND = {
    "recovery": [Recovery.RECOVERED, Recovery.WRONG_THRUSTER_ISOLATED, Recovery.UNRECOVERABLE,
                 Recovery.RECOVERED],
    "settling_time": [50.0, np.inf, np.inf, 20.0],
    "ended_at": [100.0, 100.0, 60.0, 100.0],
    "failure_time": [[10.0], [20.0], [90.0], [500.0]],
    "failed_part": [[0], [1], [1], [0]],
    "failure_kind": [[DEAD], [STUCK], [DEAD], [0]],
    "failure_amount": [[np.nan], [0.25], [np.nan], [np.nan]],
    "torques_left": [TorquesLeft.THREE_AXES, TorquesLeft.TWO_TORQUES, TorquesLeft.TOO_FEW,
                     TorquesLeft.THREE_AXES],
    "false_alarms": [0, 2, 0, 0],
    "detection_time": [[12.0], [25.0], [np.nan], [np.nan]],
    "isolation_time": [[13.0, np.nan], [27.0, np.nan], [np.nan, np.nan], [np.nan, np.nan]],
    "isolated_kind": [[1, 0], [1, 0], [0, 0], [0, 0]],
}  # fmt: skip


class Coded(np.ndarray):
    """An array that says what its codes stand for, as a column of a store does."""

    column = SimpleNamespace(flags=NAMES)


def by_hand():
    found = {name: np.array(values) for name, values in BY_HAND.items()}
    return {**found, "failed_part": found["failed_part"].view(Coded)}


def test_fractions_delays_and_reasons_by_kind():
    told = summarise_recovery(by_hand(), np.arange(4))
    assert [row.kind for row in told.by_kind] == ["dead", "stuck at", "no failure", "all"]
    dead, stuck, healthy, total = told.by_kind
    assert (dead.cases, dead.settled, dead.recoverable) == (2, 1, 1)
    assert dead.recovered == wilson(1, 2)
    assert dead.of_recoverable == wilson(1, 1)
    assert dead.reasons == {Recovery.UNRECOVERABLE: 1}
    assert dead.settling_delay[90.0].value == 50 - 10  # of the case that recovered
    assert stuck.settling_delay == healthy.settling_delay == {}
    assert dead.diagnosis.detected == dead.diagnosis.isolated == dead.diagnosis.as_kind == 1
    assert dead.diagnosis.detection_delay[50.0].value == 2
    assert dead.diagnosis.isolation_delay[50.0].value == 1
    assert stuck.diagnosis.isolated == 0
    assert healthy.diagnosis is None
    assert (total.settled, total.recoverable) == (2, 3)
    assert told.false_alarms == 2
    assert told.healthy_time == 10 + 20 + 60 + 100


def test_both_ways_of_a_two_sided_thruster_are_one_device():
    columns = {name: np.array(values) for name, values in BY_HAND.items()}
    told = recovery_by_devices(columns, ("thruster a", "thruster a"))
    rows = [(device, one.kind, places.tolist()) for device, places, one in told]
    assert rows == [("thruster a", "dead", [0, 2]), ("thruster a", "stuck at", [1])]


def test_pairs_of_failures_are_grouped_whatever_their_order():
    """Cases 0 and 2 have the same two failures; in 1 one does not strike, in 3 one device fails
    twice."""
    one = {name: np.array(values) for name, values in BY_HAND.items()}
    columns = {
        name: np.concatenate([values, values], axis=1)
        if name in ("failure_time", "failure_amount", "detection_time")
        else values
        for name, values in one.items()
    }
    columns["failed_part"] = np.array([[0, 1], [0, 1], [1, 0], [1, 1]])
    columns["failure_kind"] = np.array([[DEAD, STUCK], [DEAD, 0], [STUCK, DEAD], [DEAD, STUCK]])
    rows = [
        (devices, row.kind, places.tolist())
        for devices, places, row in recovery_by_devices(columns, ("thruster a", "thruster b"))
    ]
    assert rows == [("thruster a + thruster b", "dead + stuck at", [0, 2])]


def test_every_unrecovered_case_is_explained_in_a_line():
    first, second = summarise_recovery(by_hand(), np.arange(4)).unrecovered
    assert (first.case, first.reason) == (1, Recovery.WRONG_THRUSTER_ISOLATED)
    assert first.text == (
        "a working actuator isolated; thruster b stuck at 0.25 at 20 s; two torques are left, "
        "controllable; alarm 5 s later; isolated: thruster a as dead at 27 s"
    )
    assert "not controllable; no alarm; isolated: nothing" in second.text


def test_parts_are_numbered_in_columns_without_their_names():
    plain = {name: np.array(values) for name, values in BY_HAND.items()}
    first, second = summarise_recovery(plain, np.arange(4)).unrecovered
    assert "part 2 stuck at 0.25 at 20 s" in first.text
    assert "isolated: part 1 as dead at 27 s" in first.text
    assert "part 2 dead at 90 s" in second.text


def test_the_document_tells_the_same_numbers():
    told = summarise_recovery(by_hand(), np.arange(4))
    kinds, diagnosis, explained = recovery_tables(told)
    assert kinds.rows[-1][:3] == ["all", 4, 2]
    assert kinds.rows[-1][3] == Shown("50.00% (15.00% to 85.00%)", 0.5)
    assert kinds.rows[-1][4] == 3
    assert kinds.rows[0][kinds.columns.index("settled 99 % (s)")] == 40
    assert diagnosis.rows[0][2:5] == [1, 1, 1]
    assert [row[0] for row in explained.rows] == [1, 2]
    assert recovery_line(told).startswith("Recovered: 2 of 3 recoverable cases (66.67%")
    assert "; 2 false alarms in 0.0" in recovery_line(told)


def test_a_study_without_failures_in_flight_says_nothing():
    assert summarise_recovery({"code": np.zeros(3)}, np.arange(3)) is None
    assert recovery_tables(None) == []


SIX = [
    "simulation.duration_s=60",
    "control.period_s=0.1",
    'dispersion.failed_thruster={distribution="uniform",low=-0.5,high=5.5}',
    'dispersion.failure_kind={distribution="discrete",values=[0,1,2,3,4],weights=[1,1,1,1,1]}',
    'dispersion.failure_amount={distribution="uniform",low=0.2,high=0.8}',
    'dispersion.failure_time={distribution="uniform",low=5,high=80}',
]


@pytest.fixture(scope="module")
def six():
    overrides = [one.replace("failure_time", "failure_time_s") for one in SIX]
    return build_study(load("thruster-dies", overrides), 16, engine="native")


@pytest.mark.slow
def test_a_study_stores_what_its_replays_show(six, tmp_path):
    run_study(six, tmp_path / "s.zarr")
    found = open_study(tmp_path / "s.zarr")
    for case in range(4):
        replay = six.replay(case)
        at = float(found["failure_time"][case, 0])
        times, signals = replay.times[:-1], replay.signals
        alarmed = times[(np.asarray(signals.parts["alarm"])[:-1] > 0) & (times > at)]
        told = float(found["detection_time"][case, 0])
        assert told == alarmed[0] if len(alarmed) else np.isnan(told)
        kinds = np.asarray(signals.parts["diagnosed_kind"])[-2]
        np.testing.assert_array_equal(found["isolated_kind"][case], kinds + 1)
    struck = found["failure_time"].values[:, 0] <= 60
    np.testing.assert_array_equal(found["failure_kind"].values[:, 0] > 0, struck)
    kind, left = found["failure_kind"].values[struck, 0], found["torques_left"].values[struck]
    dead, open_ = (kind == FAILURES.index(name) for name in ("dead", "stuck on"))
    np.testing.assert_array_equal(left == TorquesLeft.TWO_TORQUES, dead)
    np.testing.assert_array_equal(left == TorquesLeft.UNOPPOSED_TORQUE, open_)
    np.testing.assert_array_equal(left == TorquesLeft.THREE_AXES, ~(dead | open_))
    assert dead.any()
    assert open_.any()
    save_case_table(tmp_path / "s.zarr", tmp_path / "s.csv")
    with (tmp_path / "s.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["failure_kind_1"] for row in rows} <= set(FAILURES)
    assert all(row["failed_part_1"].startswith("thruster ") for row in rows)
    assert sum(row.cases for row in summarise(found).recovery.by_kind[:-1]) == 16


@pytest.mark.slow
def test_the_strength_of_each_thruster_decides_what_opposes_one_that_is_stuck_on():
    """Of a pair of opposite thrusters the second is stuck on; the first is stronger, or weaker."""
    loop = build(load("thruster-dies")).loop
    struck = {
        "failure_time": np.ones((3, 1)),
        "failure_kind": np.full((3, 1), FAILURES.index("stuck on")),
        "failed_part": np.ones((3, 1), int),
        "failure_amount": np.full((3, 1), np.nan),
    }
    gain = np.zeros((3, 6))
    gain[:, 0] = [0.05, 0.0, -0.05]
    found = torques_left(loop, np.zeros(3), struck, gain)
    unopposed = TorquesLeft.UNOPPOSED_TORQUE
    np.testing.assert_array_equal(found, [TorquesLeft.THREE_AXES, unopposed, unopposed])
    dead = struck | {"failure_kind": np.full((3, 1), FAILURES.index("dead"))}
    assert np.all(torques_left(loop, np.zeros(3), dead, gain) == TorquesLeft.TWO_TORQUES)


@pytest.mark.slow
def test_engines_tell_the_same_of_failures(six):
    scenario = load("thruster-dies", [one.replace("failure_time", "failure_time_s") for one in SIX])
    numbers = np.arange(4)
    native = six.evaluate(numbers).failures
    scan = build_study(scenario, 16, engine="scan", batch_size=4).evaluate(numbers).failures
    assert native.keys() == scan.keys()
    for name, values in scan.items():
        np.testing.assert_allclose(native[name], values, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(("begins", "false"), [(0.9, 1), (1.0, 0), (1.1, 0)])
def test_an_alarm_at_the_instant_of_a_failure_is_not_false(begins, false):
    """A wheel that seizes at a sample is seen at this sample."""
    none, never, zero = jnp.array(0), jnp.array([jnp.inf]), jnp.array(0.0)
    diagnosis = DiagnosisRecord(never, never, jnp.array([-1.0]), none > 0, none)
    record = FailureRecord(jnp.array([1.0]), none, none, diagnosis)
    two, three = jnp.zeros(2), jnp.zeros(3)
    quiet = Signals(two, zero, jnp.zeros(4), three, three, three, three, two, zero, zero)
    for t in (0.8, 0.9, 1.0, 1.1, 1.2):
        parts = {"diagnosed_kind": diagnosis.kind, "alarm": jnp.array(float(t >= begins))}
        record = record.observe(jnp.array(t), quiet.with_parts(parts), Tolerances())
    found = record.outputs(jnp.array(0.1))
    assert int(found["false_alarms"]) == false
    assert 1.1 <= float(found["detection_time"][0]) <= 1.2
