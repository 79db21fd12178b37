"""A disk that is full: a failure, told in one line, that leaves what there was."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from jaxsat.cli import main
from jaxsat.report import saving
from jaxsat.store.chunks import Column
from jaxsat.store.files import OutputError, save_file
from jaxsat.store.folder import OutputFolder
from jaxsat.store.netcdf import dataset_bytes
from jaxsat.store.resumable import ResumableFolder
from jaxsat.store.store import StudyStore
from jaxsat.store.tables import open_study


def noise(bytes_):
    return np.random.default_rng(0).bytes(bytes_)


def large():
    """A dataset that cannot be compressed to 1 MB."""
    return xr.Dataset({"x": ("time", np.random.default_rng(0).random(10**6))})


def is_empty(folder):
    return not any(folder.iterdir())


def test_single_files_and_output_folders(small_disk):
    for attempt in (save_file, lambda path, data: save_file(path, dataset_bytes(large()))):
        with pytest.raises(OutputError, match="No space left on device") as caught:
            attempt(small_disk / "f", noise(2**21))
        assert caught.value.failure
        assert is_empty(small_disk)
    with (
        pytest.raises(OutputError, match="No space left on device") as caught,
        OutputFolder(small_disk / "out") as folder,
    ):
        folder.write("small", b"x")
        folder.write("large", noise(2**21))
    assert caught.value.failure
    assert is_empty(small_disk)


def test_results_stay_where_there_is_no_room_for_figures(small_disk, monkeypatch):
    sizes = {"a": 2**18, "b": 2**21, "c": 2**8}
    monkeypatch.setattr(saving, "_draw", lambda name, _: {f"{name}.png": noise(sizes[name])})
    with OutputFolder(small_disk / "out") as folder:
        folder.write("result", b"x")
        with pytest.warns(RuntimeWarning, match=r"^b.png, c.png: not written, No space left on"):
            saving.save_figures(dict.fromkeys(sizes, Figure()), folder.write)
        assert folder.names == ["a.png", "result"]
    left = sorted(path.name for path in (small_disk / "out").iterdir())
    assert left == [".jaxsat", "a.png", "result"]


def test_a_folder_that_is_gone_on_with(small_disk):
    with ResumableFolder(small_disk / "run", "tuning", {}) as folder:
        folder.write("a", b"old")
        with pytest.raises(OutputError, match="No space left on device") as caught:
            folder.write("a", noise(2**21))
    assert caught.value.failure
    with ResumableFolder(small_disk / "run", "tuning", {}) as folder:
        assert folder.read("a") == b"old"
        folder.write("a", b"new")
    assert sorted(path.name for path in (small_disk / "run").iterdir()) == [".jaxsat", "a"]


def test_a_store_goes_on_once_there_is_room(small_disk):
    columns = {"x": Column((64,), "float64", "1", "noise", ("place",))}
    values = {"x": np.random.default_rng(0).random((256, 64))}

    def store():
        return StudyStore(small_disk / "s", {}, columns, 256 * 40, 256)

    ballast = small_disk / "ballast"
    ballast.write_bytes(bytes(600_000))
    with store() as opened:
        with pytest.raises(OutputError, match=r"No space left on device.*to resume") as caught:
            for chunk in opened.pending():
                opened.write(chunk, values)
        done = opened.done()
    assert caught.value.failure
    assert len(done) > 0
    ballast.unlink()
    with store() as opened:
        assert opened.repairs == []
        assert opened.done() == done
        opened.write(len(done), values)
    found = open_study(small_disk / "s")
    assert found.sizes["case"] == 256 * (len(done) + 1)
    np.testing.assert_array_equal(found["x"][-256:], values["x"])


def test_reproduce(small_disk, monkeypatch, capsys):
    """Simulations and verdicts are not what is tested."""
    from jaxsat.cli import reproduce
    from jaxsat.report import reproduction

    monkeypatch.setattr(reproduce, "_simulate_all", lambda quiet: {"rate": large()})
    monkeypatch.setattr(reproduction, "judge", lambda datasets: [])
    monkeypatch.setattr("jaxsat.report.reproduction.figures.paper_figures", lambda datasets: {})
    monkeypatch.chdir(small_disk)
    with pytest.raises(SystemExit) as caught:
        main(["reproduce", "--out", "out"])
    assert caught.value.code == 1
    told = capsys.readouterr().err.splitlines()[-1]  # progress before it, on a slow machine
    assert told == f"jaxsat: {small_disk}/out cannot be written: No space left on device."
    assert is_empty(small_disk)
