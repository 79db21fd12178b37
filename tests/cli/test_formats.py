"""Runs and studies for MATLAB, Parquet and CSV, read back by programs that are not ours."""

import csv
import io
import sys

import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr

from helpers.pages import run_dataset
from jaxsat.cli.conversion import (
    KEYWORDS,
    FormatError,
    csv_file,
    matlab_file,
    matlab_names,
    parquet_file,
    table,
)
from jaxsat.store.chunks import Column, Coordinate
from jaxsat.store.folder import OutputFolder
from jaxsat.store.netcdf import dataset_bytes
from jaxsat.store.store import StudyStore
from jaxsat.store.tables import case_table, open_study
from store.stores import IDENTITY


@pytest.fixture
def run():
    """A run with names of thrusters, a NaN, an infinity, and a title of many alphabets."""
    dataset = run_dataset(title="Größe ω², 衛星 🛰").assign_coords(
        thruster=["up+", "lower left"], body_axis=["x", "y", "z"]
    )
    dataset["omega"][3, 1] = np.nan
    dataset["settled_from"] = xr.Variable((), np.inf, {"units": "s"})
    dataset.attrs["drawn_gain"] = np.array([0.5, 1 / 3])
    return dataset


@pytest.fixture
def study(tmp_path):
    """A study of five cases, of which the last is not done; one failed."""
    columns = {
        "code": Column((), "int8", "1", "how it ended", (), ("success", "state limit")),
        "settling_time": Column((), "float64", "s", "settling time"),
        "propellant": Column((2,), "float64", "kg", "used", ("thruster",)),
        "history_z": Column((3,), "float64", "rad", "turn", ("history_time",)),
    }
    coordinates = {
        "thruster": Coordinate(("lower left", "top")),
        "history_time": Coordinate((0.0, 1.5, 3.0), "s"),
    }
    store = StudyStore(tmp_path / "mine.zarr", IDENTITY, columns, 5, 4, coordinates=coordinates)
    with store as opened:
        numbers = opened.numbers(0)
        values = {
            "code": np.where(numbers == 2, 1, 0),
            "settling_time": np.where(numbers % 2, numbers / 3, np.inf),
            "propellant": numbers[:, None] + np.array([0.1, np.nan]),
            "history_z": numbers[:, None] * np.array([1.0, 0.1, -1e-300]),
        }
        opened.write(0, values)
    return tmp_path / "mine.zarr", values


def of_matlab(content):
    return scipy.io.loadmat(io.BytesIO(content), simplify_cells=True)


def test_matlab_has_every_array_of_a_run_to_the_last_bit_with_its_units(run):
    found = of_matlab(matlab_file(run))
    for name, variable in run.variables.items():
        np.testing.assert_array_equal(found[name], np.squeeze(variable.values), err_msg=name)
        told = found["variables"][name]
        assert told["units"] == variable.attrs.get("units", "1")
        assert list(np.atleast_1d(told["dimensions"])) == list(variable.dims)
    assert list(found["thruster"]) == ["up+", "lower left"]
    assert found["variables"]["thrust_level"]["long_name"] == "mean thrust"
    about = found["about"]
    assert about["title"] == run.attrs["title"]
    assert about["scenario"] == run.attrs["scenario"]
    np.testing.assert_array_equal(about["drawn_gain"], run.attrs["drawn_gain"])


def test_histories_are_columns_in_matlab(run):
    found = scipy.io.loadmat(io.BytesIO(matlab_file(run)))
    assert found["time"].shape == (101, 1)
    assert found["omega"].shape == (101, 3)
    assert found["wheel_momentum"].shape == (101, 1)
    assert found["settled_from"].shape == (1, 1)


def test_matlab_has_the_completed_cases_of_a_study(study):
    path, values = study
    found = of_matlab(matlab_file(open_study(path)))
    for name, expected in values.items():
        np.testing.assert_array_equal(found[name], expected)
    np.testing.assert_array_equal(found["case_"], np.arange(4))
    assert list(found["thruster"]) == ["lower left", "top"]
    assert found["variables"]["code"]["flag_meanings"] == "success state_limit"
    assert list(found["variables"]["propellant"]["dimensions"]) == ["case_", "thruster"]
    assert found["variables"]["propellant"]["units"] == "kg"


