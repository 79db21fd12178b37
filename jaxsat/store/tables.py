"""A study as a labelled dataset, and as a table: one row a case, one column a number."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from jaxsat.core.declaration.units import shown_unit, with_unit
from jaxsat.simulation.trajectory import Outcome
from jaxsat.store.chunks import CASE, CASE_COLUMN, DONE, STATUS
from jaxsat.store.files import save_file
from jaxsat.store.header import read_header
from jaxsat.store.labels import SETTLED, UNSETTLED, flags_of
from jaxsat.store.ledger import StudyColumn, study_columns


class _LazyColumn(BackendArray):
    """A column in the interface of xarray."""

    def __init__(self, column: StudyColumn):
        self.shape, self.dtype = column.shape, column.dtype
        self._column = column

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        """Return the values at these places."""
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self._column.__getitem__)


def open_study(path: str | Path) -> xr.Dataset:
    """Return the results of a study as a dataset over `case`, read when used; `status` 1 is done.

    Cases extend to the last completed one. The components of vectors have names, such as `x`, `y`,
    `z` along `body_axis`. Histories, if any, are also over `history_time` (s). The attributes
    `identity` and `runs` are JSON. `case_table` returns a table of the dataset.

    Raises `OutputError` for an invalid or damaged store, also when values are read.
    """
    header = read_header(Path(path))
    columns = study_columns(path, header)
    variables = {
        name: xr.Variable(
            (CASE, *column.column.dims), _lazy_array(column), column.column.attributes
        )
        for name, column in columns.items()
    }
    coordinates = {
        name: xr.Variable(name, list(coordinate.values), coordinate.attributes)
        for name, coordinate in header.coordinates.items()
    }
    cases = np.arange(len(columns[STATUS]))
    coordinates[CASE] = xr.Variable(CASE, cases, CASE_COLUMN.attributes)
    records = {"identity": json.dumps(header.identity), "runs": json.dumps(header.runs)}
    return xr.Dataset(variables, coordinates, {"Conventions": "CF-1.11", **records})


def _lazy_array(column: StudyColumn) -> indexing.MemoryCachedArray:
    lazy: Any = indexing.LazilyIndexedArray(_LazyColumn(column))
    return indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazy))


ROWS = 10_000
"""Number of rows of a table that are converted to text at once."""


def case_table(study: xr.Dataset) -> pd.DataFrame:
    """Return the completed cases of a study, one row each, indexed by `case`.

    `study` is the dataset of `open_study`, or of `xarray.open_zarr`. Vectors have a column for
    each component, names end with the unit, as in `omega_x_rad_s`, and `outcome` is a text:
    "settled", "unsettled", or the name of the failure. Drawn values come last, as `drawn_...`.
    Histories are left out, and codes are replaced by their meanings.
    """
    cases = completed_cases(study[[one for one in study.data_vars if not _is_history(study[one])]])
    columns: dict[str, np.ndarray] = {}
    for name in sorted(map(str, cases), key=lambda name: (name.startswith("drawn_"), name)):
        variable = cases[name]
        if name == "code":
            columns["outcome"] = _outcomes(variable.values, cases["settling_time"].values)
        elif name != STATUS:
            columns |= _case_columns(name, variable)
    return pd.DataFrame(columns, index=pd.Index(cases[CASE].values, name=CASE))


def completed_cases(study: xr.Dataset) -> xr.Dataset:
    """Return the completed cases of a study, read into memory."""
    return study.isel({CASE: np.flatnonzero(np.asarray(study[STATUS]) == DONE)}).load()


def save_case_table(
    store: str | Path, path: str | Path, *, count: int | None = None, overwrite: bool = False
) -> None:
    """Write the `case_table` of a store, of its first `count` cases, as CSV, whole or not at all.

    Numbers have all their digits, and NaN is left empty. Raises `OutputError`, also
    for a file that exists unless `overwrite` replaces it.
    """
    study = open_study(store)
    size = study.sizes[CASE] if count is None else min(count, study.sizes[CASE])

    def lines() -> Iterator[bytes]:
        for first in range(0, size, ROWS):
            part = case_table(study.isel({CASE: slice(first, min(first + ROWS, size))}))
            yield part.to_csv(header=first == 0, lineterminator="\n").encode()

    save_file(path, lines(), overwrite=overwrite, option="--csv")


def _outcomes(code: np.ndarray, settling_time: np.ndarray) -> np.ndarray:
    names = {int(one): one.name.lower() for one in Outcome} | {int(Outcome.SUCCESS): UNSETTLED}
    outcomes = np.array([names[int(one)] for one in code], object)
    outcomes[np.isfinite(settling_time)] = SETTLED
    return outcomes


def _is_history(variable: xr.DataArray) -> bool:
    return any(variable[axis].dtype.kind == "f" for axis in variable.dims)


def _case_columns(name: str, variable: xr.DataArray) -> dict[str, np.ndarray]:
    """Return the columns of a variable over the cases, its flags as texts."""
    flags = flags_of(variable)
    if flags:
        variable = variable.copy(data=np.array(flags, object)[variable.values.astype(int)])
    return columns_of(name, variable)


def columns_of(name: str, variable: xr.DataArray) -> dict[str, np.ndarray]:
    """Return the columns of a variable over cases or times, by their names with units."""
    unit = shown_unit(str(variable.attrs.get("units", "1"))).replace("°", "deg")
    suffix = with_unit("", unit or "1")
    if variable.ndim == 1:
        return {f"{name}{suffix}": variable.values}
    labels = [str(label) for label in variable[variable.dims[1]].values]
    return {
        f"{name if label.startswith(name) else f'{name}_'}{label.removeprefix(name)}{suffix}": part
        for label, part in zip(labels, variable.values.T, strict=True)
    }
