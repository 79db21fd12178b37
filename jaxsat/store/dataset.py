"""Trajectories as labelled arrays, and quantities derived from them."""

import dataclasses
import enum
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import jax
import numpy as np

from jaxsat.control.sampled import mode_label
from jaxsat.core.attitude import SEQUENCE, euler_angles, pointing_error
from jaxsat.core.text import clean
from jaxsat.core.tolerances import Tolerances, within
from jaxsat.simulation.trajectory import Signals, Trajectory
from jaxsat.store.files import OutputError, one_line
from jaxsat.store.labelled import Dataset, LabelledArray, LabelledArrays
from jaxsat.store.labels import (
    ALL_PARTS,
    ATTITUDE_SENSOR,
    AXES,
    DIAGNOSED_PARTS,
    ERRORS,
    PARTS,
    RANGES,
    TOTALS,
    VARIABLES,
    Label,
    attitude_sensor_names,
    part_names,
)
from jaxsat.store.marker import read_unchanged
from jaxsat.store.provenance import provenance_attributes

if TYPE_CHECKING:
    import xarray as xr


def trajectory_dataset(
    trajectory: Trajectory,
    *,
    title: str = "",
    scenario: str = "",
    seed: int | None = None,
    modes: type[enum.IntEnum] | None = None,
) -> "xr.Dataset":
    """Return the history of one run over `time` (s), body axes, with units as attributes.

    `scenario` is the scenario as TOML text. Global attributes hold it with the outcome, the seed
    and `provenance`; `modes` go to the attributes of `mode`. Values after the end of a failed run
    are NaN. `pointing` adds the attitude in degrees. Where the torque changes between the saved
    times, `torque_min`, `torque_max` and `torque_mean` are its range from each to the next. The
    `TOTALS` of the whole run are included.
    """
    return trajectory_arrays(
        trajectory, title=title, scenario=scenario, seed=seed, modes=modes
    ).dataset()


def trajectory_arrays(
    trajectory: Trajectory,
    *,
    title: str = "",
    scenario: str = "",
    seed: int | None = None,
    modes: type[enum.IntEnum] | None = None,
) -> LabelledArrays:
    """Return the arrays of `trajectory_dataset`."""
    signals = trajectory.signals
    variables = {
        **_label_variables(
            vars(signals) | signals.parts, VARIABLES | _labels_of_own_signals(signals), ("time",)
        ),
        **_label_variables(vars(trajectory.assessment), TOTALS, ()),
    }
    axis = diagnosed_axis(signals)
    for name in {"diagnosed_kind", "detection_statistic"} & set(variables):
        one = variables[name]
        variables[name] = one._replace(dims=("time", axis))
    variables |= pointing(np.asarray(signals.quaternion))
    variables |= _ranges(trajectory) | _errors(trajectory)
    if modes is not None:
        mode = variables["mode"]
        flags = {
            "flag_values": np.array(list(modes), float),
            "flag_meanings": " ".join(mode_label(one).replace(" ", "_") for one in modes),
        }
        variables["mode"] = mode._replace(attrs={**mode.attrs, **flags})
    arrays = LabelledArrays(variables, {}, _attributes(trajectory, title, scenario, seed))
    sizes = arrays.sizes
    labels: dict[str, Sequence[str | int]] = {axis: AXES[axis] for axis in sizes if axis in AXES}
    for axis in PARTS:
        if axis in sizes:
            names = part_names(scenario, axis, sizes[axis])
            are_numbers = all(name.isdecimal() for name in names)
            labels[axis] = [int(name) for name in names] if are_numbers else names
    if ATTITUDE_SENSOR in sizes:
        labels[ATTITUDE_SENSOR] = attitude_sensor_names(scenario, sizes[ATTITUDE_SENSOR])
    if ALL_PARTS in sizes:
        kinds = [(kind, variables[name].values.shape[-1]) for kind, name in DIAGNOSED_PARTS.items()]
        labels[ALL_PARTS] = [
            f"{kind} {name}" for kind, count in kinds for name in part_names(scenario, kind, count)
        ]
    clock = Label(("time",), "s", "time since the start")
    coordinates = {"time": clock.array(trajectory.times)}
    coordinates |= {axis: LabelledArray((axis,), np.array(names)) for axis, names in labels.items()}
    return dataclasses.replace(arrays, coords=coordinates)


