"""The dataset of a run: labels, units, and a round trip through netCDF."""

import dataclasses
import io
import random

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from corruption import KINDS
from jaxsat.scenario import dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.store.dataset import open_trajectory, time_to_settle, trajectory_dataset
from jaxsat.store.files import OutputError, save_file
from jaxsat.store.folder import OutputFolder
from jaxsat.store.labels import TOTALS, VARIABLES
from jaxsat.store.netcdf import dataset_bytes


@pytest.fixture(scope="module")
def built():
    scenario = load("switching", ["simulation.duration_s=20"])
    return scenario, build(scenario)


@pytest.fixture(scope="module")
def run(built):
    scenario, closed_loop = built
    return scenario, closed_loop.simulate()


@pytest.fixture(scope="module")
def dataset(run):
    scenario, trajectory = run
    return trajectory_dataset(trajectory, title=scenario.title, scenario=dump(scenario), seed=3)


def test_holds_every_signal(run, dataset):
    _, trajectory = run
    for name in VARIABLES:
        values = (vars(trajectory.signals) | trajectory.signals.parts).get(name)
        if values is None:  # no held rate, thrusters that push, wheels or sensors with a state
            assert name not in dataset
        else:
            np.testing.assert_array_equal(dataset[name], values)
    assert set(vars(trajectory.signals)) - {"torque_range", "parts"} <= set(VARIABLES)
    assert set(TOTALS) == set(vars(trajectory.assessment))
    assert "constraint_effort" not in dataset
    np.testing.assert_array_equal(dataset["effort"], trajectory.assessment.effort)
    assert dataset["quaternion"].dims == ("time", "quaternion_component")
    assert list(dataset["omega"]["body_axis"].values) == ["x", "y", "z"]
    assert dataset["rate_error"].dims == ("time", "driven_axis")
    assert dataset["z"].dims == ("time",)


def test_a_users_law_may_tell_a_number_by_the_name_of_a_signal_of_many(run):
    _, trajectory = run
    number = np.arange(len(trajectory.signals.mode), dtype=float)
    parts = trajectory.signals.parts | {"innovation": number}
    signals = dataclasses.replace(trajectory.signals, parts=parts)
    dataset = trajectory_dataset(dataclasses.replace(trajectory, signals=signals))
    assert dataset["innovation"].dims == ("time",)
    np.testing.assert_array_equal(dataset["innovation"], number)


def test_parts_have_the_names_of_the_scenario(run):
    trajectory = run[1]
    count = len(trajectory.times)
    sizes = {"wheel_momentum": 2, "dipole": 1, "thrust_level": 3, "own_number": 2}
    parts = {name: jnp.zeros((count, size)) for name, size in sizes.items()}
    signals = trajectory.signals.with_parts(parts)
    text = """
    wheel = [{name = "rw-x"}, {}]
    magnetorquer = [{}, {failed = true}]
    thruster = [{name = "dead", failed = true}, {name = "both", two_sided = true}, {}]
    """
    text = "\n".join(line.strip() for line in text.splitlines())
    found = trajectory_dataset(dataclasses.replace(trajectory, signals=signals), scenario=text)
    assert list(found["wheel"].values) == ["rw-x", "2"]
    assert list(found["thruster"].values) == ["both+", "both-", "3"]
    assert list(found["magnetorquer"].values) == [1]
    assert found["own_number"].dims == ("time", "own_number_component")
    again = xr.open_dataset(io.BytesIO(dataset_bytes(found)), engine="h5netcdf", decode_times=False)
    assert list(again["thruster"].values) == ["both+", "both-", "3"]


def test_modes_have_names_in_attributes(built, run, dataset):
    """CF conventions: `flag_values` and one word for each in `flag_meanings`."""
    modes = trajectory_dataset(run[1], modes=built[1].modes)["mode"]
    assert modes.attrs["flag_values"].tolist() == [0.0, 1.0]
    assert modes.attrs["flag_meanings"] == "three-axis_law rate_law"
    assert "flag_values" not in dataset["mode"].attrs  # nobody told it any


