"""Runs and studies as files of other programs: CSV, MATLAB and Parquet."""

import io
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from jaxsat.core.errors import JaxsatError
from jaxsat.store.chunks import CASE
from jaxsat.store.tables import case_table, columns_of, completed_cases

LONGEST_NAME = 63
"""MATLAB's `namelengthmax`."""

KEYWORDS = frozenset((
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function",
    "global", "if", "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
))  # fmt: skip
"""Words that MATLAB's `iskeyword` lists: no names of variables or fields."""

ABOUT, VARIABLES = "about", "variables"
"""Structures of a MATLAB file: attributes of all, and attributes and dimensions of each array."""


class FormatError(JaxsatError, ValueError):
    """A dataset that a format cannot hold."""


def csv_file(dataset: xr.Dataset) -> bytes:
    """Return the `table` as CSV with all digits; NaN is an empty cell."""
    return table(dataset).to_csv(index=CASE in dataset.dims, lineterminator="\n").encode()


def parquet_file(dataset: xr.Dataset) -> bytes:
    """Return the `table` as Parquet; its attributes are those of the dataset, and `units`.

    `pandas.read_parquet` returns them in `attrs`. Raises `ImportError` without pyarrow.
    """
    frame = table(dataset)
    units = {
        column: str(variable.attrs.get("units", "1"))
        for name, variable in dataset.data_vars.items()
        if 1 <= variable.ndim <= 2
        for column in columns_of(str(name), variable[:0])
        if column in frame
    }
    frame.attrs = {name: np.asarray(one).tolist() for name, one in dataset.attrs.items()}
    frame.attrs["units"] = ({"time_s": "s"} if "time_s" in frame else {}) | units
    content = frame.to_parquet(engine="pyarrow")
    assert content is not None  # there is no path
    return content


def matlab_file(dataset: xr.Dataset) -> bytes:
    """Return all arrays as a MATLAB file (version 5), by names that MATLAB takes.

    Vectors over time are columns; names of thrusters, wheels and components are cells of texts. The
    structure `variables` has for each array its dimensions and attributes, such as `units`; `about`
    has the attributes of the dataset. Of a study only completed cases are in it. Raises
    `FormatError` for an array of more than 4 GB, which the format excludes.
    """
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    if CASE in dataset.dims:
        dataset = completed_cases(dataset)
    names = matlab_names(map(str, dataset.variables), taken=(ABOUT, VARIABLES))
    content: dict[str, Any] = {ABOUT: _structure(dataset.attrs), VARIABLES: {}}
    for name, variable in dataset.variables.items():
        values = variable.values
        texts = values.dtype.kind in "OUST"
        content[names[str(name)]] = values.astype(object) if texts else values
        dimensions = np.array([names.get(str(axis), str(axis)) for axis in variable.dims], object)
        described = _structure({"units": "1", **variable.attrs})
        content[VARIABLES][names[str(name)]] = {**described, "dimensions": dimensions}
    buffer = io.BytesIO()
    try:
        savemat(buffer, content, long_field_names=True, do_compression=True, oned_as="column")
    except MatWriteError as error:
        raise FormatError(f"must have arrays of less than 4 GB for MATLAB: {error}") from error
    return buffer.getvalue()


FORMATS: Mapping[str, Callable[[xr.Dataset], bytes]] = {
    "csv": csv_file,
    "mat": matlab_file,
    "parquet": parquet_file,
}
"""The file of a run's or a study's dataset, by the ending of its name."""


def table(dataset: xr.Dataset) -> pd.DataFrame:
    """Return a row for each saved time of a run, or for each completed case of a study.

    Vectors have a column for each component, and units are part of the columns' names.
    """
    if CASE in dataset.dims:
        return case_table(dataset)
    columns = {"time_s": dataset["time"].values}
    for name, variable in dataset.data_vars.items():
        if variable.dims[:1] == ("time",) and variable.ndim <= 2:
            columns |= columns_of(str(name), variable)
    return pd.DataFrame(columns)


def matlab_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Return a valid and different name of MATLAB for each name; none of them is `taken`."""
    used, valid = set(taken), {}
    for name in names:
        word = re.sub(r"\W", "_", name, flags=re.ASCII)
        word = word if word[:1].isalpha() else f"x{word}"
        word = (f"{word}_" if word in KEYWORDS else word)[:LONGEST_NAME]
        number = 1
        while word in used:
            number += 1
            word = f"{word[: LONGEST_NAME - 1 - len(str(number))]}_{number}"
        used.add(word)
        valid[name] = word
    return valid


def _structure(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Return attributes with names for the fields of a structure."""
    names = matlab_names(map(str, attributes))
    return {names[str(name)]: value for name, value in attributes.items()}
