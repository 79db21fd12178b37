"""Files of a study's store in Zarr 3: names, contents and checksums.

They are written here and not by the zarr library because every file must be whole, checked and on
disk before the ledger records it; that library, and xarray, read them.
"""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import google_crc32c
import numpy as np

from jaxsat.store.files import content_hash

CASE = "case"
METADATA = "zarr.json"
_CHECKSUM_BYTES = 4


class Column(NamedTuple):
    """Storage of one result of a case: shape and type of one case's value, and its label.

    `dims` are the names of the axes of `shape`; columns share an axis by its name. `flags` of a
    column of codes are the meanings of the codes from 0 on.
    """

    shape: tuple[int, ...]
    dtype: str
    units: str
    long_name: str
    dims: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()

    @property
    def attributes(self) -> dict[str, Any]:
        """Units and name; for codes their meanings, by the CF conventions."""
        attributes: dict[str, Any] = {"units": self.units, "long_name": self.long_name}
        if self.flags:
            attributes["flag_values"] = list(range(len(self.flags)))
            attributes["flag_meanings"] = " ".join(flag.replace(" ", "_") for flag in self.flags)
        return attributes

    @property
    def fill(self) -> float:
        """Fill value of a case that is not done."""
        return np.nan if np.issubdtype(np.dtype(self.dtype), np.floating) else 0.0


class Coordinate(NamedTuple):
    """Labels of an axis that columns share: texts, or numbers with units."""

    values: tuple[str, ...] | tuple[float, ...]
    units: str = "1"
    long_name: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """Units and name, without empty ones."""
        attributes = {"units": self.units if self.units != "1" else "", "long_name": self.long_name}
        return {name: text for name, text in attributes.items() if text}


STATUS = "status"
STATUS_COLUMN = Column((), "uint8", "1", "1 where the case is done")
DONE = 1
"""Status of a completed case; 0 before."""

CASE_COLUMN = Column((), "int64", "1", "number of the case")
"""Coordinate along the cases, with chunks like a column's."""


def chunk_numbers(chunk: int, size: int, count: int) -> np.ndarray:
    """Return the cases of one of the chunks of `size` cases, `count` in all."""
    return np.arange(chunk * size, min((chunk + 1) * size, count))


def chunk_file(name: str, column: Column, chunk: int) -> str:
    """Return the path of a column's chunk in the store."""
    return "/".join([name, "c", str(chunk), *("0" for _ in column.shape)])


def chunk_hash(name: str, chunk: int, data: bytes) -> str:
    """Return the hash that identifies a chunk's file and its place."""
    return content_hash(data, f"{name}/{chunk}")


def encoded(column: Column, values: np.ndarray, size: int) -> bytes:
    """Return the file of a chunk of `size` cases; fewer values (cases, ...) are padded."""
    whole = np.full((size, *column.shape), column.fill, _stored_type(column))
    whole[: len(values)] = values
    return _compress(whole.tobytes())


def _compress(plain: bytes) -> bytes:
    from numcodecs.zstd import Zstd  # as below

    compressed = bytes(Zstd(level=0).encode(plain))
    return compressed + google_crc32c.value(compressed).to_bytes(_CHECKSUM_BYTES, "little")


def decoded(column: Column, data: bytes, size: int) -> np.ndarray:
    """Return the values (size, ...) in a chunk's file; raises `ValueError` for an invalid one."""
    from numcodecs.zstd import Zstd  # slow, and most commands write no store

    compressed, checksum = data[:-_CHECKSUM_BYTES], data[-_CHECKSUM_BYTES:]
    if google_crc32c.value(compressed).to_bytes(_CHECKSUM_BYTES, "little") != checksum:
        raise ValueError("the checksum is another one")
    try:
        plain = Zstd().decode(compressed)
    except RuntimeError as error:
        raise ValueError(str(error)) from error
    values = np.frombuffer(plain, _stored_type(column)).reshape(size, *column.shape)
    return values.astype(column.dtype)


def array_metadata(column: Column, rows: int, size: int) -> dict[str, Any]:
    """Return the `zarr.json` of a column with room for `rows` cases."""
    return _array_metadata(
        [rows, *column.shape],
        column.dtype,
        "NaN" if np.isnan(column.fill) else 0,
        [size, *column.shape],
        [CASE, *column.dims],
        column.attributes,
    )


def coordinate_files(name: str, coordinate: Coordinate) -> dict[str, bytes]:
    """Return the files of a coordinate's array: its `zarr.json` and one chunk."""
    from numcodecs.vlen import VLenUTF8  # as above

    texts = isinstance(coordinate.values[0], str)
    count = len(coordinate.values)
    values = np.array(coordinate.values, object if texts else "<f8")
    plain = bytes(VLenUTF8().encode(values)) if texts else values.tobytes()
    metadata = _array_metadata(
        [count],
        "string" if texts else "float64",
        "" if texts else "NaN",
        [count],
        [name],
        coordinate.attributes,
    )
    return {f"{name}/{METADATA}": as_json(metadata), f"{name}/c/0": _compress(plain)}


def _array_metadata(
    shape: list[int],
    data_type: str,
    fill: Any,
    chunk_shape: list[int],
    dimensions: list[str],
    attributes: Mapping[str, Any],
) -> dict[str, Any]:
    serializer: dict[str, Any] = {"name": "vlen-utf8" if data_type == "string" else "bytes"}
    if data_type != "string" and np.dtype(data_type).itemsize > 1:
        serializer["configuration"] = {"endian": "little"}
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": data_type,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk_shape}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": fill,
        "codecs": [
            serializer,
            {"name": "zstd", "configuration": {"level": 0, "checksum": False}},
            {"name": "crc32c"},
        ],
        "attributes": dict(attributes),
        "dimension_names": dimensions,
        "storage_transformers": [],
    }


def differs_in_rows_alone(metadata: Any, model: Mapping[str, Any]) -> bool:
    """Whether array metadata differ from `model` at most in the number of rows."""
    shape = metadata.get("shape") if isinstance(metadata, dict) else None
    if not isinstance(shape, list) or not shape or not isinstance(shape[0], int):
        return False
    return metadata == {**model, "shape": [shape[0], *model["shape"][1:]]}


def group_metadata(
    attributes: Mapping[str, Any], arrays: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the store's own `zarr.json`, with the metadata of its `arrays` if given."""
    group = {"zarr_format": 3, "node_type": "group", "attributes": dict(attributes)}
    if arrays is None:
        return group
    inline = {"kind": "inline", "must_understand": False, "metadata": dict(arrays)}
    return {**group, "consolidated_metadata": inline}


def as_json(data: Any) -> bytes:
    """Return plain data in the form of a `zarr.json`."""
    return (json.dumps(data, indent=1) + "\n").encode()


def _stored_type(column: Column) -> np.dtype:
    return np.dtype(column.dtype).newbyteorder("<")
