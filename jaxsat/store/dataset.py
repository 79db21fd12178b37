"""Trajectories as xarray datasets, in memory and as netCDF files."""

import enum
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import xarray as xr

from jaxsat.control.sampled import mode_label
from jaxsat.core.pointing import SEQUENCE, euler_angles, pointing_error
from jaxsat.core.text import clean
from jaxsat.simulation import Assessment, Signals, Trajectory
from jaxsat.store.errors import OutputError, one_line
from jaxsat.store.files import save_file
from jaxsat.store.labels import AXES, PARTS, part_names
from jaxsat.store.marker import read_unchanged
from jaxsat.store.provenance import provenance_attributes


class _Variable(NamedTuple):
    """How one signal is labelled."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str


VARIABLES = {
    "w": _Variable(("w_component",), "1", "tilt relative to the orbit frame (Tsiotras-Longuski)"),
    "z": _Variable((), "rad", "turn about the third axis (Tsiotras-Longuski)"),
    "quaternion": _Variable(
        ("quaternion_component",), "1", "unit quaternion from orbit to body frame, scalar first"
    ),
    "omega": _Variable(("body_axis",), "rad s-1", "inertial angular velocity in body axes"),
    "relative_rate": _Variable(
        ("body_axis",), "rad s-1", "angular velocity relative to the orbit frame in body axes"
    ),
    "torque": _Variable(("body_axis",), "N m", "torque of all actuators in body axes"),
    "disturbance": _Variable(("body_axis",), "N m", "disturbance torque in body axes"),
    "rate_error": _Variable(
        ("driven_axis",), "rad s-1", "angular velocity less the reference of the control law"
    ),
    "lyapunov": _Variable((), "J", "Lyapunov function of the control law"),
    "mode": _Variable((), "1", "part of a switching law or supervisor that is active"),
    "constraint_torque": _Variable(
        (), "N m", "ideal torque about the third axis that holds the third rate"
    ),
    "thrust_level": _Variable(
        ("thruster",), "1", "mean thrust until the next time, over full thrust"
    ),
    "propellant": _Variable((), "kg", "propellant used"),
    "valve_openings": _Variable(("thruster",), "1", "openings of each valve"),
    "diagnosed_kind": _Variable(
        ("thruster",),
        "1",
        "diagnosed failure: -1 none, 0 dead, 1 degraded, 2 stuck on, 3 stuck at, 4 leaking, "
        "5 reversed, 6 friction up, 7 runaway, 8 stopped",
    ),
    "detection_statistic": _Variable(
        ("thruster",), "1", "CUSUM statistic of each actuator over the threshold of an alarm"
    ),
    "alarm": _Variable((), "1", "1 while the cause of an alarm is being isolated"),
    "wheel_momentum": _Variable(("wheel",), "N m s", "wheel momentum relative to the body"),
    "wheel_torque": _Variable(("wheel",), "N m", "wheel torque on the body along its axis"),
    "dipole": _Variable(("magnetorquer",), "A m2", "dipole of each magnetorquer along its axis"),
    "gimbal_angle": _Variable(("gimbal",), "rad", "angle of each gimbal"),
    "gimbal_rate": _Variable(("gimbal",), "rad s-1", "rate of each gimbal"),
    "attitude_estimate_error": _Variable(
        ("body_axis",), "rad", "rotation vector from estimated to true attitude in body axes"
    ),
    "attitude_estimate_3sigma": _Variable(
        ("body_axis",), "rad", "three standard deviations that the estimator claims of the same"
    ),
    "rate_estimate_error": _Variable(
        ("body_axis",), "rad s-1", "angular velocity less the estimated one in body axes"
    ),
    "rate_estimate_3sigma": _Variable(
        ("body_axis",), "rad s-1", "three standard deviations that the estimator claims of the same"
    ),
    "bias_estimate_error": _Variable(
        ("body_axis",), "rad s-1", "gyro bias less the estimated one in body axes"
    ),
    "bias_estimate_3sigma": _Variable(
        ("body_axis",), "rad s-1", "three standard deviations that the estimator claims of the same"
    ),
}
"""Signals, each over `time`; those from `constraint_torque` on only where there is such a torque,
thruster (a two-sided one counts as two), wheel, magnetorquer, gimbal or estimate."""

RANGES = {
    "least": ("torque_min", "least"),
    "largest": ("torque_max", "largest"),
    "mean": ("torque_mean", "mean"),
}
"""Of the torque from each saved time to the next, where that differs from the torque saved."""

TOTALS = {
    "settled_from": _Variable(
        (), "s", "when attitude and relative rate came to stay within the tolerances"
    ),
    "at_rest_from": _Variable((), "s", "when the inertial rate came to stay within its tolerance"),
    "effort": _Variable(("body_axis",), "N m s", "integral of the size of the torque"),
    "constraint_effort": _Variable((), "N m s", "the same of the torque that holds the third rate"),
}
"""Of the whole run, judged on the integrator's steps and not at the saved times."""

