"""What to try after a run that did not reach its end."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

ADVICE = {
    "STATE_LIMIT": 'check gains and initial state, and use simulation.attitude = "quaternion" '
    "where the body turns upside down",
    "MAX_STEPS": "in [simulation.solver], with adaptive steps, raise max_steps, loosen rtol and "
    "atol, or set min_step_s; with fixed steps, raise step_s",
    "STEP_UNDERFLOW": "set simulation.solver.min_step_s to pass points where the law has a corner",
}


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