def test_names_are_valid_in_matlab_and_differ():
    given = ["omega", "_hidden", "größe", "gr_ße", "2nd", "a b", "a_b", "x" * 70, "x" * 71]
    found = matlab_names([*given, "about", *sorted(KEYWORDS)], reserved=["about"])
    assert found["omega"] == "omega"
    assert (found["case"], found["2nd"], found["about"]) == ("case_", "x2nd", "about_2")
    assert len(set(found.values())) == len(found)
    for name in found.values():
        assert name.isascii()
        assert name.isidentifier()
        assert not name.startswith("_")
        assert len(name) <= 63
        assert name not in KEYWORDS


def test_matlab_cannot_hold_an_array_of_gigabytes(run, monkeypatch):
    def too_large(*_, **__):
        raise scipy.io.matlab.MatWriteError("Matrix too large to save with Matlab 5 format")

    monkeypatch.setattr("scipy.io.savemat", too_large)
    with pytest.raises(FormatError, match="less than 4 GB for MATLAB: Matrix too large"):
        matlab_file(run)


def rows_of(content):
    return list(csv.DictReader(io.StringIO(content.decode())))


def test_a_table_of_signals_is_read_back_to_the_last_bit(run):
    rows = rows_of(csv_file(run))
    columns = {"time_s": run["time"], "omega_y_rad_s": run["omega"].values[:, 1]}
    columns["thrust_level_lower left"] = run["thrust_level"].values[:, 1]
    for name, expected in columns.items():
        found = [float(row[name] or "nan") for row in rows]
        np.testing.assert_array_equal(found, expected)


def test_a_table_of_cases_is_that_of_a_study(study):
    path, values = study
    rows = rows_of(csv_file(open_study(path)))
    assert [row["case"] for row in rows] == ["0", "1", "2", "3"]
    assert [row["outcome"] for row in rows] == ["unsettled", "settled", "state_limit", "settled"]
    found = [float(row["propellant_lower left_kg"]) for row in rows]
    np.testing.assert_array_equal(found, values["propellant"][:, 0])


def test_parquet_has_the_signals_of_a_run_and_their_units(run):
    pytest.importorskip("pyarrow")
    found = pd.read_parquet(io.BytesIO(parquet_file(run)))
    pd.testing.assert_frame_equal(found, table(run), check_exact=True)
    np.testing.assert_array_equal(found["omega_y_rad_s"], run["omega"].values[:, 1])
    assert found.attrs["title"] == run.attrs["title"]
    assert found.attrs["drawn_gain"] == [0.5, 1 / 3]
    units = found.attrs["units"]
    assert set(units) == set(found)
    assert (units["time_s"], units["omega_x_rad_s"], units["w_0"]) == ("s", "rad s-1", "1")


def test_parquet_has_the_completed_cases_of_a_study(study):
    pytest.importorskip("pyarrow")
    path, values = study
    found = pd.read_parquet(io.BytesIO(parquet_file(open_study(path))))
    pd.testing.assert_frame_equal(found, case_table(open_study(path)), check_exact=True)
    np.testing.assert_array_equal(found["propellant_lower left_kg"], values["propellant"][:, 0])
    assert found.attrs["units"]["propellant_top_kg"] == "kg"


@pytest.mark.parametrize("to", ["csv", "mat"])
def test_runs_and_studies_are_written_beside_them(command_line, study, run, tmp_path, to):
    with OutputFolder(tmp_path / "v1.2") as folder:
        folder.write("trajectory.nc", dataset_bytes(run_dataset()))
    for source, target in (("v1.2", f"v1.2.{to}"), ("mine.zarr", f"mine.{to}")):
        assert command_line("convert", source, "--to", to) == (0, f"written to {target}\n", "")
        assert (tmp_path / target).stat().st_size > 1000 or to == "csv"


def test_parquet_without_pyarrow_is_told(command_line, study, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    status, _, err = command_line("convert", "mine.zarr", "--to", "parquet")
    assert status == 2
    assert "--to parquet: must have pyarrow; pip install 'jaxsat[parquet]'" in err
    assert not (tmp_path / "mine.parquet").exists()