ERRORS = {
    "rate_error_estimate": (
        "rate",
        _Variable((), "rad s-1", "error of the rate that the length of the steps leaves"),
    ),
    "attitude_error_estimate": (
        "attitude",
        _Variable((), "rad", "error of the attitude that the length of the steps leaves"),
    ),
}
"""Of equal steps, see `IntegrationError`."""


def trajectory_dataset(
    trajectory: Trajectory,
    *,
    title: str = "",
    scenario: str = "",
    seed: int | None = None,
    modes: type[enum.IntEnum] | None = None,
) -> xr.Dataset:
    """The history of one run over `time` (s), body axes, with units as attributes.

    `scenario` is the scenario as TOML text. Global attributes hold it with the outcome, the seed
    and what `provenance` tells; `modes` go to the attributes of `mode`. Values after the end
    of a failed run are NaN. The attitude is also told in degrees, by `pointing`. Where the torque
    changes between the saved times, `torque_min`, `torque_max` and `torque_mean` tell what it was
    from each to the next. Beside the history stand the `TOTALS` of the whole run.
    """
    found: dict[str, xr.Variable | None]
    found = {
        **_labelled(trajectory.signals, VARIABLES, ("time",)),
        **_labelled(trajectory.assessment, TOTALS, ()),
    }
    if trajectory.signals.thrust_level is None:  # it is the wheels that are diagnosed
        for name, one in found.items():
            found[name] = None if one is None else _along_wheels(one)
    found |= pointing(np.asarray(trajectory.signals.quaternion))
    found |= _ranges(trajectory) | _errors(trajectory)
    variables = {name: variable for name, variable in found.items() if variable is not None}
    if modes is not None:
        variables["mode"].attrs |= {
            "flag_values": np.array(list(modes), float),
            "flag_meanings": " ".join(mode_label(mode).replace(" ", "_") for mode in modes),
        }
    time = xr.Variable(
        "time", np.asarray(trajectory.times), {"units": "s", "long_name": "time since the start"}
    )
    axes = dict.fromkeys(axis for variable in variables.values() for axis in variable.dims)
    labels: dict[Any, Any] = {axis: list(AXES[str(axis)]) for axis in axes if axis in AXES}
    for axis in PARTS:
        if axis in axes:
            sizes = (one.sizes[axis] for one in variables.values() if axis in one.dims)
            names = part_names(scenario, axis, next(sizes))
            labels[axis] = [int(name) for name in names] if _numbered(names) else names
    return xr.Dataset(
        variables,
        coords={"time": time, **labels},
        attrs=_attributes(trajectory, title, scenario, seed),
    )


def _numbered(names: list[str]) -> bool:
    """Whether no part has a name of its own."""
    return all(name.isdecimal() for name in names)


def _along_wheels(variable: xr.Variable) -> xr.Variable:
    """With the axis of thrusters as that of wheels."""
    dims = tuple("wheel" if axis == "thruster" else axis for axis in variable.dims)
    return xr.Variable(dims, variable.values, variable.attrs)


