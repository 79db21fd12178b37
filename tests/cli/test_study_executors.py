"""Options of a study's command as threads and processes: never more than there are processors."""

import pytest

from jaxsat.cli import study_executors
from jaxsat.cli.study_executors import chosen_executor
from jaxsat.cli.terminal import UserMistake
from jaxsat.studies.executors import Serial, Threads
from jaxsat.studies.processes import Processes


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
def test_processes_and_their_threads(four, workers, processes, made):
    assert chosen_executor(workers, processes, None, None) == Processes(*made)
    assert made[0] * made[1] <= 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"devices": 0}, "--devices: must be from 1 to the "),
        ({"devices": 10**9}, "--devices: must be from 1 to the "),
        ({"devices": 1, "processes": 1}, "--devices: must be given without --workers or"),
        ({"scheduler": "h:1", "workers": 1}, "--scheduler: must be given without --workers"),
        ({"scheduler": ""}, "--scheduler: A scheduler must be an address such as"),
        ({"scheduler": "", "processes": 2}, "--scheduler: must be given without"),
        ({"scheduler": "."}, "--scheduler: The scheduler's file '.' cannot be used"),
    ],
)
def test_mistakes_are_told(options, message):
    everything = dict.fromkeys(("workers", "processes", "scheduler", "devices"))
    with pytest.raises(UserMistake) as caught:
        chosen_executor(**everything | options)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("count", [5, 10**9, 10**30])
def test_too_much_is_cut_down(four, count):
    assert chosen_executor(count, count, None, None) == Processes(4, 1)
    assert chosen_executor(count, None, None, None) == Threads(4)
