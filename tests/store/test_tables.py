"""Stores as pandas and other readers of Zarr see them: labelled, without a warning, as a table."""

import json
import os
import shutil

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from jaxsat.store import arrays as arrays_module
from jaxsat.store.chunks import Column, Coordinate
from jaxsat.store.files import OutputError
from jaxsat.store.store import StudyStore
from jaxsat.store.tables import case_table, open_study, save_case_table
from store.stores import COLUMNS, IDENTITY, made, values

TABLE_COLUMNS = {
    "code": Column((), "int8", "1", "how it ended"),
    "settling_time": Column((), "float64", "s", "settling time"),
    "omega": Column((3,), "float64", "rad s-1", "the rates", ("body_axis",)),
    "w": Column((2,), "float64", "1", "the tilt", ("w_component",)),
    "drawn_delay": Column((), "float64", "s", "the delay"),
    "drawn_walk": Column((), "float64", "rad s-2 Hz-0.5", "the bias walk"),
    "history_z": Column((5,), "float64", "rad", "the turn", ("history_time",)),
}
TABLE_COORDINATES = {
    "body_axis": Coordinate(("x", "y", "z")),
    "w_component": Coordinate(("w1", "w2")),
    "history_time": Coordinate((0.0, 1.0, 2.0, 3.0, 4.0), "s", "time since the start"),
}


