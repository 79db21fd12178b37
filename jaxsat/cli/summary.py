"""The printed summary of a run."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.integration_error import errors_of
from jaxsat.cli.terminal import print_stdout

if TYPE_CHECKING:
    import numpy as np
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

    from jaxsat.report.cells import step_error

    good = np.flatnonzero(np.isfinite(dataset["omega"].values).all(axis=1))
    last = good[-1] if len(good) else 0
    final = dataset.isel(time=last)
    ranged = "torque_max" in dataset
    told = ("torque_min", "torque_max") if ranged else ("torque",)
    peak = np.nanmax(np.abs(np.concatenate([dataset[one].values for one in told])), axis=0)
    at = f"at {float(final['time']):g} s"
    tilt = np.degrees(2 * np.arctan(np.linalg.norm(final["w"].values)))
    error = step_error(*errors_of(dataset))
    rows = {
        "scenario": f"{dataset.attrs['title']} ({name})",
        "outcome": f"{dataset.attrs['outcome_explanation']} {at}; "
        f"{dataset.attrs['steps']} steps, {seconds:.1f} s with compilation",
        "settled": settling_text(dataset, scenario),
        "attitude": f"w = {_numbers(final['w'])}, z = {float(final['z']):.4g} rad, "
        f"tilt {tilt:.3g} deg {at}",
        "rates": f"omega = {_numbers(final['omega'])} rad/s {at}",
        "torque": f"peak |T| = {_numbers(peak)} N m{'' if ranged else ' at the saved times'}",
        "effort": effort_text(dataset),
        **({"error of steps": error} if error else {}),
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
    return f"from {time:.2f} s ({meaning})" if math.isfinite(time) else f"no ({meaning})"


def effort_text(dataset: "xr.Dataset") -> str:
    """What actuators spent and, told apart, the ideal torque that holds the third rate."""
    axes = ", ".join(f"{float(part):.4g}" for part in dataset["effort"])
    several = {"wheel_momentum", "dipole"} & set(dataset)
    text = f"({axes}) N m s by {'all actuators' if several else 'the thrusters'}"
    for name, what in (("wheel_momentum", "wheels"), ("dipole", "magnetorquers")):
        if name in dataset:
            unit = {"A m2": "A m²"}.get(dataset[name].units, "N m s")
            text += f"; {what} up to {_numbers(abs(dataset[name]).max('time'))} {unit}"
    if "constraint_effort" not in dataset:
        return text
    peak = float(abs(dataset["constraint_torque"]).max())
    return (
        f"{text}; {float(dataset['constraint_effort']):.4g} N m s, up to {peak:.3g} N m at the "
        "saved times, by the ideal torque that holds the third rate"
    )


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


def _numbers(values: "xr.DataArray | np.ndarray") -> str:
    return "(" + ", ".join(f"{float(value):.4g}" for value in values) + ")"
