"""Options of a study's command as threads and processes: never more than there are processors."""

import pytest

from jaxsat.cli import study_executors
from jaxsat.cli.study_executors import chosen_executor
from jaxsat.montecarlo import Serial, Threads


@pytest.fixture
def four(monkeypatch):
    monkeypatch.setattr(study_executors, "processors", lambda: 4)


@pytest.mark.parametrize(
    ("workers", "executor"),
    [(None, Threads(4)), (1, Serial()), (3, Threads(3)), (4, Threads(4)), (64, Threads(4))],
)
def test_threads(four, workers, executor):
    assert chosen_executor(workers, None, None, None) == executor


@pytest.mark.parametrize(
    ("workers", "processes", "made"),
    [
        (None, 1, (1, 4)),
        (None, 2, (2, 2)),
        (None, 3, (3, 1)),
        (1, 2, (2, 1)),
        (2, 2, (2, 2)),
        (3, 2, (2, 2)),
        (None, 64, (4, 1)),
        (64, 64, (4, 1)),
    ],
)
def test_processes_and_their_threads(four, monkeypatch, workers, processes, made):
    cluster = pytest.importorskip("jaxsat.montecarlo.cluster")
    monkeypatch.setattr(cluster, "local_processes", lambda *counts: counts)
    assert chosen_executor(workers, processes, None, None) == made
    assert made[0] * made[1] <= 4
