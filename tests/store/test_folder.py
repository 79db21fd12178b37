"""Output folders: complete or not there, whatever happens."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from jaxsat.store import folder as module
from jaxsat.store.folder import MARKER, OutputError, OutputFolder
from jaxsat.store.temporary import _umask
from store.folders import names, write


def test_appears_at_the_end(tmp_path):
    target = tmp_path / "deep" / "out"
    with OutputFolder(target) as folder:
        (folder.path / "data.txt").write_text("x")
        assert not target.exists()
        assert folder.path.parent == target.parent
        assert folder.path.name.startswith(".")
    assert names(target) == [MARKER, "data.txt"]
    assert names(target.parent) == ["out"]
    assert (target.stat().st_mode & 0o777) == 0o777 & ~_umask()


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_leaves_nothing_behind_on_failure(tmp_path, error):
    def work():
        with OutputFolder(tmp_path / "deep" / "out") as folder:
            (folder.path / "data.txt").write_text("x")
            raise error

    with pytest.raises(error):
        work()
    assert names(tmp_path) == []


def test_refuses_what_exists(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    with pytest.raises(OutputError, match="already exists; give --overwrite"):
        OutputFolder(target)
    assert (target / "data.txt").read_text() == "old"


@pytest.mark.parametrize("exchange", [True, False])
def test_overwrites_when_told(tmp_path, monkeypatch, exchange):
    if not exchange:
        monkeypatch.setattr(module, "_exchange", lambda one, other: False)
    target = tmp_path / "out"
    write(target, "old")
    write(target, "new", overwrite=True)
    assert (target / "data.txt").read_text() == "new"
    assert names(tmp_path) == ["out"]


def test_old_result_stays_when_the_new_one_fails(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    with pytest.raises(ValueError, match="boom"), OutputFolder(target, overwrite=True):
        raise ValueError("boom")
    assert (target / "data.txt").read_text() == "old"
    assert names(tmp_path) == ["out"]


def test_failed_second_rename_restores_the_old_result(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_exchange", lambda one, other: False)
    target = tmp_path / "out"
    write(target, "old")
    rename = Path.rename

    def fail(self, other):
        if "partial" in self.name and not self.name.endswith("-old"):
            raise OSError(28, "No space left on device")
        return rename(self, other)

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(OutputError, match="No space left on device"):
        write(target, "new", overwrite=True)
    assert (target / "data.txt").read_text() == "old"
    assert names(tmp_path) == ["out"]


def test_target_that_comes_while_computing_is_kept(tmp_path):
    target = tmp_path / "out"
    with pytest.raises(OutputError, match="already exists"), OutputFolder(target):
        target.mkdir()
    assert names(tmp_path) == ["out"]


def test_empty_folder_may_be_overwritten(tmp_path):
    target = tmp_path / "out"
    target.mkdir()
    write(target, overwrite=True)
    assert (target / "data.txt").exists()


def test_refuses_files_and_what_cannot_be_written(tmp_path):
    file = tmp_path / "file"
    file.write_text("x")
    for overwrite in (True, False):
        with pytest.raises(OutputError, match="is a file"):
            OutputFolder(file, overwrite=overwrite)
    with pytest.raises(OutputError, match="file is a file"):
        write(file / "out")
    with pytest.raises(OutputError, match="cannot be written: File name too long"):
        write(tmp_path / ("x" * 300))


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_no_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="Permission denied"):
        write(tmp_path / "out")


def test_error_while_writing_is_explained(tmp_path):
    with (
        pytest.raises(OutputError, match="cannot be written: No space left on device"),
        OutputFolder(tmp_path / "out"),
    ):
        raise OSError(28, "No space left on device")
    assert names(tmp_path) == []


def test_symbolic_link_to_a_result_is_followed(tmp_path):
    target = tmp_path / "real"
    write(target, "old")
    link = tmp_path / "link"
    link.symlink_to(target)
    write(link, "new", overwrite=True)
    assert link.is_symlink()
    assert (target / "data.txt").read_text() == "new"


SCRIPT = textwrap.dedent(
    """
    import pathlib, sys, time
    from jaxsat.store.folder import OutputFolder
    with OutputFolder(sys.argv[1], overwrite=True) as folder:
        (folder.path / "data.txt").write_text("half")
        print("ready", flush=True)
        time.sleep(60)
    """
)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("existing", [True, False])
def test_killed_in_the_middle(tmp_path, number, existing):
    target = tmp_path / "out"
    if existing:
        write(target, "old")
    command = [sys.executable, "-c", SCRIPT, str(target)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=Path.cwd()
    ) as process:
        assert process.stdout.readline() == b"ready\n"
        process.send_signal(number)
        process.wait(20)
    assert target.exists() == existing
    if existing:
        assert names(target) == [MARKER, "data.txt"]
        assert (target / "data.txt").read_text() == "old"
    if number == signal.SIGINT:
        assert names(tmp_path) == (["out"] if existing else [])
    else:
        assert all(name == "out" or name.startswith(".out.partial-") for name in names(tmp_path))


LOOP = textwrap.dedent(
    """
    import pathlib, sys
    from jaxsat.store.folder import OutputFolder
    for number in range(100000):
        with OutputFolder(sys.argv[1], overwrite=True) as folder:
            for name in ("a", "b"):
                (folder.path / name).write_text(str(number))
        if number == 0:
            print("ready", flush=True)
    """
)


def test_killed_at_any_moment_the_target_is_whole(tmp_path):
    for trial in range(4):
        target = tmp_path / f"out{trial}"
        command = [sys.executable, "-c", LOOP, str(target)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=Path.cwd()) as process:
            assert process.stdout.readline() == b"ready\n"
            time.sleep(0.05 + 0.013 * trial)
            process.kill()
            process.wait(20)
        assert names(target) == [MARKER, "a", "b"]
        assert (target / "a").read_text() == (target / "b").read_text() != ""
