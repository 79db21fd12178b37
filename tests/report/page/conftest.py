"""Files of runs, and the page of one that all tests may look at."""

import pytest

# jaxsat is imported in fixtures: pytest reads this file before types are checked.


@pytest.fixture
def run_file(tmp_path):
    """Write a dataset as a run of its own; gives the path."""
    from jaxsat.store.netcdf import dataset_bytes
    from jaxsat.store.resumable import ResumableFolder

    def write(dataset, name="trajectory.nc"):
        with ResumableFolder(tmp_path / "run", "run", {}) as folder:
            folder.write(name, dataset_bytes(dataset))
            return folder.path / name

    return write


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of the run of `run_dataset`."""
    from helpers.pages import run_dataset
    from jaxsat.report.page import report_page
    from jaxsat.store.netcdf import dataset_bytes
    from jaxsat.store.resumable import ResumableFolder

    with ResumableFolder(tmp_path_factory.mktemp("run"), "run", {}) as folder:
        folder.write("trajectory.nc", dataset_bytes(run_dataset()))
    return report_page([folder.path / "trajectory.nc"])
