"""Conversion of a trajectory to a CCSDS attitude ephemeris, and of datasets to other formats."""

import datetime
import io
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial.transform import Rotation

import jaxsat
from jaxsat.compiler.c.naming import ascii_text
from jaxsat.core.earth import epoch_of
from jaxsat.core.errors import JaxsatError
from jaxsat.core.text import clean
from jaxsat.scenario.build.plant import place_of
from jaxsat.scenario.parts.orbit import OrbitTable
from jaxsat.store.chunks import CASE
from jaxsat.store.tables import case_table, columns_of, completed_cases

FRAMES = {"inertial": "EME2000", "orbit": "LVLH"}
"""Names of the reference frames in an attitude ephemeris."""

BODY = "SC_BODY_1"
MAX_NAME = 80


FIRST_INSTANT, LAST_INSTANT = np.datetime64("1972-01-01", "s"), np.datetime64("9999-12-31T23:59:59")
"""First and last instant of UTC with seconds of one length and four-digit years."""

LEAP_DAYS = (
    *("1972-06-30", "1972-12-31", "1973-12-31", "1974-12-31", "1975-12-31", "1976-12-31"),
    *("1977-12-31", "1978-12-31", "1979-12-31", "1981-06-30", "1982-06-30", "1983-06-30"),
    *("1985-06-30", "1987-12-31", "1989-12-31", "1990-12-31", "1992-06-30", "1993-06-30"),
    *("1994-06-30", "1995-12-31", "1997-06-30", "1998-12-31", "2005-12-31", "2008-12-31"),
    *("2012-06-30", "2015-06-30", "2016-12-31"),
)
"""All known days that ended with a leap second (IERS Bulletin C)."""


class ConversionError(JaxsatError, ValueError):
    """A trajectory that cannot be written in a format."""


def attitude_ephemeris(
    dataset: xr.Dataset,
    epoch: np.datetime64,
    *,
    frame: str = "inertial",
    object_name: str = "",
    object_id: str = "UNKNOWN",
) -> str:
    """Return the attitude of a run as a CCSDS attitude ephemeris message (AEM 1.0, CCSDS 504.0-B).

    `epoch` is UTC at the start of the run, from 1972 on. The quaternions turn the reference frame
    into body axes, scalar part last. `frame` is "inertial", x to the equinox and z to the north
    pole (called EME2000), from the angles of the scenario's orbit, or "orbit", x along the velocity
    and z to the Earth's centre (called LVLH). Times after the end of a failed run are left out.
    Text is printable ASCII: a title is transliterated. Raises `ConversionError` for a dataset
    without attitude, for names of other characters, for the orbit frame of an ellipse, and for
    times before 1972, after 9999 or across a leap second, which no count of seconds represents.
    """
    if "quaternion" not in dataset:
        raise ConversionError("there is no attitude in it")
    good = np.isfinite(dataset["quaternion"].values).all(axis=1)
    seconds = dataset["time"].values[good]
    turns = Rotation.from_quat(np.roll(dataset["quaternion"].values[good], -1, axis=1))
    if frame == "inertial":
        turns = _orbit_frame(dataset, seconds) * turns
    elif _orbit_table(dataset).ellipse() is not None:
        raise ConversionError("its orbit is an ellipse; take the frame inertial")
    times = _instants(epoch, seconds)
    for label in (object_name, object_id):
        if not (label.isascii() and label.isprintable()):
            raise ConversionError(f"a name in it must be printable ASCII, got {clean(label)}")
    title = ascii_text(clean(str(dataset.attrs.get("title", ""))))
    name = clean(object_name or title, MAX_NAME - 3).replace("…", "...") or "UNKNOWN"
    created = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%S")
    lines = [
        "CCSDS_AEM_VERS = 1.0",
        f"CREATION_DATE = {created}",
        f"ORIGINATOR = JAXSAT {jaxsat.__version__}",
        "",
        "META_START",
        f"OBJECT_NAME = {name}",
        f"OBJECT_ID = {clean(object_id, MAX_NAME - 3).replace('…', '...')}",
        "CENTER_NAME = EARTH",
        f"REF_FRAME_A = {FRAMES[frame]}",
        f"REF_FRAME_B = {BODY}",
        "ATTITUDE_DIR = A2B",
        "TIME_SYSTEM = UTC",
        f"START_TIME = {times[0]}",
        f"STOP_TIME = {times[-1]}",
        "ATTITUDE_TYPE = QUATERNION",
        "QUATERNION_TYPE = LAST",
        "META_STOP",
        "",
        "DATA_START",
    ]
    for time, quaternion in zip(times, _nearest_signs(turns.as_quat()), strict=True):
        lines.append(f"{time} {' '.join(f'{part:.15f}' for part in quaternion)}")
    return "\n".join([*lines, "DATA_STOP", ""])


