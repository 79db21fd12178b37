"""The section of one run: verdict, replay, plots, numbers, scenario, provenance."""

import hashlib
import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from jaxsat.core.numerals import number_text
from jaxsat.core.text import capitalised
from jaxsat.core.tolerances import Tolerances
from jaxsat.report.page.charts import MOST_LINES, TimePlots, shown_unit
from jaxsat.report.page.content import (
    Chart,
    Charts,
    Facts,
    Lines,
    Listing,
    Replay,
    Section,
    Table,
    Verdict,
)
from jaxsat.report.page.replay import craft, failures_of
from jaxsat.report.signal_figures import BOUND, further_signals
from jaxsat.report.time_axes import mode_names
from jaxsat.scenario.laws import known_law
from jaxsat.scenario.tables import OrbitTable
from jaxsat.store import time_at_rest, time_to_settle
from jaxsat.store.coarseness import coarseness

GROUPS = {
    "Attitude": ("pointing_error_total", "pointing_error", "euler_angle", "w", "z"),
    "Rates": ("omega", "relative_rate", "rate_error"),
    "Torque": ("torque", "constraint_torque", "disturbance"),
    "Control law": ("lyapunov", "mode"),
}
"""Signals by heading; those that are not named stand under `FURTHER`."""

FURTHER = "Actuators and sensors"

TITLES = {
    "pointing_error_total": "Total pointing error",
    "pointing_error": "Pointing error about body axes",
    "euler_angle": "Euler angles 3-2-1",
    "w": "Tilt w",
    "z": "Turn z",
    "omega": "Angular velocity ω",
    "relative_rate": "Rate relative to the orbit frame",
    "rate_error": "Rate minus its reference",
    "torque": "Torque",
    "constraint_torque": "Ideal torque that holds the third rate",
    "disturbance": "Disturbance torque",
    "lyapunov": "Lyapunov function",
    "mode": "Phase of the control law",
}
"""Others go by their long name."""

LOGARITHMIC = frozenset({"pointing_error_total", "lyapunov"})
STEPS = frozenset({"mode", "valve_openings"})
MUTE = frozenset({"constraint_torque", "disturbance", "rate_error", "z", "lyapunov"})
"""Signals without which the page is as clear where they are zero or unknown throughout."""


def run_section(dataset: xr.Dataset, name: str, command: str = "") -> Section:
    """What the dataset of a run has to say; `name` is where it came from."""
    scenario = scenario_tables(dataset)
    dataset = _until_end(dataset)
    failures = failures_of(scenario, dataset["time"].values)
    plots = TimePlots(dataset["time"].values, failures) if len(dataset["time"]) > 1 else None
    blocks: list[Any] = [Facts("Scenario", scenario_facts(scenario))]
    if plots is not None:
        blocks.append(Replay("3-D replay", [craft(dataset, scenario, _title(dataset, name))]))
        blocks += run_charts(dataset, plots)
    blocks += [
        extremes(dataset),
        provenance_facts(dataset.attrs, command),
        Listing("Scenario file", str(dataset.attrs.get("scenario", "")), "scenario.toml"),
    ]
    verdict = run_verdict(dataset, scenario, failures)
    if told := coarseness(dataset):
        blocks.insert(1, Lines("Note", [f"{capitalised(told)}."]))
    return Section(_title(dataset, name), f"Run in {name}", verdict, blocks, plots)


def _title(dataset: xr.Dataset, name: str) -> str:
    title = str(dataset.attrs.get("title", "")) or name
    case = dataset.attrs.get("case")
    return title if case is None else f"{title}, case {int(case)}"


def scenario_tables(dataset: xr.Dataset) -> dict[str, Any]:
    """The scenario that a dataset carries; empty where it has none."""
    try:
        return tomllib.loads(str(dataset.attrs.get("scenario", "")))
    except tomllib.TOMLDecodeError:
        return {}


def _until_end(dataset: xr.Dataset) -> xr.Dataset:
    """Without the times that a failed run did not reach; with one at least."""
    good = np.flatnonzero(np.isfinite(dataset["quaternion"].values).all(axis=1))
    last = int(good[-1]) if len(good) else 0
    return dataset.isel(time=slice(0, last + 1))


