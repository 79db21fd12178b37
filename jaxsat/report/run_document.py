"""Document of a run, from its dataset."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxsat.core.declaration.actuators import PARTS
from jaxsat.core.declaration.units import shown_unit
from jaxsat.core.text import capitalised, number_text, vector_text
from jaxsat.report.actuator_table import (
    AT_LIMIT,
    saturation_sentences,
    share_sentence,
    used_propellant,
)
from jaxsat.report.document import Document, Facts, Verdict
from jaxsat.report.facts import scenario_tables, settled_meaning, settles_in_attitude, step_error
from jaxsat.report.requirements import judgements, requirement_table
from jaxsat.report.run_plots import has_effectors
from jaxsat.report.shares import momentum_budget
from jaxsat.report.timeline import exclusions, failure_sentences, mode_names
from jaxsat.store.dataset import errors_of, time_at_rest, time_to_settle
from jaxsat.store.labelled import Dataset

UNMADE = 1e-9
"""Unmet torque below which there is none, over the largest torque."""


def run_document(dataset: Dataset, name: str = "") -> Document:
    """Return the document: settling time, final state, actuators, and requirements.

    `name` is the title where the dataset has none.
    """
    scenario = scenario_tables(dataset)
    margins = judgements(dataset)
    dataset = until_end(dataset)
    facts = Facts("Result", {**_final_state(dataset), **_actuation(dataset, scenario)})
    blocks = [facts, requirement_table(margins)] if margins else [facts]
    return Document(_title(dataset, name), run_verdict(dataset, scenario), blocks)


def _title(dataset: Dataset, name: str) -> str:
    title = str(dataset.attrs.get("title", "")) or name
    case = dataset.attrs.get("case")
    return title if case is None else f"{title}, case {int(case)}"


def until_end(dataset: Dataset) -> Dataset:
    """Return the dataset up to the end of a failed run, with at least one time."""
    good = np.flatnonzero(np.isfinite(dataset["quaternion"].values).all(axis=1))
    last = int(good[-1]) if len(good) else 0
    return dataset.isel(time=slice(0, last + 1))


def run_verdict(dataset: Dataset, scenario: Mapping[str, Any]) -> Verdict:
    """Return the verdict: settling time, failures and what the law found, tolerances, law."""
    law = str(scenario.get("control", {}).get("law", "unknown"))
    rates = float(np.linalg.norm(dataset["omega"].values[-1]))
    ends = [f"|ω| = {number_text(rates, 3, scale=_summed_rates(dataset))} rad/s"]
    attitude = settles_in_attitude(scenario)
    settled = time_to_settle(dataset) if attitude else time_at_rest(dataset)
    if attitude:
        error = float(dataset["pointing_error_total"].values[-1])
        ends.insert(0, f"pointing error {number_text(error, 3)}°")
    if len(dataset["mode"].attrs.get("flag_meanings", "").split()) > 1:
        last = mode_names(dataset.isel(time=slice(-1, None)))
        ends += [f"mode “{name}”" for name in last.values()]
    end = f"{number_text(float(dataset['time'].values[-1]), 6)} s"
    sensors = exclusions(dataset)
    more = [sentence for _, sentence in sorted(failure_sentences(dataset, scenario))]
    more += [f"{capitalised(what)} at {number_text(at, 6)} s." for at, what in sensors]
    more += [*share_sentence(dataset), *saturation_sentences(dataset, scenario)]
    if unmet := _unmet_torque(dataset, scenario, _peak_torque(dataset)):
        more.append(f"Unmet torque: {unmet}.")
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


def _final_state(dataset: Dataset) -> dict[str, str]:
    w, z, omega = (dataset[name].values[-1] for name in ("w", "z", "omega"))
    tilt = np.degrees(2 * np.arctan(np.linalg.norm(w)))
    turn, lean = number_text(float(z)), number_text(tilt, 3)
    rates = vector_text(omega, scale=_summed_rates(dataset))
    return {
        "attitude at the end": f"w = {vector_text(w)}, z = {turn} rad, tilt {lean}°",
        "rates at the end": f"ω = {rates} rad/s",
    }


def _summed_rates(dataset: Dataset) -> float:
    """The largest rate (rad/s) times the root of the steps: the round-off of a sum grows so."""
    steps = float(dataset.attrs.get("steps", 1))
    return math.sqrt(max(steps, 1.0)) * float(np.abs(dataset["omega"].values).max())


def _actuation(dataset: Dataset, scenario: Mapping[str, Any]) -> dict[str, str]:
    """Describe torque, effort, each device, the torque that holds the third rate, and steps."""
    peak, when = _peak_torque(dataset), "" if "torque_max" in dataset else " at the saved times"
    rows = {
        "torque": f"at most {vector_text(peak)} N m{when}",
        "unmet torque": _unmet_torque(dataset, scenario, peak),
    }
    if "effort" in dataset:
        by = "all actuators" if has_effectors(dataset) else "the thrusters"
        rows["effort"] = f"{vector_text(dataset['effort'].values)} N m s by {by}"
    if budget := momentum_budget(dataset):
        rows["momentum given"] = budget
    if "wheel_momentum" in dataset:
        changes = np.sum(np.abs(np.diff(dataset["wheel_momentum"].values, axis=0)), axis=0)
        rows["momentum moved"] = (
            f"{vector_text(changes)} N m s by each wheel, taken up and given back"
        )
    for part in PARTS:
        for signal in part.signals:
            if signal.peak and signal.name in dataset:
                limits = [one.get(signal.limit) for one in scenario.get(part.name, ())]
                label = f"{part.name}s".replace("_", " ")
                rows[label] = _peaks(dataset[signal.name].values, signal.units, limits)
    if "thrust_level" in dataset:
        spans = np.diff(dataset["time"].values)
        open_for = spans @ dataset["thrust_level"].values[:-1]
        rows["thrusters"] = f"at full thrust for {vector_text(open_for)} s"
    if (propellant := used_propellant(dataset)) > 0:
        rows["propellant"] = f"{number_text(propellant, 3)} kg"
    if "constraint_effort" in dataset:
        peak = float(np.nanmax(np.abs(dataset["constraint_torque"].values), initial=0.0))
        effort = number_text(dataset["constraint_effort"].values)
        rows["third rate"] = (
            f"held by an ideal torque: {effort} N m s, at most "
            f"{number_text(peak, 3)} N m at the saved times"
        )
    error = step_error(*errors_of(dataset))
    rows["steps"] = f"{dataset.attrs.get('steps', '')}{f'; errors of {error}' if error else ''}"
    return {label: text for label, text in rows.items() if text}


def _peak_torque(dataset: Dataset) -> np.ndarray:
    """Return the peak torque about each body axis, N m; of a sampled law at any time."""
    torques = ("torque_min", "torque_max") if "torque_max" in dataset else ("torque",)
    return np.nanmax(np.abs(np.concatenate([dataset[one].values for one in torques])), axis=0)


def _unmet_torque(dataset: Dataset, scenario: Mapping[str, Any], peak: np.ndarray) -> str:
    """Describe the largest unmet torque, and how often there is any; empty for none."""
    if "torque_unmade" not in dataset:
        return ""
    unmade = np.linalg.norm(dataset["torque_unmade"].values, axis=1)
    lacking = unmade > UNMADE * np.max(peak, initial=0.0)
    if not lacking.any():
        return ""
    text = (
        f"at most {number_text(np.nanmax(unmade), 3)} N m beyond what the actuators make, at "
        f"{number_text(100 * lacking.mean(), 3)} % of the saved times"
    )
    if not scenario.get("magnetorquer"):
        return text
    return (
        f"{text}; what is asked of magnetorquers along the field, which none makes, does not count"
    )


def _peaks(history: np.ndarray, units: str, limits: Sequence[float | None]) -> str:
    """Describe the peak of each device, its fraction of the limit, and the time at a limit."""
    sizes = np.abs(history)
    text = f"at most {vector_text(np.nanmax(sizes, axis=0))} {shown_unit(units)}"
    if len(limits) != sizes.shape[1] or not all(limits):
        return text
    parts = sizes / np.array(limits, float)
    text += f", {number_text(100 * np.nanmax(parts), 3)} % of a limit"
    full = np.mean(np.any(parts >= AT_LIMIT, axis=1))
    return f"{text}, at one for {number_text(100 * full, 3)} % of the saved times" if full else text
