"""The files of a study's store in Zarr 3: what they are called, what is in them, how it is checked.

They are written here and not by the zarr library because every file must be whole, checked and on
the disk before the ledger says so; that library, and xarray, read them.
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import google_crc32c
import numpy as np
from numcodecs.zstd import Zstd

from jaxsat.results.files import content_hash

CASE = "case"
METADATA = "zarr.json"
_ZSTD = Zstd(level=0)
_CHECKSUM_BYTES = 4


class Column(NamedTuple):
    """How one result of a case is stored: shape and type of one case's value, and its label."""

    shape: tuple[int, ...]
    dtype: str
    units: str
    long_name: str

    @property
    def fill(self) -> float:
        """What stands for a case that is not done."""
        return np.nan if np.issubdtype(np.dtype(self.dtype), np.floating) else 0.0


STATUS = "status"
STATUS_COLUMN = Column((), "uint8", "1", "1 where the case is done")
DONE = 1
"""The status of a case that is; 0 before."""


def chunk_numbers(chunk: int, size: int, count: int) -> np.ndarray:
    """The cases of one of the chunks of `size` cases, `count` in all."""
    return np.arange(chunk * size, min((chunk + 1) * size, count))


def chunk_file(name: str, column: Column, chunk: int) -> str:
    """Where a column's chunk lies in the store."""
    return "/".join([name, "c", str(chunk), *("0" for _ in column.shape)])


def chunk_hash(name: str, chunk: int, data: bytes) -> str:
    """The hash by which a chunk's file is known, and known to be in its place."""
    return content_hash(data, f"{name}/{chunk}")


def encoded(column: Column, values: np.ndarray, size: int) -> bytes:
    """The file of a chunk of `size` cases; values (cases, ...) of fewer are filled up."""
    whole = np.full((size, *column.shape), column.fill, _stored_type(column))
    whole[: len(values)] = values
    packed = bytes(_ZSTD.encode(whole.tobytes()))
    return packed + google_crc32c.value(packed).to_bytes(_CHECKSUM_BYTES, "little")


def decoded(column: Column, data: bytes, size: int) -> np.ndarray:
    """The values (size, ...) in a chunk's file; raises `ValueError` for what is none."""
    packed, checksum = data[:-_CHECKSUM_BYTES], data[-_CHECKSUM_BYTES:]
    if google_crc32c.value(packed).to_bytes(_CHECKSUM_BYTES, "little") != checksum:
        raise ValueError("the checksum is another one")
    try:
        plain = _ZSTD.decode(packed)
    except RuntimeError as error:
        raise ValueError(str(error)) from error
    values = np.frombuffer(plain, _stored_type(column)).reshape(size, *column.shape)
    return values.astype(column.dtype)


def array_metadata(name: str, column: Column, rows: int, size: int) -> dict[str, Any]:
    """The `zarr.json` of a column with room for `rows` cases."""
    endian = {"configuration": {"endian": "little"}} if np.dtype(column.dtype).itemsize > 1 else {}
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": [rows, *column.shape],
        "data_type": column.dtype,
        "chunk_grid": {
            "name": "regular",
            "configuration": {"chunk_shape": [size, *column.shape]},
        },
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": "NaN" if np.isnan(column.fill) else 0,
        "codecs": [
            {"name": "bytes", **endian},
            {"name": "zstd", "configuration": {"level": 0, "checksum": False}},
            {"name": "crc32c"},
        ],
        "attributes": {"units": column.units, "long_name": column.long_name},
        "dimension_names": [CASE, *(f"{name}_{axis}" for axis in range(len(column.shape)))],
        "storage_transformers": [],
    }


def differs_in_rows_alone(found: Any, wanted: Mapping[str, Any]) -> bool:
    """Whether array metadata is that of the same array with room for more or fewer cases."""
    shape = found.get("shape") if isinstance(found, dict) else None
    if not isinstance(shape, list) or not shape or not isinstance(shape[0], int):
        return False
    return found == {**wanted, "shape": [shape[0], *wanted["shape"][1:]]}


def group_metadata(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """The `zarr.json` of the store itself."""
    return {"zarr_format": 3, "node_type": "group", "attributes": dict(attributes)}


def as_json(data: Any) -> bytes:
    """Plain data as it stands in a `zarr.json`."""
    return (json.dumps(data, indent=1) + "\n").encode()


def _stored_type(column: Column) -> np.dtype:
    return np.dtype(column.dtype).newbyteorder("<")
