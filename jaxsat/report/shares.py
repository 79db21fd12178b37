"""Torque by kind of actuator, and momentum by external torques."""

import math
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.text import number_text
from jaxsat.report.facts import scenario_tables
from jaxsat.report.plot import TIME, Axis, Line, Plot
from jaxsat.scenario.build.plant import field_of
from jaxsat.scenario.parts.orbit import OrbitTable
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION
from jaxsat.store.labelled import Dataset

WHEEL, ROD = "wheel", "magnetorquer"


def shares_of(dataset: Dataset) -> dict[str, Float[np.ndarray, "n 3"]] | None:
    """Return the torque on the body (N m, body axes) over time by kind of actuator, or None.

    None where one kind makes it all, or signals that separate kinds are missing. Under a sampled
    law it is the mean until the next saved time, so that no pulse is left out. For magnetorquers
    beside thrusters it is such a mean until one fires; then, and beside gyros, it is the value at
    the saved time, by the scenario's axes. Thrusters and gyros together are one kind.
    """
    tables = scenario_tables(dataset)
    kinds = [one for one in ACTUATORS if tables.get(one.name) and one.name != WHEEL]
    others = [f"{one.called}s" for one in kinds if one.name != ROD]
    if tables.get("spacecraft", {}).get("thruster_torque_axes"):
        others.insert(0, "thrusters")
    signals = {"wheel_torque": tables.get(WHEEL), "dipole": others and tables.get(ROD)}
    if any(needed and name not in dataset for name, needed in signals.items()):
        return None
    torques, rest = {}, dataset["torque_mean" if _is_held(dataset) else "torque"].values
    if tables.get(WHEEL):
        torques["wheels"] = _of_wheels(dataset, tables[WHEEL]) @ _axes(tables[WHEEL])
        rest = rest - torques["wheels"]
    fires = others != ["thrusters"] or _fires(dataset)[:, None]
    if tables.get(ROD):
        rods = np.where(fires, _rods_torque(dataset, tables), rest) if others else rest
        torques["magnetorquers"], rest = rods, rest - rods
    if others:  # what is left while no thruster fires is round-off
        torques[" and ".join(others)] = np.where(fires, rest, 0.0)
    return torques if len(torques) > 1 else None


def _is_held(dataset: Dataset) -> bool:
    return "torque_mean" in dataset


def _fires(dataset: Dataset) -> Bool[np.ndarray, " n"]:
    """Whether a thruster may fire between each saved time and the next: it is on at either, or a
    valve opens in this interval or, as thrust is delayed, in the one before."""
    if not _is_held(dataset) or "valve_openings" not in dataset:
        return np.ones(dataset.sizes["time"], bool)
    on = (dataset["thrust_level"].values != 0).any(axis=1)
    opened = np.append(np.diff(dataset["valve_openings"].values, axis=0).any(axis=1), False)
    return on | np.append(on[1:], False) | opened | np.append(False, opened[:-1])


def _of_wheels(dataset: Dataset, tables: list[dict[str, Any]]) -> Float[np.ndarray, "n wheels"]:
    """Return torques of wheels on the body along their axes (N m): of a sampled law means, by ḣ =
    -c - J_w aᵀω̇, except in the interval in which one seizes, whose jump no motor makes."""
    torque = dataset["wheel_torque"].values
    if not _is_held(dataset):
        return torque
    rotors = np.array([one.get("rotor_inertia_kg_m2", 0.0) for one in tables])
    momentum, spans = dataset["wheel_momentum"].values, np.diff(dataset["time"].values)[:, None]
    turning = momentum + rotors * (dataset["omega"].values @ _axes(tables).T)
    means = -np.diff(turning, axis=0) / spans
    seizes = (momentum[1:] == 0) & (np.abs(means) > np.abs(torque[:-1]))
    means = np.where(seizes, torque[:-1], means)
    return np.concatenate([means, torque[-1:]])


def _axes(tables: list[dict[str, Any]]) -> Float[np.ndarray, "m 3"]:
    axes = np.array([one["axis"] for one in tables], float)
    return axes / np.linalg.norm(axes, axis=1)[:, None]


def _rods_torque(dataset: Dataset, tables: dict[str, Any]) -> Float[np.ndarray, "n 3"]:
    """Return m × B of the dipoles, N m."""
    time = dataset["time"].values
    field = field_of(OrbitTable.model_validate(tables.get("orbit", {})))
    b = field.sampled(time, EARTH_ROTATION * time)
    to_body = dataset["quaternion"].values * [1, -1, -1, -1]
    return np.cross(dataset["dipole"].values @ _axes(tables[ROD]), _turned(to_body, b))