def _ranges(trajectory: Trajectory) -> dict[str, xr.Variable]:
    """The range of the torque, if the saved torque is not all that it was."""
    told, torque = trajectory.torque_range, np.asarray(trajectory.signals.torque)
    if told is None or all(
        np.array_equal(getattr(told, name), torque, equal_nan=True) for name in RANGES
    ):
        return {}
    return {
        name: xr.Variable(
            ("time", "body_axis"),
            np.asarray(getattr(told, part)),
            {"units": "N m", "long_name": f"{what} thruster torque until the next saved time"},
        )
        for part, (name, what) in RANGES.items()
    }


def _errors(trajectory: Trajectory) -> dict[str, xr.Variable]:
    """The error estimate of equal steps."""
    told = trajectory.integration_error
    if told is None:
        return {}
    return {
        name: xr.Variable(
            (),
            np.asarray(getattr(told, part)),
            {"units": label.units, "long_name": label.long_name},
        )
        for name, (part, label) in ERRORS.items()
    }


def dataset_bytes(dataset: xr.Dataset) -> bytes:
    """A dataset as a netCDF 4 file, compressed, its numbers with checksums.

    It is made in memory: HDF5 does not survive a disk that fills up while it writes.
    """
    encoding: dict[Any, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        if variable.ndim:  # HDF5 has filters for arrays alone
            checked = variable.dtype.kind in "biuf"
            compressed = name in dataset.data_vars
            encoding[name] = {"fletcher32": True} if checked else {}
            encoding[name] |= {"zlib": True, "complevel": 4} if compressed else {}
    buffer = io.BytesIO()
    dataset.to_netcdf(buffer, engine="h5netcdf", encoding=encoding)
    return buffer.getvalue()


def save_dataset(dataset: xr.Dataset, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a dataset as netCDF 4, compressed; raises `OutputError`, also for a file that exists.

    `overwrite` replaces a file.
    """
    save_file(path, dataset_bytes(dataset), overwrite=overwrite)


def open_trajectory(path: str | Path) -> xr.Dataset:
    """The dataset of a run, read whole: `path` is a netCDF file or the folder that holds it.

    Raises `OutputError` where there is none, or it is not as jaxsat wrote it to its folder.
    """
    path = Path(path)
    file = path / "trajectory.nc" if path.is_dir() else path
    data = read_unchanged(file)
    if data is None:
        raise OutputError(f"{file} is no file that can be read.")
    try:
        with h5py.File(io.BytesIO(data)):
            pass  # what is no HDF5 at all h5netcdf does not close without complaint
        with xr.open_dataset(io.BytesIO(data), engine="h5netcdf", decode_times=False) as dataset:
            return dataset.load()
    except Exception as error:  # h5py and xarray raise whatever the damage leads to
        raise OutputError(f"{file} cannot be read as netCDF 4: {one_line(error)}.") from error


def _labelled(
    source: Signals | Assessment, labels: Mapping[str, _Variable], first: tuple[str, ...]
) -> dict[str, xr.Variable | None]:
    """What of the source is labelled; None for what it has not."""
    values = {name: getattr(source, name) for name in labels}
    return {
        name: None
        if values[name] is None
        else xr.Variable(
            (*first, *label.dimensions),
            np.asarray(values[name]),
            {"units": label.units, "long_name": label.long_name},
        )
        for name, label in labels.items()
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


def pointing(quaternion: np.ndarray) -> dict[str, xr.Variable]:
    """What a trajectory tells of its quaternions (times, 4) in degrees."""
    error = pointing_error(quaternion)
    entries = {
        "pointing_error": (error, "body_axis", "pointing error about body axes (rotation vector)"),
        "pointing_error_total": (np.linalg.norm(error, axis=-1), None, "total pointing error"),
        "euler_angle": (euler_angles(quaternion), "euler_axis", f"Euler angles, {SEQUENCE}"),
    }
    return {
        name: xr.Variable(
            ("time",) if axis is None else ("time", axis),
            values,
            {"units": "degree", "long_name": meaning},
        )
        for name, (values, axis, meaning) in entries.items()
    }
