"""Damaged stores: every damage is repaired and told, or refused with one message."""

import collections
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from corruption import KINDS, corrupt, files_of
from jaxsat.store.files import OutputError
from jaxsat.store.ledger import study_columns
from jaxsat.store.store import StudyStore
from jaxsat.store.tables import open_study
from store.stores import COLUMNS, IDENTITY, made, values

COUNT, CHUNK = 22, 4
SEEDS = 48
"""Damages of each store: every kind of them several times."""

TRUTH = values(np.arange(COUNT))


def filled(path, chunks):
    with made(path, COUNT, CHUNK) as store:
        for chunk in chunks:
            store.write(chunk, values(store.numbers(chunk)))
    return path


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stores")
    return filled(folder / "whole", range(6)), filled(folder / "half", [0, 2, 3])


def is_right(columns, done):
    """Whether what is read is the truth: no case lost, none too many, none different."""
    status = np.asarray(columns["status"])
    if len(status) != len(done) or not np.array_equal(status == 1, done):
        return False
    return all(
        np.array_equal(np.asarray(columns[name])[done], TRUTH[name][: len(done)][done])
        for name in COLUMNS
    )


def outcome_of_reading(path, done):
    try:
        right = [is_right(study_columns(path), done), is_right(open_study(path), done)]
    except OutputError:
        return "told"
    return "right" if all(right) else "wrong"


