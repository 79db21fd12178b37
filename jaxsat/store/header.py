"""Header of a store: study, machines and columns; and differences between identities."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxsat.store.chunks import (
    CASE,
    CASE_COLUMN,
    METADATA,
    STATUS,
    STATUS_COLUMN,
    Column,
    Coordinate,
    array_metadata,
    as_json,
    coordinate_files,
    group_metadata,
)
from jaxsat.store.files import OutputError, content_hash, parse_json, partial_name, read_or_explain
from jaxsat.store.provenance import provenance

FORMAT = 4


class Header(NamedTuple):
    """Attributes of a store: `identity` and `runs` are plain data, `chunk` is in cases."""

    identity: Mapping[str, Any]
    runs: list[dict[str, Any]]
    columns: dict[str, Column]
    coordinates: dict[str, Coordinate]
    chunk: int

    @property
    def tag(self) -> str:
        """Hash that identifies this study's ledger."""
        return _hash({"identity": self.identity, **self.layout()})

    @property
    def partial(self) -> str:
        """Name of this study's files during writing."""
        return partial_name(self.tag)

    @property
    def arrays(self) -> dict[str, Column]:
        """All arrays with a chunk for every chunk of cases."""
        return {**self.columns, STATUS: STATUS_COLUMN, CASE: CASE_COLUMN}

    def metadata(self, rows: int) -> dict[str, Any]:
        """Return the metadata of `arrays` with room for `rows` cases."""
        return {
            name: array_metadata(column, rows, self.chunk) for name, column in self.arrays.items()
        }

    def coordinate_files(self) -> dict[str, bytes]:
        """Return the files of the columns' coordinates, the same for any number of cases."""
        files: dict[str, bytes] = {}
        for name, coordinate in self.coordinates.items():
            files |= coordinate_files(name, coordinate)
        return files

    def content(self, rows: int | None = None) -> bytes:
        """Return the store's own `zarr.json`; with `rows` it includes the metadata of all arrays.

        Such consolidated metadata are valid only while the arrays have `rows` rows.
        """
        study = {"identity": self.identity, "runs": self.runs, **self.layout()}
        attributes = {"Conventions": "CF-1.11", "jaxsat_format": FORMAT, **study}
        return as_json(self._group({**attributes, "check": _hash(attributes)}, rows))

    def layout(self) -> dict[str, Any]:
        """Return columns, their coordinates and the size of a chunk, as plain data."""
        columns = {name: list(column) for name, column in self.columns.items()}
        coordinates = {name: list(entry) for name, entry in self.coordinates.items()}
        return {"chunk": self.chunk, "columns": columns, "coordinates": coordinates}

    def is_group(self, data: Any, attributes: Mapping[str, Any]) -> bool:
        """Whether `data` is a `zarr.json` of the store with these attributes."""
        return data == self._group(attributes, _consolidated_rows(data))

    def _group(self, attributes: Mapping[str, Any], rows: int | None) -> dict[str, Any]:
        if rows is None:
            return group_metadata(attributes)
        files = self.coordinate_files()
        fixed = {name: parse_json(files[f"{name}/{METADATA}"]) for name in self.coordinates}
        return group_metadata(attributes, dict(sorted({**self.metadata(rows), **fixed}.items())))


def _consolidated_rows(data: Any) -> int | None:
    """Return the number of rows in consolidated metadata; None without them."""
    try:
        rows = data["consolidated_metadata"]["metadata"][STATUS]["shape"][0]
    except (KeyError, TypeError, IndexError):
        return None
    return rows if isinstance(rows, int) else None


def run_record(here: Mapping[str, Any], remark: str | None) -> dict[str, Any]:
    """Return the record of a run: its machine, versions and time, and an optional remark."""
    remarks = {} if remark is None else {"remark": remark}
    return {"machine": dict(here), **provenance(), **remarks}


