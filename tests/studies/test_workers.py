"""Worker processes of this machine: who may reach them, what becomes of those that die."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import closing, suppress
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest

from jaxsat.studies import processes as module
from jaxsat.studies.ensemble import _by_column
from jaxsat.studies.executors import ClusterError
from jaxsat.studies.processes import Processes
from jaxsat.studies.run import run_study
from jaxsat.studies.worker import packed
from studies.stores import contents, same, without_status
from studies.studies import tumbling
from studies.workloads import Deadly, EndsAtOnce, NotHere, deaf, fails, told

ALL = range(6)


def squares(executor, work):
    return dict(executor.run(work, ALL)) == {chunk: chunk * chunk for chunk in ALL}


def children():
    """Processes that this one has started, and that are not the one that tells."""
    command = ["ps", "-o", "pid=,comm=", "--ppid", str(os.getpid())]
    told = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    rows = (line.split() for line in told.splitlines())
    return {int(number) for number, name in rows if name != "ps"}


def listening(pids):
    """Sockets on which these processes wait for others, in the kernel's own tables."""
    held = set()
    for pid in pids:
        for handle in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(FileNotFoundError):  # the handle of this list
                held.update(re.findall(r"socket:\[(\d+)\]", os.readlink(handle)))
    found = []
    for table in ("tcp", "tcp6", "udp", "udp6"):
        rows = Path(f"/proc/net/{table}").read_text().splitlines()[1:]
        fields = [row.split() for row in rows]
        waits = {"0A"} if table.startswith("tcp") else {"07"}
        found += [(table, row[1]) for row in fields if row[3] in waits and row[9] in held]
    rows = [row.split() for row in Path("/proc/net/unix").read_text().splitlines()[1:]]
    accepting = 0x10000
    return found + [
        ("unix", row[6]) for row in rows if int(row[3], 16) & accepting and row[6] in held
    ]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_nothing_listens_and_nothing_is_left_in_the_folder_for_temporary_files(
    tmp_path, monkeypatch, capfd
):
    """Also: who computes, in which precision, with how many processors; a print is no answer."""
    with closing(socket.create_server(("127.0.0.1", 0))):
        assert [table for table, _ in listening([os.getpid()])] == ["tcp"]
    already = children()
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    seen = []
    for chunk, answer in Processes(2, 2).run(told, ALL):
        assert answer[1:] == ("float64", 1, chunk)
        seen.append(answer[0])
        workers = children() - already
        assert answer[0] in workers
        assert len(workers) <= 2
        assert not listening([os.getpid(), *workers])
        assert not list(tmp_path.iterdir())
        for worker in workers:
            (blocked,) = (
                int(line.split()[1], 16)
                for line in Path(f"/proc/{worker}/status").read_text().splitlines()
                if line.startswith("SigBlk")
            )
            assert blocked & 1 << signal.SIGINT - 1, "Ctrl-C would reach it"
    assert len(seen) == len(ALL)
    assert children() == already
    output = capfd.readouterr()
    assert output.out == ""
    assert output.err.count("a word of the work") == len(ALL)  # their line ends may be mixed up
    assert "machine code cannot be kept" not in output.err  # once, from the process that asks


@pytest.mark.slow
def test_what_lies_in_the_current_folder_is_not_imported(tmp_path, monkeypatch):
    """As where it is one that others can write to, or has a random.py of the user's."""
    for name in ("pickle", "random", "signal", "threading", "numpy", "jax", "jaxsat"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'trap')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place])
    assert dict(Processes(1).run(told, [7]))[7][1:] == ("float64", 1, 7)
    assert not (tmp_path / "trap").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chunks", "deaths", "how"),
    [((2,), 2, signal.SIGKILL), ((0, 1, 2), 1, signal.SIGKILL), ((0, 1, 2), 9, signal.SIGINT)],
)
def test_workers_that_die_are_replaced(tmp_path, chunks, deaths, how):
    """Twice on one chunk; once on several that are under way at once. Ctrl-C is not heard."""
    work = Deadly(tmp_path, chunks, deaths, how)
    assert squares(Processes(1, 3), work)
    if how == signal.SIGINT:
        assert {work.begun(chunk) for chunk in ALL} == {1}


