"""Studies on the workers of a dask cluster: the same bits, whatever becomes of the workers."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, closing, contextmanager

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.store.files import OutputError
from jaxsat.studies.ensemble import _by_column
from jaxsat.studies.run import run_study
from studies.stores import contents, same, without_status
from studies.studies import tumbling

distributed = pytest.importorskip("distributed")
from jaxsat.studies import cluster, connection  # noqa: E402
from jaxsat.studies.cluster import ClusterError, Scheduler  # noqa: E402


@pytest.fixture(scope="module")
def whole():
    return _by_column(tumbling().evaluate(np.arange(100)))


@pytest.fixture(scope="module")
def threads():
    """A cluster whose one worker is in this process."""
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        yield cluster


@pytest.mark.slow
def test_a_scheduler_gives_the_bits_of_the_serial_run(tmp_path, whole, threads):
    seen = []
    executor = Scheduler(threads.scheduler_address)
    run_study(tumbling(), tmp_path / "s", executor=executor, report=seen.append)
    same(without_status(contents(tmp_path / "s")), whole)
    assert len(seen) == 7
    with distributed.Client(threads) as client:
        (left,) = client.run(lambda dask_worker: list(dask_worker.plugins)).values()
    assert not [name for name in left if "jaxsat" in name]


def test_what_fails_in_a_worker_is_told_here(tmp_path, threads, monkeypatch):
    from jaxsat.studies import run

    here = run.machine()
    executor = Scheduler(threads.scheduler_address)
    monkeypatch.setattr(run, "machine", lambda: {**here, "processor": str(os.urandom(4))})
    with pytest.raises(OutputError, match=r"worker computes under other conditions \(processor"):
        run_study(tumbling(), tmp_path / "s", executor=executor)


@pytest.mark.slow
def test_a_run_is_stopped_from_another_thread(tmp_path, threads):
    """The scheduler is left without the run's work; a later run goes on as if nothing had been."""
    executor, study = Scheduler(threads.scheduler_address), tumbling(600, duration=100.0)
    begun, told = threading.Event(), []

    def run():
        try:
            run_study(study, tmp_path / "s", executor=executor, report=lambda _: begun.set())
        except ClusterError as error:
            told.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    assert begun.wait(60)
    executor.stop()
    thread.join(5)
    assert told == ["the run was stopped"]
    assert len(contents(tmp_path / "s")["status"]) < 600
    with distributed.Client(threads) as client:
        (left,) = client.run(lambda dask_worker: list(dask_worker.plugins)).values()
    assert not [name for name in left if "jaxsat" in name]
    run_study(study, tmp_path / "s", executor=executor)
    assert contents(tmp_path / "s")["status"].sum() == 600


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_told(tmp_path):
    """Nobody, somebody who says nothing, a protocol that dask does not know."""
    with closing(socket.create_server(("127.0.0.1", 0))) as silent:
        here = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        for place in ("tcp://127.0.0.1:9", here, "nonsense://x"):
            begun = time.monotonic()
            with pytest.raises(ClusterError, match=f"no scheduler answers at {place}: "):
                run_study(tumbling(), tmp_path / "s", executor=Scheduler(place, 0.2))
            assert time.monotonic() - begun < 20.0


def test_a_scheduler_of_another_version_is_told(tmp_path, threads, monkeypatch):
    monkeypatch.setattr(connection, "version", lambda name: "1.2.3")
    there = distributed.__version__
    told = f"must have the same versions .*; distributed: {there} there, 1.2.3 here"
    with pytest.raises(ClusterError, match=told):
        run_study(tumbling(), tmp_path / "s", executor=Scheduler(threads.scheduler_address))


def test_a_scheduler_without_workers_is_waited_for_with_a_word(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "LOOK_S", 0.1)
    said = []
    with distributed.LocalCluster(
        n_workers=0, processes=False, dashboard_address="127.0.0.1:0"
    ) as empty:
        place = empty.scheduler_address
        executor = Scheduler(place, patience=0.5, tell=said.append)
        with pytest.raises(ClusterError, match=r"had no workers for 0\.5 s"):
            run_study(tumbling(), tmp_path / "s", executor=executor)
    assert said == [f"the scheduler at {place} has no workers; waiting 0.5 s for one"]


def test_a_scheduler_that_does_not_answer_is_told(tmp_path, threads, monkeypatch):
    """As one that is stopped, or whose network is gone."""
    monkeypatch.setattr(cluster, "LOOK_S", 0.0)
    monkeypatch.setattr(cluster, "ANSWER_S", 0.3)
    deaf = threading.Event()
    monkeypatch.setattr(distributed.Client, "nthreads", lambda client: deaf.wait(60))
    executor = Scheduler(threads.scheduler_address)
    with pytest.raises(ClusterError, match=r"the scheduler is gone: no answer within 0\.3 s"):
        run_study(tumbling(), tmp_path / "s", executor=executor)
    deaf.set()


@pytest.mark.slow
def test_a_scheduler_that_goes_away_is_told(tmp_path, whole):
    """What is done stays, and the study goes on elsewhere."""
    leaving = distributed.LocalCluster(
        n_workers=1, processes=False, dashboard_address="127.0.0.1:0"
    )
    executor = Scheduler(leaving.scheduler_address, 1.0)
    with pytest.raises(ClusterError, match="the scheduler is gone"):
        run_study(tumbling(), tmp_path / "s", executor=executor, report=lambda _: leaving.close())
    assert 0 < contents(tmp_path / "s")["status"].sum() < 100
    run_study(tumbling(), tmp_path / "s")
    same(without_status(contents(tmp_path / "s")), whole)


@pytest.mark.slow
@needs("slurm")
def test_a_slurm_job_computes(tmp_path, whole):
    jobqueue = pytest.importorskip("dask_jobqueue")
    options = {"cores": 1, "memory": "2GB", "walltime": "00:10:00"}
    with jobqueue.SLURMCluster(**options, python=sys.executable) as jobs:
        jobs.scale(jobs=1)
        executor = Scheduler(jobs.scheduler_address)
        run_study(tumbling(), tmp_path / "s", executor=executor, elsewhere=True)
    assert contents(tmp_path / "s")["status"].sum() == len(whole["code"])


@contextmanager
def started(*words):
    """A program of dask that ends with the block."""
    command = [sys.executable, "-m", "dask", *map(str, words), "--no-dashboard"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as program:
        try:
            yield program
        finally:
            program.kill()


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_no_case(tmp_path):
    """A scheduler and workers of their own, as on a cluster; one dies, and another one comes."""
    study, file = tumbling(600, duration=100.0), tmp_path / "scheduler.json"
    of_scheduler = ("--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0")
    of_worker = ("worker", "--scheduler-file", file, "--no-nanny", "--nthreads", "1")
    with ExitStack() as running:
        running.enter_context(started("scheduler", *of_scheduler, "--scheduler-file", file))
        executor = Scheduler(str(file), timeout=60.0)
        first, _ = (running.enter_context(started(*of_worker)) for _ in range(2))
        address = json.loads(file.read_text())["address"]
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        seen = []

        def kill_one(_):
            if not seen:
                first.kill()
                running.enter_context(started(*of_worker))
            seen.append(contents(tmp_path / "s")["status"].sum())

        run_study(study, tmp_path / "s", executor=executor, report=kill_one)
    assert first.returncode < 0
    assert 0 < seen[0] < 600
    run_study(study, tmp_path / "serial")
    same(contents(tmp_path / "s"), contents(tmp_path / "serial"))
