"""The store as a ledger: resumed, refused, interrupted."""

import errno
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from jaxsat.store import arrays as arrays_module
from jaxsat.store import store as store_module
from jaxsat.store.files import OutputError
from jaxsat.store.folder import OutputFolder
from jaxsat.store.header import differences
from jaxsat.store.ledger import study_columns
from jaxsat.store.store import StudyStore
from jaxsat.store.tables import open_study
from jaxsat.store.temporary import lock_folder, remove_stale, temporary_folder
from store.stores import IDENTITY, made, values


def test_a_store_is_filled_chunk_by_chunk(tmp_path):
    with made(tmp_path / "s") as store:
        assert (store.count, store.chunk, store.chunks) == (10, 4, 3)
        assert list(store.pending()) == [0, 1, 2]
        for chunk in (2, 0):
            store.write(chunk, values(store.numbers(chunk)))
        assert list(store.pending()) == [1]
    dataset = open_study(tmp_path / "s")
    np.testing.assert_array_equal(dataset["status"], [1, 1, 1, 1, 0, 0, 0, 0, 1, 1])
    np.testing.assert_array_equal(dataset["cost"][8:], [0.8, 0.9])
    assert np.all(np.isnan(dataset["omega"][4:8]))
    assert dataset["cost"].dims == ("case",)
    assert dataset["omega"].attrs["units"] == "rad s-1"
    assert json.loads(dataset.attrs["identity"]) == IDENTITY
    assert json.loads(dataset.attrs["runs"])[0]["versions"]["jaxsat"]
    columns = study_columns(tmp_path / "s")
    assert set(columns) == set(dataset)
    for name, column in columns.items():
        np.testing.assert_array_equal(np.asarray(column), dataset[name])


def test_a_store_is_continued_and_grows(tmp_path):
    with made(tmp_path / "s") as store:
        store.write(0, values(store.numbers(0)))
        store.write(2, values(store.numbers(2)))
    with made(tmp_path / "s", count=13, chunk=100) as store:
        assert (store.count, store.chunk) == (13, 4)
        assert store.done() == [0]
        assert list(store.pending()) == [1, 2, 3]
        np.testing.assert_array_equal(store.values(0, ["cost"])["cost"], np.arange(4) * 0.1)


def test_another_study_is_refused(tmp_path):
    made(tmp_path / "s").close()
    other = {"seed": 2, "program": {"duration": 2.0}}
    with pytest.raises(OutputError, match=r"another study \(seed: 1 there, 2 here\)"):
        made(tmp_path / "s", identity=other)


def test_differences_are_told_by_place_numbers_without_names_where_nothing_else_differs():
    old = {"program": {"numbers": [[1, 2], 3]}, "scenario": {"k": 1}, "list": [1], "same": [[0]]}
    new = {"program": {"numbers": [[1, 4], 5]}, "scenario": {"k": 2}, "list": [1, 2], "same": [[0]]}
    assert differences(old, new) == [
        "list: [1] there, [1, 2] here",
        "scenario.k: 1 there, 2 here",
    ]
    assert differences({"program": old["program"]}, {"program": new["program"]}) == [
        "program.numbers.1.2: 2 there, 4 here",
        "program.numbers.2: 3 there, 5 here",
    ]
    many = differences(list(range(9)), list(range(1, 10)))
    assert len(many) == 7
    assert many[-1] == "and 3 more"
    assert differences(old, old) == []


def test_what_is_no_store_is_refused(tmp_path):
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "mine.txt").write_text("mine")
    (tmp_path / "f").write_text("a file")
    for name in "sf":
        with pytest.raises(OutputError, match=r"no store|is a file"):
            made(tmp_path / name)
    assert (tmp_path / "s" / "mine.txt").read_text() == "mine"