def test_units_in_attributes(dataset):
    units = {name: dataset[name].attrs["units"] for name in ("time", *dataset.data_vars)}
    assert (units["settled_from"], units["effort"]) == ("s", "N m s")
    assert units["time"] == "s"
    assert units["omega"] == units["relative_rate"] == units["rate_error"] == "rad s-1"
    assert units["torque"] == units["disturbance"] == "N m"
    assert (units["w"], units["z"], units["quaternion"]) == ("1", "rad", "1")
    assert all(dataset[name].attrs["long_name"] for name in dataset.data_vars)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_held_third_rate_is_told_apart(tmp_path):
    held = build(load("paper-three-axis", ["simulation.duration_s=5"])).simulate()
    found = trajectory_dataset(held)
    assert found["constraint_torque"].attrs["units"] == "N m"
    assert found["constraint_effort"].attrs["units"] == "N m s"
    save_file(tmp_path / "trajectory.nc", dataset_bytes(found))
    assert open_trajectory(tmp_path).identical(found)


def test_a_dataset_that_does_not_tell_is_refused(dataset):
    with pytest.raises(ValueError, match="simulate again"):
        time_to_settle(dataset.drop_vars("settled_from"))


def test_says_what_made_it(dataset):
    assert dataset.attrs["outcome"] == "SUCCESS"
    assert dataset.attrs["outcome_code"] == 0
    assert dataset.attrs["seed"] == 3
    assert dataset.attrs["jax_version"] == jax.__version__
    assert dataset.attrs["numpy_version"] == np.__version__
    for name in ("jaxsat", "jaxlib", "diffrax", "equinox", "python"):
        assert dataset.attrs[f"{name}_version"]
    assert dataset.attrs["created"].endswith("+00:00")


@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_netcdf_round_trip(run, dataset, tmp_path):
    scenario, _ = run
    save_file(tmp_path / "trajectory.nc", dataset_bytes(dataset))
    for place in (tmp_path, tmp_path / "trajectory.nc"):
        again = open_trajectory(place)
        assert again.identical(dataset)
    with pytest.raises(OutputError, match="already exists"):
        save_file(tmp_path / "trajectory.nc", dataset_bytes(dataset))
    path = tmp_path / "scenario.toml"
    path.write_text(again.attrs["scenario"], encoding="utf-8")
    assert load(path) == scenario


def small():
    numbers = np.random.default_rng(0).random((200, 3))
    return xr.Dataset({"x": (("time", "axis"), numbers)}, {"time": np.arange(200.0)})


@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_a_damaged_trajectory_is_never_taken_for_a_good_one(tmp_path):
    """In jaxsat's own folder nothing passes; of a file alone the numbers are checked."""
    with OutputFolder(tmp_path / "run") as folder:
        folder.write("trajectory.nc", dataset_bytes(small()))
    good = (tmp_path / "run" / "trajectory.nc").read_bytes()
    alone = tmp_path / "alone"
    alone.mkdir()
    told = 0
    for seed in range(60):
        (tmp_path / "run" / "trajectory.nc").write_bytes(good)
        (alone / "trajectory.nc").write_bytes(good)
        kinds = ("flip", "truncate", "extend", "zero", "empty")
        for place in (tmp_path / "run", alone):
            rng = random.Random(seed)
            KINDS[rng.choice(kinds)](place, "trajectory.nc", rng)
        damaged = (tmp_path / "run" / "trajectory.nc").read_bytes() != good
        if damaged:
            with pytest.raises(OutputError, match="was damaged, or changed"):
                open_trajectory(tmp_path / "run")
        try:
            found = open_trajectory(alone)
            for name in set(found.variables) & set(small().variables):
                np.testing.assert_array_equal(found[name], small()[name])
        except OutputError as error:
            assert len(str(error).splitlines()) == 1  # noqa: PT017 -- some are read
            told += 1
    assert told > 20
    (tmp_path / "folder" / "trajectory.nc").mkdir(parents=True)
    for place, what in (
        (tmp_path / "nowhere", "nowhere does not exist"),
        (tmp_path, "is no folder of a run: it contains no trajectory.nc"),
        (tmp_path / "folder", "is no file that can be read"),
    ):
        with pytest.raises(OutputError, match=what):
            open_trajectory(place)


@pytest.mark.slow
def test_failed_run_is_nan_from_its_end_on():
    scenario = load("paper-three-axis", ["simulation.solver.max_steps=100"])
    found = trajectory_dataset(build(scenario).simulate())
    assert found.attrs["outcome"] == "MAX_STEPS"
    assert np.isnan(found["omega"].values[-1]).all()
    assert np.isfinite(found["omega"].values[0]).all()