def _labels_of_own_signals(signals: Signals) -> dict[str, Label]:
    """Return labels of further signals of a user's own law."""
    return {
        name: Label((f"{name}_component",) * (np.ndim(one) - 1), "1", name.replace("_", " "))
        for name, one in signals.parts.items()
        if name not in VARIABLES or np.ndim(one) != 1 + len(VARIABLES[name].dimensions)
    }


def diagnosed_axis(signals: Signals) -> str:
    """Return the kind of actuator that a law diagnoses, or `ALL_PARTS` for thrusters and wheels."""
    kinds, levels = map(signals.parts.get, ("diagnosed_kind", "thrust_level"))
    if levels is None:
        return "wheel"
    both = kinds is not None and kinds.shape[-1] != levels.shape[-1]
    return ALL_PARTS if both else "thruster"


def _ranges(trajectory: Trajectory) -> dict[str, LabelledArray]:
    """Return the range of the torque between saved times; empty if it equals the saved torque."""
    ranges, torque = trajectory.torque_range, np.asarray(trajectory.signals.torque)
    if ranges is None or all(
        np.array_equal(getattr(ranges, name), torque, equal_nan=True) for name in RANGES
    ):
        return {}
    return {
        name: Label(
            ("time", "body_axis"), "N m", f"{what} thruster torque until the next saved time"
        ).array(getattr(ranges, part))
        for part, (name, what) in RANGES.items()
    }


def _errors(trajectory: Trajectory) -> dict[str, LabelledArray]:
    errors = trajectory.integration_error
    if errors is None:
        return {}
    return {name: label.array(getattr(errors, part)) for name, (part, label) in ERRORS.items()}


def errors_of(dataset: Dataset) -> tuple[float | None, float | None]:
    """Return the error estimates of rate (rad/s) and attitude (rad), None where absent."""
    rate, attitude = (float(dataset[name].values) if name in dataset else None for name in ERRORS)
    return rate, attitude


def open_trajectory(path: str | Path) -> "xr.Dataset":
    """Read the dataset of a run whole: `path` is a netCDF file or its folder.

    Raises `OutputError` for a missing file, or one that has changed since jaxsat wrote it.
    """
    path = Path(path)
    file = path / "trajectory.nc" if path.is_dir() else path
    data = read_unchanged(file)
    if data is None:
        if path.is_dir() and not file.exists():
            raise OutputError(f"{path} is no folder of a run: it contains no {file.name}.")
        what = "is no file that can be read" if file.exists() else "does not exist"
        raise OutputError(f"{file} {what}.")
    import xarray as xr  # takes its time, and a single run has no use for it

    try:
        with h5py.File(io.BytesIO(data)) as hdf5:
            dict(hdf5.attrs)  # fails here rather than in h5netcdf, which would not close
        with xr.open_dataset(io.BytesIO(data), engine="h5netcdf", decode_times=False) as dataset:
            return dataset.load()
    except Exception as error:  # damage makes h5py and xarray raise anything
        reason = one_line(error)
    # Not inside the clause: an error that is kept keeps a file of h5py, which then crashes at exit.
    raise OutputError(f"{file} cannot be read as netCDF 4: {reason}.")


def _label_variables(
    values: Mapping[str, Any], labels: Mapping[str, Label], first: tuple[str, ...]
) -> dict[str, LabelledArray]:
    """Return the labelled variables of those `values` that exist."""
    return {
        name: label.array(values[name], first)
        for name, label in labels.items()
        if values.get(name) is not None
    }