def run_verdict(
    dataset: xr.Dataset, scenario: Mapping[str, Any], failures: Sequence[tuple[float, str]]
) -> Verdict:
    """When it settled, within what, by which law, and what failed on the way."""
    law = str(scenario.get("control", {}).get("law", "unknown"))
    rates = float(np.linalg.norm(dataset["omega"].values[-1]))
    ends = [f"|ω| = {number_text(rates, 3)} rad/s"]
    attitude = settles_in_attitude(scenario)
    settled = time_to_settle(dataset) if attitude else time_at_rest(dataset)
    if attitude:
        ends.insert(
            0, f"pointing error {number_text(float(dataset['pointing_error_total'][-1]), 3)}°"
        )
    end = f"{number_text(float(dataset['time'][-1]), 6)} s"
    more = [f"{capitalised(what)} at {number_text(at, 6)} s." for at, what in failures]
    if int(dataset.attrs.get("outcome_code", 0)) != 0:
        reason = dataset.attrs.get("outcome_explanation", "it failed")
        return Verdict(False, f"The run ended early, at {end}: {reason}.", more)
    more += [
        f"At the end, {end}: {', '.join(ends)}.",
        f"Settled means {settled_meaning(scenario)}; control law: {law}.",
    ]
    if math.isfinite(settled):
        return Verdict(True, f"Settled at {settled:.2f} s, and stays settled to {end}.", more)
    return Verdict(False, f"Not settled within {end}.", more)


def settles_in_attitude(scenario: Mapping[str, Any]) -> bool:
    """Whether the law of a scenario's tables has an attitude to go to; true of one not known."""
    found = known_law(str(scenario.get("control", {}).get("law", "unknown")))
    return found is None or found.declaration.regulates_attitude


def settled_meaning(scenario: Mapping[str, Any], of_study: bool = False) -> str:
    """Within what a run of a scenario's tables counts as settled, or a case of a study, which under
    a law that only stops a rotation may turn as fast as the orbit besides."""
    keys = ("tilt_rad", "turn_rad", "rate_rad_s", "dwell_s")
    table = scenario.get("settled", {})
    given = {key: table[key] for key in keys if isinstance(table.get(key), int | float)}
    found, attitude = Tolerances.of_keys(**given), settles_in_attitude(scenario)
    if attitude or not of_study:
        return found.text(attitude)
    return found.of_rate(OrbitTable.model_validate(scenario.get("orbit", {})).rate()).text()


def scenario_facts(scenario: Mapping[str, Any]) -> dict[str, str]:
    """The scenario in a few lines."""
    spacecraft, control = scenario.get("spacecraft", {}), scenario.get("control", {})
    simulation, initial = scenario.get("simulation", {}), scenario.get("initial", {})
    rows = {"description": " ".join(str(scenario.get("description", "")).split())}
    rows["inertia"] = f"{_numbers(spacecraft.get('inertia_kg_m2'))} kg m²"
    rows["actuators"] = _actuators(scenario)
    rows["third rate"] = str(spacecraft.get("third_rate", ""))
    keys = (f"{key} = {_numbers(value)}" for key, value in control.items() if key != "law")
    rows["control law"] = ", ".join([str(control.get("law", "")), *keys])
    rows["start"] = ", ".join(f"{key} = {_numbers(value)}" for key, value in initial.items())
    rows["duration"] = f"{_numbers(simulation.get('duration_s'))} s"
    return {label: text for label, text in rows.items() if text}


def _actuators(scenario: Mapping[str, Any]) -> str:
    spacecraft, parts = scenario.get("spacecraft", {}), []
    axes = spacecraft.get("thruster_torque_axes")
    if axes:
        failed = ", ".join(map(str, spacecraft.get("failed_thrusters", ())))
        limit = spacecraft.get("torque_limit_N_m")
        more = f" of at most {_numbers(limit)} N m" if limit is not None else ""
        parts.append(
            f"{len(axes)} ideal thrusters{more}" + (f", failed: {failed}" if failed else "")
        )
    for kind in ("thruster", "wheel", "magnetorquer"):
        tables = scenario.get(kind, ())
        if tables:
            failed = sum(bool(table.get("failed")) for table in tables)
            parts.append(f"{len(tables)} {kind}s" + (f", {failed} failed" if failed else ""))
    return "; ".join(parts)


def _numbers(value: Any) -> str:
    """A value of a scenario on one line."""
    if isinstance(value, (list, tuple)):
        return "(" + ", ".join(map(_numbers, value)) + ")"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_numbers(entry)}" for key, entry in value.items()) + "}"
    return number_text(value, 6) if isinstance(value, float) else str(value)


