"""What a store says of itself: which study, on which machines, with which columns."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxsat.results.chunks import METADATA, Column, as_json, group_metadata
from jaxsat.results.errors import OutputError
from jaxsat.results.files import content_hash, parse_json, read_or_explain
from jaxsat.results.provenance import provenance

FORMAT = 2


class Header(NamedTuple):
    """The attributes of a store: `identity` and `runs` are plain data, `chunk` is in cases."""

    identity: Mapping[str, Any]
    runs: list[dict[str, Any]]
    columns: dict[str, Column]
    chunk: int

    @property
    def tag(self) -> str:
        """What the ledger of this study is known by."""
        return _hash({"identity": self.identity, **self._layout()})

    def content(self) -> bytes:
        """The store's own `zarr.json`."""
        told = {"identity": self.identity, "runs": self.runs, **self._layout()}
        kept = {"Conventions": "CF-1.11", "jaxsat_format": FORMAT, **told}
        return as_json(group_metadata({**kept, "check": _hash(kept)}))

    def _layout(self) -> dict[str, Any]:
        columns = {name: list(column) for name, column in self.columns.items()}
        return {"chunk": self.chunk, "columns": columns}


def run_record(here: Mapping[str, Any], remark: str | None) -> dict[str, Any]:
    """What is kept of a run: its machine, versions and time, and a remark if there is one."""
    told = {} if remark is None else {"remark": remark}
    return {"machine": dict(here), **provenance(), **told}


def read_header(path: Path) -> Header:
    """The header of the store in a folder; raises `OutputError` for one that is none."""
    content = read_or_explain(path / METADATA)
    none = OutputError(f"{path} is no store of jaxsat; give another folder.")
    if content is None:
        raise none
    damaged = OutputError(
        f"{path / METADATA} is damaged, or not jaxsat's: what study the store holds cannot be "
        "told; put a copy of the file back, or give another folder."
    )
    data = parse_json(content)
    kept = data.get("attributes") if isinstance(data, dict) else None
    if not isinstance(kept, dict):
        raise damaged
    if "jaxsat_format" not in kept:
        raise none
    if kept["jaxsat_format"] != FORMAT:
        raise OutputError(
            f"{path} is a store of another version of jaxsat (format {kept['jaxsat_format']}, not "
            f"{FORMAT}), which this one neither reads nor continues; give another folder."
        )
    check = kept.pop("check", None)
    if check != _hash(kept) or data != group_metadata(kept):
        raise damaged
    try:
        columns = {name: _column(entry) for name, entry in kept["columns"].items()}
        header = Header(kept["identity"], kept["runs"], columns, kept["chunk"])
    except (KeyError, TypeError, ValueError, AttributeError):
        raise damaged from None
    if not _is_sound(header):
        raise damaged
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
    shape, dtype, units, long_name = entry
    np.dtype(dtype)  # which raises a TypeError for what is none
    return Column(tuple(shape), dtype, units, long_name)


def _hash(data: Any) -> str:
    return content_hash(json.dumps(data, sort_keys=True).encode())