def share_plots(dataset: Dataset) -> list[Plot]:
    """Plot the size of each kind of actuator's torque; empty where one kind makes it all."""
    shares, time = shares_of(dataset), dataset["time"].values
    if shares is None:
        return []
    lines = [Line(time, np.linalg.norm(one, axis=1), name) for name, one in shares.items()]
    title = f"{'Mean torque' if _is_held(dataset) else 'Torque'} by kind of actuator"
    return [Plot(title, "", TIME, Axis("|T|", "N m"), lines)]


def momentum_budget(dataset: Dataset) -> str:
    """Describe the momentum that external torques, and actuators without storage, give.

    It is in inertial axes, N m s: the mean of whole orbits, or that of a run shorter than one.
    Empty without wheels; without external torques where their waves are shorter than saved times
    show.
    """
    tables, time = scenario_tables(dataset), dataset["time"].values
    if "wheel_torque" not in dataset or len(time) < 2:
        return ""
    rate = OrbitTable.model_validate(tables.get("orbit", {})).rate()
    orbits = math.floor((time[-1] - time[0]) * rate / (2 * math.pi))
    if orbits:
        end = time[0] + 2 * math.pi * orbits / rate
        dataset = dataset.isel(time=slice(0, int(np.searchsorted(time, end, side="right"))))
    shares, parts = shares_of(dataset), []
    if "disturbance" in dataset and _resolves_waves(dataset):
        parts.append(("external torques", dataset["disturbance"].values, False))
    others = ((name, torque) for name, torque in (shares or {}).items() if name != "wheels")
    parts += [(name, torque, _is_held(dataset)) for name, torque in others]
    texts = []
    for name, torque, in_steps in parts:
        momentum = np.linalg.norm(_impulse(dataset, torque, in_steps=in_steps))
        if momentum > 0:
            texts.append(f"{number_text(momentum / max(orbits, 1), 3)} N m s by {name}")
    return f"{', '.join(texts)}, {'in an orbit' if orbits else 'in all'}" if texts else ""


RESOLVED = 1.0
"""Largest angle (rad) of a periodic torque between saved times whose integral they give."""


def _resolves_waves(dataset: Dataset) -> bool:
    """Whether saved times resolve the periodic torque of the scenario."""
    table = scenario_tables(dataset).get("disturbance", {})
    waves = zip(table.get("amplitude_N_m", ()), table.get("frequency_rad_s", ()), strict=False)
    fastest = max((abs(rate) for size, rate in waves if size), default=0.0)
    return bool(fastest * np.diff(dataset["time"].values).max() <= RESOLVED)


def _impulse(
    dataset: Dataset, torque: Float[np.ndarray, "n 3"], *, in_steps: bool
) -> Float[np.ndarray, "3"]:
    """Return ∫ torque dt in inertial axes, N m s, by the trapezoidal rule; torques
    `in_steps` are means until the next time."""
    before = after = _in_inertial(dataset, torque)
    if in_steps:
        after = _in_inertial(dataset, np.concatenate([torque[:1], torque[:-1]]))
    spans = np.diff(dataset["time"].values)
    return spans @ (before[:-1] + after[1:]) / 2


def _in_inertial(dataset: Dataset, vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Rotate vectors in body axes, one at each time, to the orbit frame at the first time.

    The orbit frame's rate is the body's rate without its rate relative to the frame.
    """
    to_orbit = dataset["quaternion"].values
    frame_rate = dataset["omega"].values[:1] - dataset["relative_rate"].values[:1]
    (turn,) = _turned(to_orbit[:1], frame_rate)
    time = dataset["time"].values[:, None]
    half = (time - time[0]) / 2
    size = half * np.linalg.norm(turn)
    frame_turns = np.hstack([np.cos(size), half * np.sinc(size / np.pi) * turn])
    return _turned(frame_turns, _turned(to_orbit, vectors))


def _turned(
    quaternions: Float[np.ndarray, "n 4"], vectors: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Rotate vectors by unit quaternions, scalar first. (SciPy's rotations are slow to import.)"""
    scalar, axis = quaternions[:, :1], quaternions[:, 1:]
    across = 2 * np.cross(axis, vectors)
    return vectors + scalar * across + np.cross(axis, across)
