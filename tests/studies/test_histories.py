"""Histories of the cases in a study's store: what they hold, and what they leave as it is."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.tolerances import Tolerances, within
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.store.files import OutputError
from jaxsat.store.tables import open_study
from jaxsat.studies.run import run_study
from studies.studies import tumbling

INSTANTS = 8
COUNT = 12


def study(engine=None, history=INSTANTS):
    made = tumbling(COUNT, 5)
    return dataclasses.replace(made, engine=engine or made.engine, history=history)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("histories") / "s.zarr"
    run_study(study(), path)
    return path


@pytest.mark.slow
def test_a_store_has_the_histories_of_all_cases_over_time(stored):
    """The instants are evenly spread and what is there is what the cases have when replayed."""
    dataset = open_study(stored)
    times = dataset["history_time"]
    assert times.dims == ("history_time",)
    assert times.attrs["units"] == "s"
    np.testing.assert_array_equal(times, np.round(np.linspace(0, 20, INSTANTS)))
    assert dataset["history_omega"].dims == ("case", "history_time", "body_axis")
    replay = study().replay(7)
    places = times.values.astype(int)
    for name in ("w", "z", "omega", "relative_rate", "torque"):
        expected = getattr(replay.signals, name)[places]
        np.testing.assert_array_equal(dataset[f"history_{name}"][7], expected)
    late = dataset.sel(case=slice(None), history_time=slice(15, None))
    assert late["history_z"].shape == (COUNT, 2)


@pytest.mark.slow
def test_other_columns_keep_their_bits(stored, tmp_path):
    run_study(study(history=None), tmp_path / "plain.zarr")
    plain, kept = open_study(tmp_path / "plain.zarr"), open_study(stored)
    assert "history_time" not in plain.coords
    assert not [name for name in plain if str(name).startswith("history")]
    for name in plain:
        assert plain[name].values.tobytes() == kept[name].values.tobytes(), name


@pytest.mark.slow
def test_settling_can_be_judged_again_from_a_history(tmp_path):
    """With every instant kept, to the same number."""
    whole = study(history=21)
    run_study(whole, tmp_path / "s.zarr")
    dataset = open_study(tmp_path / "s.zarr")
    limits = Tolerances(0.2, 0.2, 0.1)
    times = dataset["history_time"].values
    for case in range(4):
        one = dataset.isel(case=case)
        names = ("w", "z", "relative_rate")
        signals = (jnp.asarray(one[f"history_{name}"].values) for name in names)
        outside = np.flatnonzero(~np.asarray(within(*signals, limits)))
        found = float(one["settling_time"])
        if len(outside) and outside[-1] == len(times) - 1:
            assert np.isinf(found)
        elif len(outside):
            assert times[outside[-1]] <= found <= times[outside[-1] + 1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine",
    [
        NativeEngine(FixedStepper(substeps=2)),
        pytest.param(ReferenceEngine(batch_size=8), marks=pytest.mark.slow),
        pytest.param(ScanEngine(FixedStepper(substeps=2), 3), marks=pytest.mark.slow),
    ],
    ids=["native", "diffrax", "scan"],
)
def test_engines_agree(stored, engine):
    """On the histories, and each of them on its own bits with and without."""
    one = study(engine)
    numbers = np.arange(COUNT)
    found, dataset = one.values(numbers), open_study(stored)
    for name in dataset:
        if str(name) in found and name != "settling_time":
            np.testing.assert_allclose(found[str(name)], dataset[name], rtol=1e-5, atol=1e-6)
    plain = dataclasses.replace(one, history=None).values(numbers)
    for name, values in plain.items():
        assert found[name].tobytes() == values.tobytes(), name


@pytest.mark.slow
def test_a_store_goes_on_with_its_histories_alone(stored, tmp_path):
    broken = tmp_path / "s.zarr"
    half = study()

    class Enough(Exception):
        pass

    def stop(progress):
        if progress.done >= 5:
            raise Enough

    with pytest.raises(Enough):
        run_study(half, broken, report=stop)
    for other in (None, INSTANTS + 1):
        with pytest.raises(OutputError, match="another study \\(history"):
            run_study(study(history=other), broken)
    run_study(half, broken)
    found, whole = open_study(broken), open_study(stored)
    for name in whole:
        assert found[name].values.tobytes() == whole[name].values.tobytes()
    assert len(json.loads(found.attrs["identity"])["history"]) == INSTANTS


@pytest.mark.parametrize("wrong", [1, 22])
def test_more_instants_than_there_are_are_refused(wrong):
    with pytest.raises(ValueError, match="must have 2 to 21 instants"):
        study(history=wrong)