def _attributes(
    trajectory: Trajectory, title: str, scenario: str, seed: int | None
) -> dict[str, str | int]:
    outcome = trajectory.outcome
    attributes: dict[str, str | int] = {
        "title": clean(title),
        "scenario": scenario,
        "outcome": outcome.name,
        "outcome_code": int(outcome),
        "outcome_explanation": outcome.explanation,
        "steps": int(trajectory.steps),
    }
    if seed is not None:
        attributes["seed"] = seed
    return attributes | provenance_attributes()


def pointing(quaternion: np.ndarray) -> dict[str, LabelledArray]:
    """Return a trajectory's variables derived from quaternions (times, 4), in degrees."""
    error = pointing_error(quaternion)
    entries = {
        "pointing_error": (error, "body_axis", "pointing error about body axes (rotation vector)"),
        "pointing_error_total": (np.linalg.norm(error, axis=-1), None, "total pointing error"),
        "euler_angle": (euler_angles(quaternion), "euler_axis", f"Euler angles, {SEQUENCE}"),
    }
    return {
        name: Label((axis,) if axis else (), "degree", meaning).array(values, ("time",))
        for name, (values, axis, meaning) in entries.items()
    }


_within = jax.jit(within)


def is_within(dataset: Dataset) -> np.ndarray:
    """Whether attitude and relative rate are within the default tolerances, at each saved time."""
    w, z, rate = (jax.numpy.asarray(dataset[name].values) for name in ("w", "z", "relative_rate"))
    return np.asarray(_within(w, z, rate, Tolerances()))


def time_to_settle(dataset: Dataset) -> float:
    """Return the instant from which all tolerances hold to the end, s; infinite if none.

    The run itself determines it on the integrator's steps, by the tolerances of `simulate`: the
    saved times do not matter.
    """
    return _total(dataset, "settled_from")


def time_at_rest(dataset: Dataset) -> float:
    """Return the instant from which the inertial rates stay within tolerance, in any attitude, s,
    as for a rate law. Infinite if none."""
    return _total(dataset, "at_rest_from")


def _total(dataset: Dataset, name: str) -> float:
    if name not in dataset:
        raise ValueError(
            f"Argument `dataset` must hold {name}, which the run itself records, but got one with "
            f"{', '.join(map(str, dataset.data_vars))}; simulate again."
        )
    return float(dataset[name].values)


MOST_TURN = 2 * np.pi / 3
"""Largest turn (rad) between two records: from half a turn on, its sense is ambiguous."""


def coarseness(dataset: Dataset) -> str:
    """Return a warning where a body turns too far between two saved times; else an empty text.

    The turn is the larger of those by the saved attitudes and by the saved rates.
    """
    if not {"time", "quaternion", "omega"} <= set(dataset.variables) or dataset.sizes["time"] < 2:
        return ""
    times, q = dataset["time"].values, dataset["quaternion"].values
    steps = np.diff(times)
    rates = np.linalg.norm(dataset["omega"].values, axis=1)
    by_rates = np.maximum(rates[1:], rates[:-1]) * steps
    by_attitudes = 2 * np.arccos(np.clip(np.abs(np.sum(q[1:] * q[:-1], axis=1)), 0, 1))
    turns = np.nan_to_num(np.maximum(by_rates, by_attitudes))
    worst = int(np.argmax(turns))
    if turns[worst] <= MOST_TURN:
        return ""
    enough = steps[worst] * MOST_TURN / turns[worst]
    return (
        f"the attitude is saved too coarsely to be interpolated: the body turns by "
        f"{turns[worst] / (2 * np.pi):.3g} of a turn between {times[worst]:g} and "
        f"{times[worst + 1]:g} s; save it at least every {enough:.2g} s "
        "(simulation.save_every_s)"
    )
