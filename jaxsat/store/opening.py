"""The results of a study as a labelled dataset."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from jaxsat.store.chunks import CASE, CASE_COLUMN, STATUS
from jaxsat.store.header import read_header
from jaxsat.store.reading import StudyColumn, study_columns


class _LazyColumn(BackendArray):
    """A column as xarray wants it."""

    def __init__(self, column: StudyColumn):
        self.shape, self.dtype = column.shape, column.dtype
        self._column = column

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        """The values at these places."""
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self._column.__getitem__)


def open_study(path: str | Path) -> xr.Dataset:
    """The results of a study as a dataset over `case`, read when used; `status` is 1 where done.

    The cases reach to the last one that is done. The components of vectors have names, such as `x`,
    `y`, `z` along `body_axis`. Histories, where there are any, are over `history_time` (s) as well.
    The attributes `identity` and `runs` are JSON. `case_table` makes a table of it.
    Raises `OutputError` for what is no store, or one that is damaged, also when values are read.
    """
    header = read_header(Path(path))
    columns = study_columns(path, header)
    variables = {
        name: xr.Variable((CASE, *column.column.dims), _cached(column), column.column.attributes)
        for name, column in columns.items()
    }
    coordinates = {
        name: xr.Variable(name, list(coordinate.values), coordinate.attributes)
        for name, coordinate in header.coordinates.items()
    }
    cases = np.arange(len(columns[STATUS]))
    coordinates[CASE] = xr.Variable(CASE, cases, CASE_COLUMN.attributes)
    told = {"identity": json.dumps(header.identity), "runs": json.dumps(header.runs)}
    return xr.Dataset(variables, coordinates, {"Conventions": "CF-1.11", **told})


def _cached(column: StudyColumn) -> indexing.MemoryCachedArray:
    lazy: Any = indexing.LazilyIndexedArray(_LazyColumn(column))
    return indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazy))
