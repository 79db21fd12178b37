"""The dataset of a run: labels, units, and a round trip through netCDF."""

import jax
import numpy as np
import pytest

from jaxsat.results import open_trajectory, save_dataset, trajectory_dataset
from jaxsat.results.dataset import VARIABLES
from jaxsat.scenario import build, dump, load


@pytest.fixture(scope="module")
def run():
    scenario = load("switching", ["simulation.duration_s=20"])
    return scenario, build(scenario).simulate()


@pytest.fixture(scope="module")
def dataset(run):
    scenario, trajectory = run
    return trajectory_dataset(trajectory, title=scenario.title, scenario=dump(scenario), seed=3)


def test_holds_every_signal(run, dataset):
    _, trajectory = run
    for name in VARIABLES:
        np.testing.assert_array_equal(dataset[name], getattr(trajectory.signals, name))
    assert set(VARIABLES) == set(vars(trajectory.signals))
    assert dataset["quaternion"].dims == ("time", "quaternion_component")
    assert list(dataset["omega"]["body_axis"].values) == ["x", "y", "z"]
    assert dataset["rate_error"].dims == ("time", "driven_axis")
    assert dataset["z"].dims == ("time",)


def test_units_in_attributes(dataset):
    units = {name: dataset[name].attrs["units"] for name in ("time", *VARIABLES)}
    assert units["time"] == "s"
    assert units["omega"] == units["relative_rate"] == units["rate_error"] == "rad s-1"
    assert units["torque"] == units["disturbance"] == "N m"
    assert (units["w"], units["z"], units["quaternion"]) == ("1", "rad", "1")
    assert all(dataset[name].attrs["long_name"] for name in VARIABLES)


def test_says_what_made_it(dataset):
    assert dataset.attrs["outcome"] == "SUCCESS"
    assert dataset.attrs["outcome_code"] == 0
    assert dataset.attrs["seed"] == 3
    assert dataset.attrs["jax_version"] == jax.__version__
    assert dataset.attrs["numpy_version"] == np.__version__
    for name in ("jaxsat", "jaxlib", "diffrax", "equinox", "python"):
        assert dataset.attrs[f"{name}_version"]
    assert dataset.attrs["created"].endswith("+00:00")


def test_netcdf_round_trip(run, dataset, tmp_path):
    scenario, _ = run
    save_dataset(dataset, tmp_path / "trajectory.nc")
    for place in (tmp_path, tmp_path / "trajectory.nc"):
        again = open_trajectory(place)
        assert again.identical(dataset)
    path = tmp_path / "scenario.toml"
    path.write_text(again.attrs["scenario"], encoding="utf-8")
    assert load(path) == scenario


def test_failed_run_is_nan_from_its_end_on():
    scenario = load("paper-three-axis", ["simulation.solver.max_steps=100"])
    found = trajectory_dataset(build(scenario).simulate())
    assert found.attrs["outcome"] == "MAX_STEPS"
    assert np.isnan(found["omega"].values[-1]).all()
    assert np.isfinite(found["omega"].values[0]).all()
