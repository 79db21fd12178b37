"""Labelled arrays as netCDF 4 files, written by h5py with the conventions of xarray.

xarray and h5netcdf are slow to import, and look up each variable and dimension dozens of times,
which takes most of the time that they need to write a file.
"""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np

from jaxsat.store.labelled import Dataset

COMPRESSION = 4
"""Level of zlib, as in netCDF's own programs."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.{size:>10}"
"""Name of the netCDF 4 scale of a dimension without coordinates."""


def dataset_bytes(dataset: Dataset) -> bytes:
    """Return a dataset as a netCDF 4 file, compressed, with checksums of its numbers.

    The file is made in memory: HDF5 does not survive a disk that fills up during writing. Raises
    `ValueError` for names with a slash, which would be groups of the file.
    """
    slashed = [name for name in (*dataset.variables, *dataset.sizes) if "/" in str(name)]
    if slashed:
        raise ValueError(f"Names in a netCDF file must have no slash, but got {slashed[0]!r}.")
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        versions = f"version=2,h5py={h5py.version.version},hdf5={h5py.version.hdf5_version}"
        file.attrs["_NCProperties"] = np.bytes_(versions)
        _write_attributes(file, dataset.attrs)
        written = {}
        for name, variable in dataset.variables.items():
            is_data = name in dataset.data_vars
            attributes = dict(variable.attrs)
            if is_data:
                attributes |= _coordinates(dataset, variable.dims)
            written[name] = _write(file, str(name), variable.values, attributes, is_data)
        scales = {}
        for number, (axis, size) in enumerate(dataset.sizes.items()):
            scales[axis] = _scale(file, str(axis), size, written.get(axis))
            scales[axis].attrs["_Netcdf4Dimid"] = np.int32(number)
        for name, variable in dataset.variables.items():
            if name not in scales:
                for place, axis in enumerate(variable.dims):
                    written[name].dims[place].attach_scale(scales[axis])
    return buffer.getvalue()


def _coordinates(dataset: Dataset, axes: Sequence[Any]) -> dict[str, str]:
    """Return the attribute of a variable along `axes` with its coordinates that are no axes."""
    names = sorted(
        str(name)
        for name, one in dataset.coords.items()
        if name not in dataset.sizes and set(one.dims) <= set(axes)
    )
    return {"coordinates": " ".join(names)} if names else {}


def _write(
    file: h5py.File, name: str, values: np.ndarray, attributes: dict[str, Any], is_data: bool
) -> h5py.Dataset:
    """Write a variable, encoded by the CF conventions, to the file; data are compressed."""
    filters: dict[str, Any] = {}
    if values.dtype.kind == "b":
        values, attributes["dtype"] = values.astype(np.int8), "bool"
    elif values.dtype.kind == "f":
        attributes["_FillValue"] = values.dtype.type(np.nan)
    if values.dtype.kind in "UO":
        values = values.astype(h5py.string_dtype())
    elif values.ndim:  # HDF5 has filters for arrays alone, and checksums for numbers
        filters["fletcher32"] = True
    if values.ndim and is_data:
        filters |= {"compression": "gzip", "compression_opts": COMPRESSION}
    filters["fillvalue"] = attributes.get("_FillValue")
    one = file.create_dataset(name, data=values, track_order=True, **filters)
    _write_attributes(one, attributes)
    return one


def _scale(file: h5py.File, axis: str, size: int, coordinates: h5py.Dataset | None) -> h5py.Dataset:
    """Return the HDF5 scale of a dimension: its coordinates, or a dataset without a value."""
    if coordinates is not None:
        coordinates.make_scale(axis)
        return coordinates
    one = file.create_dataset(axis, (size,), ">f4", track_order=True)
    one.make_scale(NO_VARIABLE.format(size=size))
    return one


def _write_attributes(target: h5py.File | h5py.Dataset, attributes: Mapping[Any, Any]) -> None:
    """Write attributes; single numbers as arrays of one, as netCDF's own programs do."""
    for name, value in attributes.items():
        is_number = np.isscalar(value) and not isinstance(value, str)
        target.attrs[name] = np.atleast_1d(value) if is_number else value
