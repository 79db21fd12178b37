"""Files of datasets, against those that xarray writes by h5netcdf."""

import io

import h5py
import numpy as np
import pytest
import xarray as xr

from jaxsat.store.netcdf import dataset_bytes


@pytest.fixture
def dataset():
    """All kinds of values that results have, along dimensions with and without coordinates."""
    numbers = np.random.default_rng(0).random((200, 2))
    numbers[3] = np.nan
    return xr.Dataset(
        {
            "floats": (("time", "axis"), numbers, {"units": "1", "flags": [1.0, 2.0]}),
            "single": ("time", numbers[:, 0].astype(np.float32)),
            "counts": (("axis", "part"), np.arange(6).reshape(2, 3)),
            "decisions": ("part", [True, False, True]),
            "texts": ("axis", ["größer", ""]),
            "objects": ("part", np.array(["r", "long", ""], object)),
            "empty": ("nothing", np.zeros(0)),
            "total": ((), 1.5),
            "number": ((), 4),
            "word": ((), "settled"),
        },
        {"time": np.arange(200.0), "axis": ["x", "y"], "label": ("axis", ["one", "two"])},
        {"title": "Größe", "empty": "", "seed": 3, "share": 0.5, "names": ["a", "b"]},
    )


def read(content):
    return xr.open_dataset(io.BytesIO(content), engine="h5netcdf").load()


def test_a_file_reads_as_one_of_xarray(dataset):
    buffer = io.BytesIO()
    packed = {"zlib": True, "complevel": 4, "fletcher32": True}
    encoding = {"floats": packed, "counts": packed, "time": {"fletcher32": True}}
    dataset.to_netcdf(buffer, engine="h5netcdf", encoding=encoding)
    expected, found = read(buffer.getvalue()), read(dataset_bytes(dataset))
    assert found.identical(expected)
    assert found.drop_vars("label").identical(dataset.drop_vars("label"))
    assert list(found.variables) == list(expected.variables)
    assert {name: type(one) for name, one in found.attrs.items()} == {
        name: type(one) for name, one in expected.attrs.items()
    }
    for name, variable in expected.variables.items():
        assert found[name].dtype == variable.dtype
        if name in (*encoding, "label", "total"):
            kept, own = (dict(one.encoding) for one in (variable, found[name]))
            assert str(own | {"source": ""}) == str(kept | {"source": ""})


def test_equal_datasets_give_equal_files(dataset):
    assert dataset_bytes(dataset) == dataset_bytes(dataset.copy(deep=True))


def test_dimensions_of_netcdf(dataset):
    """In the order of the dataset; one without coordinates is a scale that is no variable."""
    with h5py.File(io.BytesIO(dataset_bytes(dataset))) as file:
        numbers = [int(file[axis].attrs["_Netcdf4Dimid"]) for axis in dataset.sizes]
        assert numbers == list(range(len(dataset.sizes)))
        assert file["counts"].dims[1][0] == file["part"]
        size = f"{dataset.sizes['part']:10d}".encode()
        meaning = b"This is a netCDF dimension but not a netCDF variable." + size
        assert file["part"].attrs["NAME"] == meaning


def test_a_slash_in_a_name_is_refused():
    with pytest.raises(ValueError, match="no slash, but got 'a/b'"):
        dataset_bytes(xr.Dataset({"a/b": ("x", [1.0])}))
