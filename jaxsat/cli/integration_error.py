"""What is told of the error that the length of equal steps leaves."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from jaxsat.scenario import Scenario

Errors = tuple[float | None, float | None]
"""The estimates of the rate (rad/s) and of the attitude (rad), None where there are none."""

REFINEMENTS = 4
"""How often a run is flown again with twice the substeps: the error falls by 2^p, order p, each."""


def errors_of(dataset: "xr.Dataset") -> Errors:
    """Those of a run."""
    rate, attitude = (
        float(dataset[f"{part}_error_estimate"]) if f"{part}_error_estimate" in dataset else None
        for part in ("rate", "attitude")
    )
    return rate, attitude


def excessive_error(errors: Errors, scenario: "Scenario") -> str:
    """What to say where an estimate is larger than the scenario allows; nothing where none is."""
    solver = scenario.simulation.solver
    allowed = {
        "rate_error_rad_s": ("rate", errors[0], solver.rate_error_rad_s, "rad/s"),
        "attitude_error_rad": ("attitude", errors[1], solver.attitude_error_rad, "rad"),
    }
    parts = [
        f"the {of} of about {value:.2g} {unit} (simulation.solver.{key} = {most:g})"
        for key, (of, value, most, unit) in allowed.items()
        if value is not None and value > most
    ]
    if not parts:
        return ""
    return (
        f"the steps leave an error of {' and of '.join(parts)}, against halved ones; "
        f"{_finer(scenario)}"
    )


def with_finer_steps(scenario: "Scenario", errors: Errors) -> "Scenario | None":
    """With twice the substeps, where these leave too large an error; None where they do not, the
    loop has none, or there would be more than a run may have."""
    from jaxsat.scenario.resolution import MOST_STEPS, MOST_SUBSTEPS, substeps_of

    sampled = scenario.law.declaration.sampled
    if not sampled or not excessive_error(errors, scenario):
        return None
    simulation, count = scenario.simulation, 2 * substeps_of(scenario)
    periods = simulation.duration_s / getattr(scenario.control, "period_s", simulation.duration_s)
    if count > MOST_SUBSTEPS or count * periods > MOST_STEPS:
        return None
    solver = simulation.solver.model_copy(update={"substeps": count})
    changed = simulation.model_copy(update={"solver": solver})
    return scenario.model_copy(update={"simulation": changed})


def _finer(scenario: "Scenario") -> str:
    from jaxsat.scenario.resolution import substeps_of

    if not scenario.law.declaration.sampled:
        return "make simulation.solver.step_s smaller, or use adaptive steps"
    return (
        f"raise simulation.solver.substeps, now {substeps_of(scenario)}, or name a solver of "
        "higher order"
    )