def epoch_of_run(dataset: xr.Dataset) -> np.datetime64 | None:
    """Return UTC at the start of a run, None if its scenario has no epoch."""
    orbit = tomllib.loads(str(dataset.attrs.get("scenario", ""))).get("orbit", {})
    return epoch_of(orbit["epoch"]) if "epoch" in orbit else None


def _instants(epoch: np.datetime64, seconds: np.ndarray) -> np.ndarray:
    """Return UTC at these times of a run, as text to the nanosecond; raises `ConversionError`."""
    begin = epoch.astype("datetime64[s]")
    fraction = (epoch - begin).astype("timedelta64[ns]").astype(int)
    whole = np.floor(seconds)
    nanoseconds = fraction + np.rint(1e9 * (seconds - whole)).astype(np.int64)
    instants = begin + (whole.astype(np.int64) + nanoseconds // 10**9).astype("timedelta64[s]")
    first, last = instants.min(), instants.max()
    if first < FIRST_INSTANT or last > LAST_INSTANT:
        raise ConversionError(f"its times in UTC must lie in 1972 to 9999, got {first} to {last}")
    for day in LEAP_DAYS:
        following = np.datetime64(day, "s") + np.timedelta64(1, "D")
        if first < following <= last:
            raise ConversionError(
                f"its times must not pass a leap second, got that at the end of {day}; take "
                "another epoch"
            )
    texts = np.datetime_as_string(instants, unit="s")
    return np.array([f"{text}.{n % 10**9:09d}" for text, n in zip(texts, nanoseconds, strict=True)])


def _nearest_signs(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions of signs nearest to their predecessors, for interpolation by a reader."""
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0
    return quaternions * np.cumprod(np.concatenate([[1], np.where(flips, -1, 1)]))[:, None]


def _orbit_table(dataset: xr.Dataset) -> OrbitTable:
    """Return `[orbit]` of a run's scenario, empty where it has none."""
    tables = tomllib.loads(str(dataset.attrs.get("scenario", "")))
    return OrbitTable.model_validate(tables.get("orbit", {}))


def _orbit_frame(dataset: xr.Dataset, seconds: np.ndarray) -> Rotation:
    """Return the rotations from the inertial to the orbit frame at some times (s)."""
    import jax
    import jax.numpy as jnp

    tables = tomllib.loads(str(dataset.attrs.get("scenario", "")))
    if "orbit" not in tables:
        raise ConversionError("its scenario has no [orbit]; take the frame orbit")
    orbit = place_of(_orbit_table(dataset))
    axes = np.asarray(jax.vmap(orbit.axes)(jnp.asarray(seconds)))
    return Rotation.from_matrix(np.swapaxes(axes, 1, 2))


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
    names = matlab_names(map(str, dataset.variables), reserved=(ABOUT, VARIABLES))
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


def matlab_names(names: Iterable[str], reserved: Iterable[str] = ()) -> dict[str, str]:
    """Return a valid and different name of MATLAB for each name; none is `reserved`."""
    used, valid = set(reserved), {}
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
