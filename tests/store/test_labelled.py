"""Arrays with named axes, against xarray's datasets of the same arrays."""

import numpy as np
import pytest
import xarray as xr

from jaxsat.store.labelled import LabelledArray, LabelledArrays
from jaxsat.store.netcdf import dataset_bytes


@pytest.fixture
def arrays():
    numbers = np.random.default_rng(0).random((5, 2))
    return LabelledArrays(
        {
            "rates": LabelledArray(("time", "axis"), numbers, {"units": "rad s-1"}),
            "levels": LabelledArray(("time", "part"), numbers[:, :1] > 0.5),
            "total": LabelledArray((), np.array(1.5)),
        },
        {
            "time": LabelledArray(("time",), np.arange(5.0)),
            "axis": LabelledArray(("axis",), np.array(["x", "y"])),
        },
        {"title": "Größe", "seed": 3},
    )


def test_a_dataset_of_xarray_has_the_same(arrays):
    dataset = arrays.dataset()
    assert list(dataset.variables) == list(arrays.variables)
    assert list(dataset.sizes.items()) == list(arrays.sizes.items())
    assert dataset.attrs == arrays.attrs
    for name, one in arrays.variables.items():
        assert dataset[name].variable.identical(xr.Variable(*one))
        np.testing.assert_array_equal(arrays[name].values, dataset[name].values)
    assert "axis" in arrays
    assert "part" not in arrays
    with pytest.raises(KeyError):
        arrays["part"]


def test_files_of_both_are_equal(arrays):
    assert dataset_bytes(arrays) == dataset_bytes(arrays.dataset())


@pytest.mark.parametrize("times", [slice(1, 3), np.array([0, 4])])
def test_selection_of_times(arrays, times):
    assert arrays.isel(time=times).dataset().identical(arrays.dataset().isel(time=times))