def read_header(path: Path) -> Header:
    """Read the header of the store in a folder; raises `OutputError` for an invalid one."""
    content = read_or_explain(path / METADATA)
    none = OutputError(f"{path} is no store of jaxsat; give another folder.")
    if content is None:
        raise none
    damage = OutputError(
        f"{path / METADATA} is damaged, or not jaxsat's: the study in the store cannot be "
        "identified; restore a copy of the file, or give another folder."
    )
    data = parse_json(content)
    attributes = data.get("attributes") if isinstance(data, dict) else None
    if not isinstance(attributes, dict):
        raise damage
    if "jaxsat_format" not in attributes:
        raise none
    if attributes["jaxsat_format"] != FORMAT:
        raise OutputError(
            f"{path} is a store of another version of jaxsat (format "
            f"{attributes['jaxsat_format']}, not {FORMAT}), which this one neither reads nor "
            "continues; give another folder. "
            "xarray.open_zarr(path, consolidated=False) reads what is in it."
        )
    check = attributes.pop("check", None)
    if check != _hash(attributes):
        raise damage
    try:
        columns = {name: _column(entry) for name, entry in attributes["columns"].items()}
        coordinates = {
            name: Coordinate(tuple(values), *label)
            for name, (values, *label) in attributes["coordinates"].items()
        }
        header = Header(
            attributes["identity"], attributes["runs"], columns, coordinates, attributes["chunk"]
        )
        sound = _is_sound(header) and header.is_group(data, attributes)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        raise damage from None
    if not sound:
        raise damage
    return header


def _is_sound(header: Header) -> bool:
    return (
        isinstance(header.identity, dict)
        and isinstance(header.runs, list)
        and bool(header.runs)
        and all(isinstance(run, dict) and "machine" in run for run in header.runs)
        and isinstance(header.chunk, int)
        and header.chunk >= 1
    )


def _column(entry: list[Any]) -> Column:
    shape, dtype, units, long_name, dims, *flags = entry
    np.dtype(dtype)  # raises TypeError for an invalid type
    return Column(tuple(shape), dtype, units, long_name, tuple(dims), *map(tuple, flags))


def _hash(data: Any) -> str:
    return content_hash(json.dumps(data, sort_keys=True).encode())


MOST_DIFFERENCES = 6
"""Largest number of reported differences between two studies."""

PROGRAM = "program"
"""Part of an identity without keys of the scenario, reported last."""

NUMBERS = "numbers"
"""Part of a program without names; reported only if nothing named differs."""

OPERATIONS = "operations"
"""Part of a program that is a hash of its operations, reported only without other differences."""

OTHER_PROGRAM = "the program differs, as after a change of the law, of another part or of a library"


def differences(old: Any, new: Any) -> list[str]:
    """Return clauses on the differences between two nested data, one a place; the first few."""
    places = sorted(
        _differences(old, new), key=lambda place: (place[0][:1] == (PROGRAM,), place[0])
    )
    named_places = [one for one in places if (one[0][0], one[0][-1]) != (PROGRAM, OPERATIONS)]
    no_numbers = [one for one in named_places if one[0][0] != PROGRAM or NUMBERS not in one[0][1:]]
    named_places = no_numbers or named_places
    clauses = [
        f"{'.'.join(path)}: {_short(x)} there, {_short(y)} here" for path, x, y in named_places
    ]
    if places and not named_places:
        clauses = [OTHER_PROGRAM]
    more = len(clauses) - MOST_DIFFERENCES
    return [*clauses[:MOST_DIFFERENCES], f"and {more} more"] if more > 0 else clauses


def _differences(old: Any, new: Any, *path: str) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Yield path, old and new value of every difference."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in sorted(set(old) | set(new)):
            yield from _differences(old.get(key), new.get(key), *path, key)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (x, y) in enumerate(zip(old, new, strict=True), 1):
            yield from _differences(x, y, *path, str(number))
    elif old != new and (old == old or new == new):  # NaN equals NaN
        yield path, old, new


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "…"