@pytest.mark.slow
def test_a_worker_killed_is_replaced_and_changes_nothing(tmp_path):
    """Two processes; one is killed after the first chunk, and what it had is computed again."""
    seen, said = [], []

    def kill(_):
        seen.append(children())
        if len(seen) == 1:
            os.kill(min(seen[0]), signal.SIGKILL)

    study = tumbling(chunk=4)
    run_study(study, tmp_path / "s", executor=Processes(2, tell=said.append), report=kill)
    same(without_status(contents(tmp_path / "s")), _by_column(study.evaluate(np.arange(100))))
    assert len(seen) == 25
    assert len(set.union(*seen)) == 3, "the one killed was replaced"
    (line,) = said
    assert line.startswith("a worker process died, killed by SIGKILL")


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGABRT])
def test_a_chunk_on_which_all_workers_die_ends_the_run(tmp_path, how):
    """After as many as said, and with the name of that chunk alone."""
    work = Deadly(tmp_path, (3,), 99, how)
    with pytest.raises(ClusterError) as caught:
        squares(Processes(2, 2), work)
    told = f"{module.ATTEMPTS} worker processes died on chunk 3; the last was killed by {how.name}"
    assert str(caught.value).startswith(told)
    assert ("memory" in str(caught.value)) == (how == signal.SIGKILL)
    assert work.begun(3) == module.ATTEMPTS
    assert not children()


@pytest.mark.slow
def test_what_work_raises_is_raised_here():
    """With its type where that can be, and with its words anyhow."""
    executor = Processes(1)
    assert dict(executor.run(fails, [0, 6])) == {0: 0, 6: 6}
    for chunk, kind, words in [
        (1, RuntimeError, "Odd: this and that"),
        (2, KeyError, "two"),
        (4, TypeError, "BufferedReader"),
        (5, SystemExit, "enough"),
    ]:
        with pytest.raises(kind, match=words) as caught:
            list(executor.run(fails, [chunk]))
        assert "In a worker:\nTraceback" in caught.value.__notes__[0]
    with pytest.raises(ModuleNotFoundError, match="a_module_that_is_nowhere"):
        list(executor.run(NotHere(), ALL))


@pytest.mark.slow
def test_workers_that_cannot_begin_are_told():
    with pytest.raises(ClusterError, match=r"3 worker processes died before .* with status 3"):
        list(Processes(2).run(EndsAtOnce(), ALL))


def test_workers_that_cannot_be_started_are_told(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    with pytest.raises(ClusterError, match="no worker process can be started: No such file"):
        list(Processes(2).run(told, ALL))


def test_a_run_is_stopped_from_another_thread():
    """At once, with its processes, whatever they do; and so is one whose results nobody wants."""
    executor, said = Processes(2), []

    def run():
        try:
            list(executor.run(deaf, ALL))
        except ClusterError as error:
            said.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    while not children():
        time.sleep(0.01)
    begun = time.monotonic()
    executor.stop()
    assert time.monotonic() - begun < 2.0
    thread.join(1.0)
    assert said == ["the run was stopped"]
    assert not children()


@pytest.mark.parametrize("options", [{"count": 0}, {"count": 2, "threads": 0}, {"count": -1}])
def test_counts_are_checked(options):
    with pytest.raises(ValueError, match="must be at least 1"):
        Processes(**options)


@pytest.mark.slow
def test_no_more_processes_are_started_than_there_are_chunks():
    assert len({answer[0] for _, answer in Processes(10**9).run(told, [0])}) == 1
    assert list(Processes(10**9).run(told, [])) == []


def test_a_module_of_a_program_is_refused_as_its_fields_would_be_lost():
    class Gain(eqx.Module):
        gain: float

        def __call__(self, chunk):
            return self.gain * chunk

    with pytest.raises(ClusterError, match=r"can import, got .*Gain of studies.test_workers"):
        packed(Gain(2.0))
    offset = 3
    assert packed(lambda chunk: chunk + offset).unpacked()(4) == 7
