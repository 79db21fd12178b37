"""Dimensionless defaults for a scenario's missing dispersions, sensors and duration."""

import math
from typing import Any, NamedTuple

from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.declaration.settling import equivalent_limit
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.dispersion_trial import dispersion_issues
from jaxsat.scenario.build.run import build
from jaxsat.scenario.derived import has_sensors
from jaxsat.scenario.dispersion_tables import DispersionTable
from jaxsat.scenario.domain import dimensionless_numbers
from jaxsat.scenario.parts.sensors import SamplingTable
from jaxsat.scenario.parts.torque_makers import TorqueMakers
from jaxsat.synthesis.comparison.acceptance import horizon
from jaxsat.synthesis.controller_design.lost_holds import LEAST_COUPLING, holds_last
from jaxsat.synthesis.controller_design.vehicle import Scale, VehicleVerdict, scale_of_orbit

RATE = 0.83
"""Largest initial rate about each axis times τ: 0.1 rad/s on the acceptance set at 5 N m."""

RATE_NOISE = 2.5e-4
"""Noise of the rate sensors times τ (rad): 3e-5 rad/s on the acceptance set."""

ATTITUDE_NOISE = 1e-4
"""Noise of the attitude sensors, rad."""

WHEEL_SHARE = 0.3
"""Largest initial momentum about each axis, over the least momentum limit of the wheels."""

SMALL_TURN = 1.0
"""Initial rotation about each axis (rad) for two wheels alone, which have no momentum left."""


REFERENCE_COUPLING = 0.4
"""Coupling c with the duration of the acceptance set."""


class Completion(NamedTuple):
    """A scenario complete for a study, and a sentence for each assumption."""

    scenario: Scenario
    assumed: tuple[str, ...]


def default_duration(scenario: Scenario, verdict: VehicleVerdict, scale: Scale) -> float:
    """Return the duration of a case (s): that on the acceptance set at the equivalent torque.

    Two torques turn the third axis by c ω1 ω2, so where holds last the duration grows as 1/c. In a
    low orbit it does not help: an attitude that balances a large drift is lost again in time.
    """
    alike = horizon(equivalent_limit(scale.moments, scale.torque))
    if verdict.judgement.laws != "two torques" or scenario.wheel:
        return alike
    c = dimensionless_numbers(scenario)["coupling"]
    if c >= REFERENCE_COUPLING or not holds_last(scenario):
        return alike
    return alike * REFERENCE_COUPLING / max(c, LEAST_COUPLING)


def completed(
    scenario: Scenario, verdict: VehicleVerdict, scale: Scale, timed: bool = True
) -> Completion:
    """Return the scenario with default dispersions, sensors and duration where it has none.

    A given duration is kept, unless default dispersions are added, which need more than one start
    does. Defaults are the level "hard" of the acceptance set, scaled by τ, or by 1/ω0 where
    magnetorquers hold an axis, without quantities that the loop does not have.
    """
    if verdict.judgement.laws == "magnetic":
        scale = scale_of_orbit(scenario)
    data, assumptions = scenario.model_dump(exclude_none=True), []
    has_dispersions = scenario.dispersion is not None
    if not has_sensors(scenario) and "period_s" in data["control"]:
        noise = float(f"{RATE_NOISE / scale.time:.2g}")
        table = SamplingTable(rate_noise_rad_s=noise, attitude_noise_rad=ATTITUDE_NOISE)  # pyright: ignore[reportCallIssue]
        data["sampling"] = table.model_dump()
        assumptions.append(f"sensor noise of {noise:g} rad/s and {ATTITUDE_NOISE:g} rad per sample")
    if not has_dispersions:
        bare = Scenario.model_validate(data)
        tables = _fitting_distributions(bare, _distributions(bare, verdict, scale))
        data["dispersion"] = tables
        words = "; ".join(_dispersion_words(tables))
        assumptions.append(f"dispersions at the level hard: {words}")
    if timed and has_dispersions:
        return Completion(Scenario.model_validate(data), tuple(assumptions))
    default = default_duration(Scenario.model_validate(data), verdict, scale)
    if not timed or scenario.simulation.duration_s < default:
        table = data["simulation"]
        table["duration_s"] = math.ceil(default / table["save_every_s"]) * table["save_every_s"]
        assumptions.insert(0, f"duration of a case {table['duration_s']:g} s")
    return Completion(Scenario.model_validate(data), tuple(assumptions))


def _distributions(
    scenario: Scenario, verdict: VehicleVerdict, scale: Scale
) -> dict[str, dict[str, Any]]:
    """Return the dispersions of the level hard by key, times in τ."""
    makers = TorqueMakers.of(scenario)
    no_thrusters = not verdict.judgement.actuators.torques.any()
    alone = bool(makers.wheels) and (no_thrusters or makers.wheels_make_all)
    rate, start = RATE / scale.time, {"attitude": {"distribution": "random-attitude"}}
    if alone:
        limits = [one.momentum_limit_N_m_s for one in makers.working_wheels]
        finite_limits = [limit for limit in limits if limit is not None]
        rate = min([rate, *(WHEEL_SHARE * limit / scale.moment for limit in finite_limits)])
        if verdict.judgement.laws == "two wheels":
            rate, start = 0.0, {"attitude_error_rad": _uniform(SMALL_TURN)}
    tables = dict(start)
    if rate:
        tables["omega_rad_s"] = _uniform(float(f"{rate:.3g}"))
    tables |= {
        "inertia": _uniform(0.1),
        "products_of_inertia": _uniform(0.02),
        "misalignment_rad": _uniform(math.radians(1)),
        "torque_gain": _uniform(0.1),
    }
    if any(scenario.disturbance.amplitude_N_m):
        tables |= {
            "disturbance_amplitude": _uniform(1.0),
            "disturbance_frequency": _uniform(0.2),
            "disturbance_phase_rad": _uniform(math.pi),
        }
    return tables


def _uniform(half: float) -> dict[str, Any]:
    return {"distribution": "uniform", "low": -half, "high": half}


def _fitting_distributions(
    scenario: Scenario, tables: dict[str, dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Return the dispersions of quantities that the loop has, and from which it can begin."""
    run = build(scenario)
    fitting_tables = dict(tables)
    while fitting_tables:
        table = DispersionTable.model_validate(fitting_tables)
        trial = scenario.model_copy(update={"dispersion": table})
        issues = dispersion_issues(trial, run, all_fit=True)
        misfits = {str(issue.location[1]) for issue in issues if issue.location[0] == "dispersion"}
        if not misfits & fitting_tables.keys():
            break
        fitting_tables = {key: value for key, value in fitting_tables.items() if key not in misfits}
    return fitting_tables


def _dispersion_words(tables: dict[str, dict[str, Any]]) -> list[str]:
    texts = []
    for one in DISPERSIBLE.values():
        table = tables.get(one.key)
        if table is None:
            continue
        unit = "" if one.unit == "1" else f" {one.unit}"
        spread = f"±{table['high']:.3g}{unit}" if "high" in table else "any"
        texts.append(f"{one.name.replace('_', ' ')} {spread}")
    return texts
