"""Studies with the compiled engine: its threads, its bits on a cluster, Ctrl-C while it runs."""

import dataclasses
import signal
import threading
import time

import numpy as np
import pytest

from jaxsat.compiler.llvm import threads
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine, kernel
from jaxsat.studies.ensemble import _by_column
from jaxsat.studies.executors import Threads
from jaxsat.studies.run import run_study
from studies.stores import contents, same, without_status
from studies.studies import tumbling

pytestmark = pytest.mark.slow  # ten seconds to make the machine code

COUNT, CHUNK = 600, 150


def compiled(**options):
    study = tumbling(COUNT, CHUNK, **options)
    return dataclasses.replace(study, engine=NativeEngine(FixedStepper(substeps=2)))


@pytest.fixture(scope="module")
def whole():
    return _by_column(compiled().evaluate(np.arange(COUNT)))


@pytest.fixture
def calls(monkeypatch):
    """The names of the threads that run machine code."""
    study, seen = compiled(), []
    functions = study.engine.kernel(study.program, study.cases(np.arange(2)))._functions
    run = functions["run"]

    def call(*arguments):
        seen.append(threading.current_thread().name)
        return run(*arguments)

    monkeypatch.setitem(functions, "run", call)
    return seen


@pytest.fixture
def three(monkeypatch):
    """A machine with three processors."""
    monkeypatch.setattr(threads, "all_processors", lambda: 3)
    monkeypatch.setattr("jaxsat.simulation.engine.native.engine.processors", lambda: 3)
    threads._shared.cache_clear()
    yield
    threads._shared.cache_clear()


def test_chunks_at_once_share_the_processors(tmp_path, whole, calls, three):
    """Five chunks at once, each asking for all processors: three threads, and the same bits."""
    run_study(compiled(), tmp_path / "s", executor=Threads(5))
    same(without_status(contents(tmp_path / "s")), whole)
    assert len(calls) >= COUNT / CHUNK
    assert {name.rpartition("_")[0] for name in calls} == {"jaxsat-native"}
    assert len(set(calls)) <= 3


def test_a_worker_of_a_scheduler_gives_the_bits_of_the_serial_run(tmp_path, whole, monkeypatch):
    """And of its threads every chunk takes one."""
    distributed = pytest.importorskip("distributed")
    from jaxsat.studies.cluster import Scheduler

    asked, run = [], kernel.Kernel.run

    def noted(self, trees, intervals, workers):
        asked.append(workers)
        return run(self, trees, intervals, workers)

    monkeypatch.setattr(kernel.Kernel, "run", noted)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address="127.0.0.1:0"
    ) as cluster:
        executor = Scheduler(cluster.scheduler_address)
        run_study(compiled(), tmp_path / "s", executor=executor)
    same(without_status(contents(tmp_path / "s")), whole)
    assert asked == [1] * (COUNT // CHUNK)


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="needs POSIX signals")
def test_ctrl_c_ends_a_run_between_its_pieces(calls, three):
    """The signal comes with the first of a thousand pieces; nothing is left running."""
    study = compiled(duration=200.0)
    study.evaluate(np.arange(2))
    numbers = np.arange(50_000)
    piece = study.engine.kernel(study.program, study.cases(numbers[:2]))._piece(len(numbers), 3)
    calls.clear()

    def interrupt():
        while not calls:
            time.sleep(1e-3)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        study.evaluate(numbers)
    thread.join()
    done = len(calls)
    assert done < len(numbers) / piece / 2
    np.testing.assert_array_equal(study.evaluate(numbers[:9]).code, 0)
    assert len(calls) == done + 1
