"""Files of runs, and the page of one that all tests may look at."""

import pytest

from helpers.pages import run_dataset
from jaxsat.report.page import report_page
from jaxsat.store.netcdf import dataset_bytes


@pytest.fixture
def run_file(tmp_path):
    """Write a dataset as a run of its own; gives the path."""

    def write(dataset, name="trajectory.nc"):
        path = tmp_path / name
        path.write_bytes(dataset_bytes(dataset))
        return path

    return write


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of the run of `run_dataset`."""
    path = tmp_path_factory.mktemp("run") / "trajectory.nc"
    path.write_bytes(dataset_bytes(run_dataset()))
    return report_page([path])
