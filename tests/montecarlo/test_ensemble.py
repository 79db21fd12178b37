"""Studies: the same bits however they are computed, broken off or gone on with."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jaxsat.montecarlo import (
    LatinHypercube,
    Serial,
    Sobol,
    StopRule,
    Threads,
    run_study,
    summarise,
    wilson,
)
from jaxsat.montecarlo.ensemble import _by_column
from jaxsat.results import OutputError, open_study
from montecarlo.studies import tumbling

TESTS = Path(__file__).parents[1]


def contents(path):
    dataset = open_study(path)
    return {name: np.asarray(dataset[name]) for name in dataset}


def same(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.fixture(scope="module")
def whole():
    return _by_column(tumbling().evaluate(np.arange(100)))


def without_status(columns):
    return {name: values for name, values in columns.items() if name != "status"}


@pytest.mark.parametrize(
    ("chunk", "executor"), [(16, Serial()), (7, Threads(2)), (100, Serial()), (33, Threads(3))]
)
def test_the_store_has_the_same_bits_for_every_chunk_and_executor(tmp_path, whole, chunk, executor):
    seen = []
    run_study(tumbling(chunk=chunk), tmp_path / "s", executor=executor, report=seen.append)
    same(without_status(contents(tmp_path / "s")), whole)
    assert [p.done for p in seen][-1] == 100
    assert seen[-1].seconds_left == 0
    assert seen[-1].settled == np.isfinite(whole["settling_time"]).sum()
    assert 0 < seen[-1].fraction_settled < 1


def test_a_study_goes_on_where_it_was_left(tmp_path, whole):
    class Broken(Exception):
        pass

    def stop(progress):
        if progress.done >= 32:
            raise Broken

    with pytest.raises(Broken):
        run_study(tumbling(), tmp_path / "s", report=stop)
    assert contents(tmp_path / "s")["status"].sum() == 32
    seen = []
    assert run_study(tumbling(), tmp_path / "s", report=seen.append) == 100
    assert seen[0].done == 48
    same(without_status(contents(tmp_path / "s")), whole)
    assert run_study(tumbling(), tmp_path / "s", report=seen.append) == 100
    assert len(seen) == 5


def test_a_smaller_study_grows_into_a_larger(tmp_path, whole):
    run_study(tumbling(count=40), tmp_path / "s")
    run_study(tumbling(count=100), tmp_path / "s")
    same(without_status(contents(tmp_path / "s")), whole)


def test_another_study_is_not_mixed_in(tmp_path):
    run_study(tumbling(count=8), tmp_path / "s")
    for other in ({"seed": 5}, {"lanes": 4}, {"duration": 21.0}, {"design": Sobol(4)}):
        with pytest.raises(OutputError, match="another study"):
            run_study(tumbling(count=8, **other), tmp_path / "s")


def test_a_stop_rule_stops_at_the_first_chunks_that_meet_it(tmp_path, whole):
    rule = StopRule(0.12, least=10)
    settled = np.isfinite(whole["settling_time"])
    expected = next(n for n in range(16, 100, 16) if rule.met(int(settled[:n].sum()), n))
    for name, executor in (("a", Serial()), ("b", Threads(3))):
        found = run_study(tumbling(), tmp_path / name, executor=executor, until=rule)
        assert found == expected < 100
        assert contents(tmp_path / name)["status"].sum() < 100
    with pytest.raises(ValueError, match="Latin hypercube"):
        run_study(tumbling(design=LatinHypercube(4, 100)), tmp_path / "c", until=rule)


def test_a_hypercube_of_another_size_is_refused():
    with pytest.raises(ValueError, match="size 100"):
        tumbling(design=LatinHypercube(4, 50))


def test_replay_gives_the_bits_of_the_store(whole):
    replay = tumbling().replay(57)
    for name, values in _by_column(replay.outputs).items():
        np.testing.assert_array_equal(values, whole[name][57], err_msg=name)
    np.testing.assert_array_equal(replay.signals.omega[-1], whole["omega"][57])


def test_summary(tmp_path, whole):
    run_study(tumbling(), tmp_path / "s")
    summary = summarise(open_study(tmp_path / "s"))
    settled = np.isfinite(whole["settling_time"])
    assert summary.cases == 100
    assert summary.settled == wilson(int(settled.sum()), 100)
    assert summary.outcomes == {"settled": settled.sum(), "unsettled": (~settled).sum()}
    expected = np.percentile(whole["settling_time"][settled], 90)
    np.testing.assert_allclose(summary.settling_time[90.0].value, expected)
    assert not np.any(settled[summary.worst])
    assert summary.cost_sensitivity[0].name == "omega[1]"
    assert summarise(open_study(tmp_path / "s"), 10).cases == 10


def environment(**more):
    paths = os.pathsep.join([str(TESTS.parent), str(TESTS)])
    return {**os.environ, "PYTHONPATH": paths, **more}


@pytest.mark.slow
def test_killing_a_study_loses_no_finished_chunk(tmp_path):
    """SIGKILL at some instants; then the store is completed and equals one never broken off."""
    command = [sys.executable, "-m", "montecarlo.studies", str(tmp_path / "s")]
    for lines in (3, 40):
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment())
        told = [process.stdout.readline() for _ in range(lines)]
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        done = contents(tmp_path / "s")["status"].sum()
        assert done >= int(told[-1])
    study = tumbling(4000, 8, duration=200.0)
    run_study(study, tmp_path / "s", executor=Threads(2))
    found = contents(tmp_path / "s")
    assert found.pop("status").sum() == 4000
    same(found, _by_column(study.evaluate(np.arange(4000))))