def table_values(numbers):
    size = len(numbers)
    settling_time = np.where(numbers % 2, numbers / 3, np.inf)
    return {
        "code": np.where(numbers == 4, 1, 0),
        "settling_time": settling_time,
        "omega": numbers[:, None] + np.array([0.1, 0.2, 0.3]),
        "w": np.where((numbers == 4)[:, None], np.nan, np.ones((size, 2))),
        "drawn_delay": numbers * 1e-3,
        "drawn_walk": numbers * 1e-6,
        "history_z": np.zeros((size, 5)),
    }


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Cases 0 to 9 and none of 4 to 7 but those that the third chunk brings."""
    path = tmp_path_factory.mktemp("tables") / "s.zarr"
    arguments = (path, IDENTITY, TABLE_COLUMNS, 10, 4)
    with StudyStore(*arguments, coordinates=TABLE_COORDINATES) as opened:
        for chunk in opened.pending():
            opened.write(chunk, table_values(opened.numbers(chunk)))
    return path


def test_other_readers_open_a_store_without_a_warning(store):
    """Any warning is an error in these tests. The labels are those of `open_study`."""
    plain, own = xr.open_zarr(store, chunks=None), open_study(store)
    xr.testing.assert_equal(plain, own)
    assert plain["omega"].dims == ("case", "body_axis")
    assert plain["omega"].sel(case=3, body_axis="y") == 3.2
    assert plain["history_time"].attrs == {"units": "s", "long_name": "time since the start"}
    for one in (plain, own):
        scalars = one[[name for name in one if one[name].dims == ("case",)]]
        assert len(scalars.to_dataframe()) == 10


def test_holes_are_numbered_and_no_rows_of_a_table(tmp_path):
    with made(tmp_path / "s") as opened:
        opened.write(2, values(opened.numbers(2)))
    with xr.open_zarr(tmp_path / "s", chunks=None) as plain:
        np.testing.assert_array_equal(plain["case"], np.arange(10))
        np.testing.assert_array_equal(plain["status"], [0] * 8 + [1] * 2)


def test_a_table_has_a_row_for_every_case_that_is_done(store):
    table = case_table(open_study(store))
    assert table.index.name == "case"
    assert list(table) == [
        "outcome",
        "omega_x_rad_s",
        "omega_y_rad_s",
        "omega_z_rad_s",
        "settling_time_s",
        "w1",
        "w2",
        "drawn_delay_s",
        "drawn_walk_rad_s2_sqrt_Hz",
    ]
    assert list(table["outcome"][:5]) == [
        *("unsettled", "settled", "unsettled", "settled", "state_limit")
    ]
    partly = open_study(store).load()
    partly["status"][4:8] = 0
    assert list(case_table(partly).index) == [0, 1, 2, 3, 8, 9]


def test_a_csv_file_has_all_digits_and_replaces_none_unasked(store, tmp_path, monkeypatch):
    path = tmp_path / "t.csv"
    monkeypatch.setattr("jaxsat.store.tables.ROWS", 3)
    save_case_table(store, path)
    found = pd.read_csv(path, index_col="case")  # older pandas reads all but the last bit
    pd.testing.assert_frame_equal(found, case_table(open_study(store)), rtol=1e-15, atol=0)
    with pytest.raises(OutputError, match=r"already exists; give --overwrite.*--csv"):
        save_case_table(store, path, count=3)
    save_case_table(store, path, count=3, overwrite=True)
    assert len(pd.read_csv(path)) == 3


def test_a_damaged_store_leaves_no_table(store, tmp_path):
    shutil.copytree(store, tmp_path / "s")
    (tmp_path / "s" / "omega" / "c" / "2" / "0").unlink()
    with pytest.raises(OutputError, match="chunk 2"):
        save_case_table(tmp_path / "s", tmp_path / "t.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["s"]


class Killed(BaseException):
    pass


@pytest.mark.slow
def test_killed_at_any_file_a_store_tells_other_readers_nothing_wrong(tmp_path, monkeypatch):
    """While a finished store grows: what is consolidated is what the arrays say, and goes on."""
    with made(tmp_path / "whole") as opened:
        for chunk in opened.pending():
            opened.write(chunk, values(opened.numbers(chunk)))
    plain, left = arrays_module.write_file, [0]
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # what is tested needs no disk

    def killed(*arguments, **options):
        left[0] -= 1
        if left[0] < 0:
            raise Killed
        plain(*arguments, **options)

    consolidated = []
    for kill in range(60):
        path = tmp_path / str(kill)
        shutil.copytree(tmp_path / "whole", path)
        left[0] = kill
        monkeypatch.setattr(arrays_module, "write_file", killed)
        monkeypatch.setattr(arrays_module, "WRITERS", 1)
        ended = True
        try:
            with made(path, count=20) as opened:
                for chunk in opened.pending():
                    opened.write(chunk, values(opened.numbers(chunk)))
        except Killed:
            ended = False
        monkeypatch.setattr(arrays_module, "write_file", plain)
        root = json.loads((path / "zarr.json").read_text())
        consolidated.append("consolidated_metadata" in root)
        if consolidated[-1]:
            for name, told in root["consolidated_metadata"]["metadata"].items():
                assert told == json.loads((path / name / "zarr.json").read_text()), (kill, name)
        with made(path, count=20) as opened:
            for chunk in opened.pending():
                opened.write(chunk, values(opened.numbers(chunk)))
        with xr.open_zarr(path, chunks=None) as found:
            np.testing.assert_array_equal(found["case"], np.arange(20))
            for name, expected in values(np.arange(20)).items():
                np.testing.assert_array_equal(found[name], expected)
        if ended:
            break
    assert ended, "more files than kills"
    assert consolidated[0]
    assert consolidated[-1]
    assert not all(consolidated)


def test_axes_without_names_and_coordinates_that_do_not_fit_are_refused(tmp_path):
    nameless = {"omega": Column((3,), "float64", "1", "the rates")}
    with pytest.raises(ValueError, match="omega must have a name for every axis"):
        StudyStore(tmp_path / "s", IDENTITY, nameless, 1, 1)
    with pytest.raises(ValueError, match="Axis body_axis of column omega must have length 2"):
        StudyStore(
            tmp_path / "s",
            IDENTITY,
            COLUMNS,
            1,
            1,
            coordinates={"body_axis": Coordinate(("x", "y"))},
        )
    assert not (tmp_path / "s").exists()
