"""The printed summary of a run."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.integration_error import error_row, errors_of
from jaxsat.cli.terminal import print_stdout
from jaxsat.core.numerals import fixed_text, number_text, vector_text

if TYPE_CHECKING:
    import xarray as xr

    from jaxsat.scenario import Scenario

ADVICE = {
    "STATE_LIMIT": 'check gains and initial state, and use simulation.attitude = "quaternion" '
    "where the body turns upside down",
    "MAX_STEPS": "in [simulation.solver], with adaptive steps, raise max_steps, loosen rtol and "
    "atol, or set min_step_s; with fixed steps, raise step_s",
    "STEP_UNDERFLOW": "set simulation.solver.min_step_s to pass points where the law has a corner",
}


def print_summary(
    dataset: "xr.Dataset",
    name: str,
    scenario: "Scenario",
    seconds: float,
    target: Path,
    files: Sequence[str],
) -> None:
    """Outcome, settling time, final state and files of a run."""
    import numpy as np

    good = np.flatnonzero(np.isfinite(dataset["omega"].values).all(axis=1))
    last = good[-1] if len(good) else 0
    final = dataset.isel(time=last)
    ranged = "torque_max" in dataset
    told = ("torque_min", "torque_max") if ranged else ("torque",)
    peak = np.nanmax(np.abs(np.concatenate([dataset[one].values for one in told])), axis=0)
    at = f"at {float(final['time']):g} s"
    tilt = np.degrees(2 * np.arctan(np.linalg.norm(final["w"].values)))
    largest = float(np.nanmax(np.abs(dataset["omega"].values), initial=0.0))
    rows = {
        "scenario": f"{dataset.attrs['title']} ({name})",
        "outcome": f"{dataset.attrs['outcome_explanation']} {at}; "
        f"{dataset.attrs['steps']} steps, {seconds:.1f} s with compilation",
        "settled": settling_text(dataset, scenario),
        "attitude": f"w = {vector_text(final['w'], scale=1.0)}, "
        f"z = {number_text(final['z'], scale=1.0)} rad, "
        f"tilt {number_text(tilt, 3, scale=1.0)} deg {at}",
        "rates": f"omega = {vector_text(final['omega'], scale=largest)} rad/s {at}",
        "torque": f"peak |T| = {vector_text(peak)} N m{'' if ranged else ' at the saved times'}",
        "effort": effort_text(dataset),
        **propellant_row(dataset, scenario),
        **error_row(errors_of(dataset)),
        "written": f"{target}: {', '.join(files)}",
    }
    width = max(map(len, rows))
    for label, text in rows.items():
        print_stdout(f"{label:<{width}}  {text}")


def settling_text(dataset: "xr.Dataset", scenario: "Scenario") -> str:
    """When the spacecraft settled, and what that means: by rates alone under some laws."""
    import math

    from jaxsat.scenario.build.run import build_tolerances
    from jaxsat.scenario.laws import find_law
    from jaxsat.store import time_at_rest, time_to_settle

    attitude = find_law(scenario.control.law).declaration.regulates_attitude
    time = time_to_settle(dataset) if attitude else time_at_rest(dataset)
    meaning = build_tolerances(scenario).text(attitude)
    return f"from {fixed_text(time, 2)} s ({meaning})" if math.isfinite(time) else f"no ({meaning})"


def effort_text(dataset: "xr.Dataset") -> str:
    """What actuators spent and, told apart, the ideal torque that holds the third rate."""
    several = {"wheel_momentum", "dipole"} & set(dataset)
    of = "all actuators" if several else "the thrusters"
    text = f"{vector_text(dataset['effort'])} N m s by {of}"
    for name, what in (("wheel_momentum", "wheels"), ("dipole", "magnetorquers")):
        if name in dataset:
            unit = {"A m2": "A m²"}.get(dataset[name].units, "N m s")
            text += f"; {what} up to {vector_text(abs(dataset[name]).max('time'))} {unit}"
    if "constraint_effort" not in dataset:
        return text
    peak = float(abs(dataset["constraint_torque"]).max())
    spent = f"{number_text(dataset['constraint_effort'])} N m s, up to {number_text(peak, 3)} N m"
    return f"{text}; {spent} at the saved times, by the ideal torque that holds the third rate"


def propellant_row(dataset: "xr.Dataset", scenario: "Scenario") -> dict[str, str]:
    """What thrusters used, where any has a specific impulse."""
    if "propellant" not in dataset or not any(one.specific_impulse_s for one in scenario.thruster):
        return {}
    used = dataset["propellant"].values
    return {"propellant": f"{number_text(used[used == used].max(initial=0.0))} kg"}


def failure_advice(dataset: "xr.Dataset") -> str:
    """What happened to a run that did not reach its end, and what to try."""
    import numpy as np

    good = np.isfinite(dataset["omega"].values).all(axis=1)
    reached = float(dataset["time"].values[good][-1]) if good.any() else 0.0
    outcome = dataset.attrs["outcome"]
    return (
        f"the run ended early, after t = {reached:g} s ({dataset.attrs['outcome_explanation']}); "
        f"{ADVICE[outcome]}"
    )
