"""Trajectories as xarray datasets, in memory and as netCDF files."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from jaxsat.results.provenance import provenance_attributes
from jaxsat.simulation import Trajectory
from jaxsat.text import clean


class _Variable(NamedTuple):
    """How one signal is labelled."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str


COORDINATES = {
    "body_axis": ("x", "y", "z"),
    "driven_axis": ("x", "y"),
    "w_component": ("w1", "w2"),
    "quaternion_component": ("q0", "q1", "q2", "q3"),
}
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
    "torque": _Variable(("body_axis",), "N m", "thruster torque in body axes"),
    "disturbance": _Variable(("body_axis",), "N m", "disturbance torque in body axes"),
    "rate_error": _Variable(
        ("driven_axis",), "rad s-1", "angular velocity less the reference of the control law"
    ),
    "lyapunov": _Variable((), "J", "Lyapunov function of the control law"),
    "mode": _Variable((), "1", "part of a switching law or supervisor that is active"),
}


def trajectory_dataset(
    trajectory: Trajectory,
    *,
    title: str = "",
    scenario: str = "",
    seed: int | None = None,
    mode_names: Mapping[int, str] | None = None,
) -> xr.Dataset:
    """The history of one run over `time` (s), body axes, with units as attributes.

    `scenario` is the scenario as TOML text. Global attributes hold it with the outcome, the seed
    and what `provenance` tells; `mode_names` go to the attributes of `mode`. Values after the end
    of a failed run are NaN.
    """
    variables = {
        name: xr.Variable(
            ("time", *label.dimensions),
            np.asarray(getattr(trajectory.signals, name)),
            {"units": label.units, "long_name": label.long_name},
        )
        for name, label in VARIABLES.items()
    }
    if mode_names:
        variables["mode"].attrs |= {
            "flag_values": np.array(list(mode_names), float),
            "flag_meanings": " ".join(name.replace(" ", "_") for name in mode_names.values()),
        }
    time = xr.Variable(
        "time", np.asarray(trajectory.times), {"units": "s", "long_name": "time since the start"}
    )
    labels = {name: list(entries) for name, entries in COORDINATES.items()}
    return xr.Dataset(
        variables,
        coords={"time": time, **labels},
        attrs=_attributes(trajectory, title, scenario, seed),
    )


def save_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as netCDF 4, compressed."""
    encoding = {name: {"zlib": True, "complevel": 4} for name in dataset.data_vars}
    dataset.to_netcdf(path, engine="h5netcdf", encoding=encoding)


def open_trajectory(path: str | Path) -> xr.Dataset:
    """The dataset of a run, read whole: `path` is a netCDF file or the folder that holds it."""
    path = Path(path)
    file = path / "trajectory.nc" if path.is_dir() else path
    with xr.open_dataset(file, engine="h5netcdf", decode_times=False) as dataset:
        return dataset.load()


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
