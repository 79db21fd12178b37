"""Single files: whole or not at all, in the place that is meant and no other."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from jaxsat.store import files as module
from jaxsat.store.files import OutputError, read_file, refuse_existing, save_file, write_file


def names(path):
    return sorted(entry.name for entry in Path(path).iterdir())


def test_a_file_is_written_and_replaced(tmp_path):
    write_file(tmp_path / "f", "old")
    write_file(tmp_path / "f", b"new")
    assert read_file(tmp_path / "f") == b"new"
    with pytest.raises(FileExistsError):
        write_file(tmp_path / "f", "newer", replace=False)
    assert read_file(tmp_path / "f") == b"new"
    assert names(tmp_path) == ["f"]
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE((tmp_path / "f").stat().st_mode) == 0o666 & ~mask


def test_links_are_replaced_and_not_followed(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    (tmp_path / "f").symlink_to(tmp_path / "thesis.tex")
    assert read_file(tmp_path / "f") is None
    write_file(tmp_path / "f", "new")
    assert (tmp_path / "thesis.tex").read_text() == "years of work"
    assert (tmp_path / "f").read_text() == "new"


def test_a_name_that_is_taken_is_not_used_for_the_partial_file(tmp_path):
    trap = tmp_path / module.partial_name("token")
    (tmp_path / "thesis.tex").write_text("years of work")
    trap.symlink_to(tmp_path / "thesis.tex")
    with pytest.raises(FileExistsError):
        write_file(tmp_path / "f", "new", partial=trap)
    assert trap.is_symlink()
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize("step", ["fsync", "link", "replace"])
def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch, step):
    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    write_file(tmp_path / "f", "old")
    owner = Path if step == "replace" else os
    monkeypatch.setattr(owner, step, fail)
    target = tmp_path / ("g" if step == "link" else "f")
    with pytest.raises(OSError, match="No space"):
        write_file(target, "new", replace=step != "link")
    assert names(tmp_path) == ["f"]
    assert (tmp_path / "f").read_text() == "old"


def test_a_system_without_files_is_not_said_to_lack_the_file(tmp_path):
    """Of `mkdir /proc/x` Linux says that there is no such file or directory."""
    absent = FileNotFoundError(2, "No such file or directory")
    written = str(module.system_failure(tmp_path / "new" / "x", "written", absent))
    assert written == f"{tmp_path / 'new' / 'x'} cannot be written: {tmp_path} takes no new files."
    assert str(module.system_failure(tmp_path / "x", "read", absent)).endswith("file or directory.")


def test_without_hard_links_nothing_is_replaced_either(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write_file(tmp_path / "f", "old", replace=False)
    with pytest.raises(FileExistsError):
        write_file(tmp_path / "f", "new", replace=False)
    assert (tmp_path / "f").read_text() == "old"
    assert names(tmp_path) == ["f"]


def test_only_plain_files_are_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder", "nothing", "folder/nothing", "pipe/nothing"):
        assert read_file(tmp_path / name) is None


def test_a_file_that_a_user_names_is_replaced_only_when_asked(tmp_path):
    target = tmp_path / "found.json"
    save_file(target, "old")
    with pytest.raises(OutputError, match="already exists; give --overwrite"):
        save_file(target, "new")
    assert target.read_text() == "old"
    save_file(target, "new", overwrite=True)
    assert target.read_text() == "new"
    for place in (tmp_path, Path(os.devnull), tmp_path / "nowhere" / "f"):
        with pytest.raises(OutputError, match=r"is not a (file|folder)"):
            refuse_existing(place, overwrite=True)


WRITERS = """
import sys
from jaxsat.store.files import write_file
from pathlib import Path
for number in range(200):
    write_file(Path(sys.argv[1]), sys.argv[2] * 5000, durable=False)
"""


def test_of_two_writers_one_wins_and_the_file_is_whole(tmp_path):
    target = tmp_path / "f"
    write_file(target, "a" * 5000)
    running = [
        subprocess.Popen([sys.executable, "-c", WRITERS, str(target), letter]) for letter in "ab"
    ]
    while any(process.poll() is None for process in running):
        assert read_file(target) in (b"a" * 5000, b"b" * 5000)
    assert [process.returncode for process in running] == [0, 0]
    assert names(tmp_path) == ["f"]