def outcome_of_resuming(path, done):
    """Computes what is missing, as a study does; what was done is not done again in silence."""
    due = set(range(6)) - set(np.flatnonzero(done) // CHUNK)
    try:
        with made(path, COUNT, CHUNK) as store:
            again = list(store.pending())
            told = list(store.repairs)
            for chunk in again:
                store.write(chunk, values(store.numbers(chunk)))
    except OutputError:
        return "told"
    if not is_right(study_columns(path), np.ones(COUNT, bool)):
        return "wrong"
    plain = xr.open_zarr(path, chunks=None)  # any warning is an error here
    if not is_right(plain, np.ones(COUNT, bool)):
        return "wrong for others"
    if set(again) != due and not told:
        return "silent"
    return "repaired" if told else "right"


def campaign(store, done, folder, seeds):
    found = collections.Counter()
    for seed in seeds:
        path = folder / "s"
        shutil.copytree(store, path)
        damage = corrupt(path, seed)
        outcomes = outcome_of_reading(path, done), outcome_of_resuming(path, done)
        assert set(outcomes) <= {"right", "told", "repaired"}, (seed, damage, outcomes)
        found[damage.kind, *outcomes] += 1
        shutil.rmtree(path)
    return found


def done_of(chunks):
    done = np.zeros(min(COUNT, (max(chunks) + 1) * CHUNK), bool)
    for chunk in chunks:
        done[chunk * CHUNK : (chunk + 1) * CHUNK] = True
    return done


@pytest.mark.slow
def test_no_damage_of_a_store_is_silent_or_a_traceback(stores, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # what is tested needs no disk
    for store, chunks in zip(stores, (range(6), [0, 2, 3]), strict=True):
        found = campaign(store, done_of(chunks), tmp_path, range(SEEDS))
        assert {kind for kind, *_ in found} == set(KINDS)


@pytest.mark.parametrize("change", ["flip", "delete", "copy"])
def test_a_bad_chunk_is_found_when_read_and_computed_again_when_resumed(stores, tmp_path, change):
    path = tmp_path / "s"
    shutil.copytree(stores[0], path)
    bad = path / "omega" / "c" / "3" / "0"
    if change == "delete":
        bad.unlink()
    elif change == "copy":
        shutil.copyfile(path / "omega" / "c" / "1" / "0", bad)
    else:
        data = bytearray(bad.read_bytes())
        data[len(data) // 2] ^= 4
        bad.write_bytes(data)
    message = r"chunk 3 \(cases 12 to 15\) of omega is damaged; run the same study again"
    with pytest.raises(OutputError, match=message):
        np.asarray(study_columns(path)["omega"])
    with pytest.raises(OutputError, match=message):
        open_study(path)["omega"].load()
    np.testing.assert_array_equal(open_study(path)["omega"][:12], TRUTH["omega"][:12])
    with made(path, COUNT, CHUNK) as store:
        assert store.repairs == ["chunk 3 was damaged (omega) and is computed again"]
        assert list(store.pending()) == [3]
        store.write(3, values(store.numbers(3)))
    with made(path, COUNT, CHUNK) as store:
        assert store.repairs == []
    assert is_right(study_columns(path), np.ones(COUNT, bool))


def test_nothing_of_another_study_is_taken_for_this_ones(stores, tmp_path):
    """All files but the header of a store of the same shape."""
    path = tmp_path / "s"
    shutil.copytree(stores[0], path)
    with StudyStore(tmp_path / "t", {**IDENTITY, "seed": 2}, COLUMNS, COUNT, CHUNK) as store:
        for chunk in store.pending():
            store.write(chunk, values(store.numbers(chunk) + 100))
    for name in files_of(tmp_path / "t"):
        if name != "zarr.json":
            shutil.copyfile(tmp_path / "t" / name, path / name)
    with pytest.raises(OutputError, match="ledger is damaged"):
        study_columns(path)
    with made(path, COUNT, CHUNK) as store:
        assert "the ledger had" in store.repairs[0]
        assert list(store.pending()) == list(range(6))


def test_links_in_a_store_are_not_followed(stores, tmp_path):
    path = tmp_path / "s"
    shutil.copytree(stores[1], path)
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "1").write_text("years of work")
    (path / "cost" / "c" / "1").symlink_to(mine / "1")
    with made(path, COUNT, CHUNK) as store:
        store.write(1, values(store.numbers(1)))
    assert (mine / "1").read_text() == "years of work"
    shutil.rmtree(path / "cost" / "c")
    (path / "cost" / "c").symlink_to(mine)
    with made(path, COUNT, CHUNK) as store:
        assert store.done() == [], "what was there is not in the store any more"
        with pytest.raises(OutputError, match="cost/c is no folder of jaxsat's"):
            store.write(1, values(store.numbers(1)))
    assert (mine / "1").read_text() == "years of work"


def test_a_store_of_an_older_format_is_refused(stores, tmp_path):
    path = tmp_path / "s"
    shutil.copytree(stores[0], path)
    text = (path / "zarr.json").read_text()
    (path / "zarr.json").write_text(text.replace('"jaxsat_format": 4', '"jaxsat_format": 3'))
    for attempt in (study_columns, open_study, lambda path: made(path, COUNT, CHUNK)):
        with pytest.raises(OutputError, match=r"another version of jaxsat.*open_zarr"):
            attempt(path)


def test_what_was_opened_before_a_store_grew_is_read_from_the_larger_one(tmp_path):
    with made(tmp_path / "s") as store:
        for chunk in store.pending():
            store.write(chunk, values(store.numbers(chunk)))
    before = open_study(tmp_path / "s")
    with made(tmp_path / "s", count=12) as store:
        store.write(2, values(store.numbers(2)))
    np.testing.assert_array_equal(before["omega"], TRUTH["omega"][:10])


def test_a_store_is_as_large_as_what_is_done(tmp_path):
    """However many cases are asked for."""
    with made(tmp_path / "s") as store:
        for chunk in store.pending():
            store.write(chunk, values(store.numbers(chunk)))
    with made(tmp_path / "s", count=10**9) as store:
        assert store.count == 10**9
        for chunk in (2, 3):
            store.write(chunk, values(store.numbers(chunk)))
    assert open_study(tmp_path / "s").sizes["case"] == 16
    with xr.open_zarr(tmp_path / "s", chunks=None) as plain:
        np.testing.assert_array_equal(plain["case"], np.arange(16))
    with made(tmp_path / "s") as store:
        assert (store.count, list(store.pending())) == (16, [])


KILLED = """
import os, sys
sys.path[:0] = sys.argv[2:]
from store.stores import made, values
from jaxsat.store import arrays as module
plain = module.write_file
def write(path, *arguments, **options):
    if path.parts[-3:] == ("cost", "c", "1"):
        options["partial"].write_bytes(b"half")
        os._exit(9)
    plain(path, *arguments, **options)
module.write_file = write
with made(sys.argv[1], 10**6) as store:
    for chunk in store.pending():
        store.write(chunk, values(store.numbers(chunk)))
"""


@pytest.mark.slow
def test_what_a_killed_writer_left_in_a_store_is_removed(tmp_path):
    command = [sys.executable, "-c", KILLED, str(tmp_path / "s"), *sys.path]
    environment = {**os.environ, "JAX_ENABLE_X64": "1"}
    assert subprocess.run(command, check=False, env=environment).returncode == 9
    users = tmp_path / "s" / "cost" / "c" / ".jaxsat-0123456789abcdef.partial"
    users.write_text("of the user")
    assert len(list((tmp_path / "s").rglob("*.partial"))) > 1
    with made(tmp_path / "s") as store:
        assert store.repairs == []
        assert store.done() == [0]
    assert list((tmp_path / "s").rglob("*.partial")) == [users]
