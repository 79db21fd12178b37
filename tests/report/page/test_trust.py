"""What a report shows is what jaxsat wrote, and showing it runs nothing of others."""

import numpy as np
import pytest

from helpers.pages import run_dataset
from jaxsat.report.page import report_page
from jaxsat.report.page.batches import read_lines, read_record
from jaxsat.store.chunks import Column
from jaxsat.store.files import OutputError
from jaxsat.store.folder import OutputFolder
from jaxsat.store.marker import MARKER, Marker, UnverifiedWarning
from jaxsat.store.netcdf import dataset_bytes
from jaxsat.store.store import StudyStore

COLUMNS = {
    "code": Column((), "int8", "1", "outcome"),
    "settling_time": Column((), "float64", "s", "settling time"),
    "effort": Column((), "float64", "N m s", "effort"),
    "cost": Column((), "float64", "1", "cost"),
}


@pytest.fixture
def folder(tmp_path):
    marker = Marker.make(tmp_path, "controllability", {})
    marker.write("failures.csv", b"failed,verdict\nnone,uncontrollable\n")
    marker.write("verdict.json", b"{}")
    return tmp_path


def test_a_file_that_was_changed_is_refused(folder):
    file = folder / "failures.csv"
    assert "uncontrollable" in read_lines(file)
    file.write_text(file.read_text().replace("uncontrollable", "controllable"))
    with pytest.raises(OutputError, match=r"failures\.csv was damaged, or changed"):
        read_lines(file)
    (folder / "verdict.json").unlink()
    with pytest.raises(OutputError, match=r"verdict\.json was removed"):
        read_record(folder / "verdict.json")


def test_files_that_jaxsat_did_not_write_are_read_and_that_is_told(folder):
    (folder / "notes.md").write_text("mine")
    with pytest.warns(UnverifiedWarning, match=r"notes\.md is not verified: jaxsat did not write"):
        assert read_lines(folder / "notes.md") == "mine"
    assert read_lines(folder / "nothing.md") == ""


def test_files_without_a_marker_are_read_and_that_is_told(folder):
    assert "uncontrollable" in read_lines(folder / "failures.csv")
    (folder / MARKER).unlink()
    with pytest.warns(UnverifiedWarning, match=r"not verified: it has no \.jaxsat"):
        assert "uncontrollable" in read_lines(folder / "failures.csv")


def test_a_page_of_a_run_without_a_marker_says_so(tmp_path):
    folder = tmp_path / "run"
    with OutputFolder(folder) as made:
        made.write("trajectory.nc", dataset_bytes(run_dataset()))
    assert "Not verified" not in report_page([folder])
    (folder / MARKER).unlink()
    with pytest.warns(UnverifiedWarning, match=f"files in {folder} are not verified"):
        page = report_page([folder])
    assert "Not verified" in page


def test_a_store_is_shown_without_the_module_that_it_names(tmp_path, monkeypatch):
    (tmp_path / "named_by_a_store.py").write_text("open(__file__ + '.ran', 'w').close()")
    monkeypatch.syspath_prepend(str(tmp_path))
    identity = {
        "scenario": {"control": {"law": "named_by_a_store:Law"}},
        "seed": 7, "size": None, "design": "Independent",
        "engine": {"name": "scan", "batch_size": 64}, "program": {"operations": "f00d"},
    }  # fmt: skip
    values = {name: np.ones(16, one.dtype) for name, one in COLUMNS.items()}
    with StudyStore(tmp_path / "s.zarr", identity, COLUMNS, 16, 16) as store:
        store.write(0, values | {"code": np.zeros(16, np.int8)})
    assert "named_by_a_store:Law" in report_page([tmp_path / "s.zarr"])
    assert not (tmp_path / "named_by_a_store.py.ran").exists()