def run_charts(dataset: xr.Dataset, plots: TimePlots) -> list[Charts]:
    """The plots of a run under their headings, the time window first."""
    groups = {**GROUPS, FURTHER: tuple(further_signals(dataset))}
    error = dataset["pointing_error_total"]
    overview = plots.overview(error.values, "Total pointing error", "degree")
    found = [Charts("Time window", [overview])]
    for heading, names in groups.items():
        made = [one for name in names for one in _signal_charts(dataset, name, plots)]
        if made:
            found.append(Charts(heading, made))
    return found


def _signal_charts(dataset: xr.Dataset, name: str, plots: TimePlots) -> list[Chart]:
    """The plots of one signal: none where it is not there or says nothing."""
    if name not in dataset:
        return []
    variable = dataset[name]
    values = variable.values.reshape(len(dataset["time"]), -1)
    if name in MUTE and not np.nan_to_num(values).any():
        return []
    if name == "mode" and len(mode_names(dataset)) < 2:
        return []
    title = TITLES.get(name) or capitalised(str(variable.attrs.get("long_name", name)))
    unit = str(variable.attrs.get("units", "1"))
    labels = [_label(name, part) for part in _parts(variable)]
    if name == "torque" and "torque_max" in dataset:
        return _torque_charts(dataset, labels, plots)
    if len(labels) > MOST_LINES:
        return [plots.strips(values, labels, title=title, unit=unit)]
    bands = {}
    if name + BOUND in dataset:
        bound = dataset[name + BOUND].values.reshape(values.shape)
        bands = {column: (-bound[:, column], bound[:, column]) for column in range(len(labels))}
    options: dict[str, Any] = {"log": name in LOGARITHMIC, "steps": name in STEPS, "bands": bands}
    chart = plots.lines(values, labels, title=title, unit=unit, **options)
    if name == "mode":
        names = mode_names(dataset)
        chart.figure.yaxis.ticker = list(names)
        chart.figure.yaxis.major_label_overrides = dict(names)
    return [chart]


def _torque_charts(dataset: xr.Dataset, labels: list[str], plots: TimePlots) -> list[Chart]:
    """One plot an axis where the torque changes between the saved times: mean and range."""
    low, high, mean = (dataset[f"torque_{part}"].values for part in ("min", "max", "mean"))
    return [
        plots.lines(
            mean[:, [axis]],
            [f"mean {label}"],
            title=f"Torque {label}: mean and range until the next saved time",
            unit="N m",
            bands={0: (low[:, axis], high[:, axis])},
        )
        for axis, label in enumerate(labels)
        if np.nan_to_num(high[:, axis] - low[:, axis]).any() or np.nan_to_num(mean[:, axis]).any()
    ]


def _parts(variable: xr.DataArray) -> list[str]:
    return [""] if variable.ndim == 1 else [str(one) for one in variable[variable.dims[1]].values]


def _label(name: str, part: str) -> str:
    symbol = {"omega": "ω", "torque": "T", "pointing_error": "about ", "quaternion": ""}.get(name)
    if not part:
        return name.replace("_", " ")
    if name == "w" or name == "euler_angle":
        return part
    return part if symbol is None else f"{symbol}{part}"


def extremes(dataset: xr.Dataset) -> Table:
    """Least, largest and last value of every signal, which the plots draw."""
    rows = []
    for name, variable in dataset.data_vars.items():
        if variable.dims[:1] != ("time",):
            continue
        values = variable.values.reshape(len(dataset["time"]), -1)
        for part, column in zip(_parts(variable), values.T, strict=True):
            good = column[np.isfinite(column)]
            if len(good):
                unit = str(variable.attrs.get("units", "1"))
                numbers = (float(good.min()), float(good.max()), float(good[-1]))
                label = part if part.startswith(str(name)) else f"{name} {part}".strip()
                rows.append([label, shown_unit(unit), *numbers])
    note = "At the saved times, not decimated."
    return Table("Numbers", ["signal", "unit", "least", "largest", "at the end"], rows, note)


def provenance_facts(attributes: Mapping[str, Any], command: str = "") -> Facts:
    """What made a dataset, and the hash of its scenario."""
    text = str(attributes.get("scenario", ""))
    versions = {
        key.removesuffix("_version"): str(value)
        for key, value in attributes.items()
        if key.endswith("_version")
    }
    rows = {
        "command": command,
        "scenario (SHA-256)": hashlib.sha256(text.encode()).hexdigest() if text else "",
        "seed": str(attributes.get("seed", "")),
        "made": str(attributes.get("created", "")),
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "platform": str(attributes.get("platform", "")),
        "steps": str(attributes.get("steps", "")),
    }
    return Facts("Provenance", {label: value for label, value in rows.items() if value})