@pytest.mark.slow
def test_a_second_writer_is_refused(tmp_path):
    code = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "from store.stores import made\n"
        "from jaxsat.store.files import OutputError\n"
        "try:\n    made(sys.argv[1])\nexcept OutputError as error:\n    print(error)\n"
    )
    with made(tmp_path / "s"):
        command = [sys.executable, "-c", code, str(tmp_path / "s"), *sys.path]
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        assert "another process" in run.stdout
    made(tmp_path / "s").close()


def test_other_conditions_are_told_and_must_be_allowed(tmp_path, monkeypatch):
    made(tmp_path / "s").close()
    here = store_module.machine()
    there = {**here, "processor": "another", "versions": {**here["versions"], "jax": "0.0.1"}}
    monkeypatch.setattr(store_module, "machine", lambda: there)
    with pytest.raises(
        OutputError, match=r"processor: .* there, \"another\" here.*versions.jax"
    ) as told:
        made(tmp_path / "s")
    assert told.value.elsewhere
    made(tmp_path / "s", elsewhere=True).close()
    runs = json.loads(open_study(tmp_path / "s").attrs["runs"])
    assert [run["machine"]["processor"] for run in runs] == [here["processor"], "another"]


def test_a_full_disk_is_told_and_leaves_a_store_that_goes_on(tmp_path, monkeypatch):
    with made(tmp_path / "s") as store:
        store.write(0, values(store.numbers(0)))
        plain = arrays_module.write_file

        def full(path, *arguments, **options):
            if path.parent.parent.parent.name == "omega":
                raise OSError(errno.ENOSPC, "No space left on device")
            plain(path, *arguments, **options)

        monkeypatch.setattr(arrays_module, "write_file", full)
        with pytest.raises(OutputError, match=r"No space left on device.*to resume"):
            store.write(1, values(store.numbers(1)))
        monkeypatch.undo()
    with made(tmp_path / "s") as store:
        assert store.repairs == []
        assert list(store.pending()) == [1, 2]


def test_a_store_cannot_lack_a_column(tmp_path):
    with made(tmp_path / "s") as store, pytest.raises(ValueError, match="omega"):
        store.write(0, {"cost": np.zeros(4), "code": np.zeros(4)})


def abandoned(path):
    """A folder as a killed process leaves it, with a file that it had written."""
    made = temporary_folder(path, "run")
    made.marker.write("file", b"something")
    made.lock.close()
    return made.path


def test_what_a_killed_process_left_is_removed(tmp_path):
    """Only what nobody holds a lock on, only once it is old enough to have been locked, and only
    what jaxsat alone wrote."""
    stale, young, held, edited, more = (abandoned(tmp_path / "s") for _ in range(5))
    other = abandoned(tmp_path / "t")
    copy = tmp_path / ".s.partial-copy"
    shutil.copytree(stale, copy)
    users = tmp_path / ".s.partial-mine"
    users.mkdir()
    (users / "thesis.tex").write_text("years of work")
    (edited / "file").write_text("changed")
    (more / "notes").write_text("of the user")
    for folder in (stale, held, edited, more, other, copy, users):
        os.utime(folder, (0, 0))
    lock = lock_folder(held)
    made(tmp_path / "s").close()
    lock.close()
    assert not stale.exists()
    for folder in (young, held, edited, more, other, copy, users):
        assert folder.exists(), folder
    with OutputFolder(tmp_path / "t") as folder:
        os.utime(folder.path, (0, 0))
        remove_stale(tmp_path, ".t.partial-")
        assert folder.path.exists(), "its writer lives"
    assert not other.exists()


def test_a_store_made_by_another_process_meanwhile_is_continued(tmp_path, monkeypatch):
    plain = StudyStore._make

    def late(self, header):
        monkeypatch.setattr(StudyStore, "_make", plain)
        with made(tmp_path / "s") as first:
            first.write(0, values(first.numbers(0)))
        plain(self, header)

    monkeypatch.setattr(store_module, "is_absent_or_empty", lambda path: True)
    monkeypatch.setattr(StudyStore, "_make", late)
    with made(tmp_path / "s") as store:
        assert list(store.pending()) == [1, 2]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s"]
