"""Candidate laws for the remaining actuators, with dimensionless gains."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from jaxsat.control.fine import OscillatorySettling
from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.control.planned import PlannedSettling
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.controllability.judgement import Judgement
from jaxsat.core.declaration.laws import Law
from jaxsat.core.declaration.settling import HOLDING_AMPLITUDE, LARGEST_FALL
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.actuator_set import FAULT_TOLERANT, fitting_laws, judge_scenario
from jaxsat.scenario.build.run import build, build_loop, build_tolerances
from jaxsat.scenario.checks import SOLVER_KEYS
from jaxsat.scenario.control import known_law, required_law
from jaxsat.scenario.errors import key_of
from jaxsat.scenario.schema import issues_of
from jaxsat.studies.changes import controller_of
from jaxsat.studies.dispersions import number_at
from jaxsat.synthesis.controller_design.request import ALL, QUICK
from jaxsat.synthesis.controller_design.vehicle import (
    Scale,
    VehicleVerdict,
    control_period,
    scale_of,
)

QUICK_PERIOD = 0.05
"""Control period over τ up to which one third-order step per period is accurate enough."""

Gains = tuple[Mapping[str, float], Mapping[str, Any]]

GAINS: Mapping[str, Mapping[str, Gains]] = {
    "three-slew": {"": ({}, {})},
    "oscillatory": {"": ({}, {})},
    "planned": {"": ({}, {})},
    "quaternion-feedback": {
        ", slow": ({"natural_frequency_rad_s": 0.25, "max_rate_rad_s": 0.08}, {"damping": 1.0}),
        "": ({"natural_frequency_rad_s": 0.4, "max_rate_rad_s": 0.2}, {"damping": 1.0}),
        ", quick": ({"natural_frequency_rad_s": 0.8, "max_rate_rad_s": 0.4}, {"damping": 1.0}),
    },
    "magnetic": {"": ({}, {}), ", quick": ({}, {"control_weight": 0.01})},
    FAULT_TOLERANT: {
        "": ({"natural_frequency_rad_s": 0.4, "max_rate_rad_s": 0.2}, {"damping": 1.0}),
        ", quick": ({"natural_frequency_rad_s": 0.8, "max_rate_rad_s": 0.4}, {"damping": 1.0}),
    },
    "three-axis": {
        "": (
            {"k3": 0.316, "mu": 1.58, "k4": 4.74, "attitude_weight_N_m": 2.5},
            {"a": 0.2, "internal_model": False, "saturation_width": 0.5, "tilt_width": 0.01},
        )
    },
}
"""Variants of every law: gains times τ (k4 over J0/τ, the weight over T) and dimensionless ones.

The settling laws have their own (`jaxsat.core.declaration.tuned_gains`); the gains of the
three-axis law are those of `two-wheel-telescope`.
"""

SLOW_LAWS: Mapping[str, str] = {
    "planned": "plans in flight, so its verification takes many minutes; give the law planned or "
    "all to include it"
}
"""Laws that are designed only on request, and the reason."""

RATE_SHARE, TILT_SHARE = 0.85, 0.5
"""Fractions of the settling tolerances of rate and tilt that a large end game uses."""


@dataclass(frozen=True)
class Candidate:
    """A candidate law: its scenario, and its name in the design."""

    name: str
    scenario: Scenario

    @property
    def tunable(self) -> dict[str, str]:
        """The tunable keys of the law, and their attribute paths in it."""
        return self.scenario.law.declaration.tunable


class Fitting(NamedTuple):
    """Laws that fit, and the reasons why others do not."""

    candidates: tuple[Candidate, ...]
    left_out: tuple[str, ...]


def fitting_candidates(
    scenario: Scenario,
    verdict: VehicleVerdict,
    law: str,
    complete: Callable[[Scenario, Scale], Scenario],
) -> Fitting:
    """Return the requested laws that can be built for the vehicle.

    `complete` fills in the missing parts of a scenario with a law and a scale.
    """
    names = [law] if law not in (ALL, QUICK) else fitting_laws(scenario, verdict.judgement)
    slow = [name for name in names if law == QUICK and name in SLOW_LAWS]
    candidates, left_out = [], []
    orbital = _orbital_law(verdict.judgement)
    for name, table in _tables(scenario, [one for one in names if one not in slow], law, orbital):
        under_law = _scenario_or_reason(scenario, table, complete)
        if isinstance(under_law, str):
            left_out.append(f"{name}: {under_law}")
        else:
            candidates.append(Candidate(name, under_law))
    left_out += [f"{name}: {SLOW_LAWS[name]}" for name in slow]
    return Fitting(tuple(candidates), tuple(left_out))


def usual_control(scenario: Scenario, law: str) -> dict[str, Any]:
    """Return the `[control]` table of a law's candidate; empty if the vehicle has none."""
    if law not in GAINS:
        return {}
    orbital = _orbital_law(judge_scenario(scenario)) if scenario.magnetorquer else None
    table = _maker(law, GAINS[law][""], scenario, orbital)
    try:
        return table(scale_of(_with_control(scenario, table(UNIT), UNIT)))
    except ValueError:
        return {}


def written_out(scenario: Scenario) -> Scenario:
    """Return the scenario with every tunable gain as a number in `[control]`."""
    controller = controller_of(build_loop(scenario))
    numbers: dict[str, Any] = {}
    for key, place in scenario.law.declaration.tunable.items():
        if getattr(scenario.control, key) is None:
            value = np.asarray(number_at(controller, place))
            numbers[key] = float(value) if value.ndim == 0 else tuple(map(float, value))
    return scenario.with_keys("control", **numbers)


def with_larger_end_game(candidate: Candidate) -> Candidate | None:
    """Return the candidate with an end game as large as the settling tolerances allow.

    A larger oscillation stops a larger drift about the third axis, such as an inertia error causes
    in orbit. None where the candidate's own is as large or given, or the law has none.
    """
    control, law = candidate.scenario.control, controller_of(build_loop(candidate.scenario))
    law = law.settling if isinstance(law, PlannedSettling) else law
    settles = isinstance(law, OscillatorySettling | ThreeSlewSettling)
    if not settles or getattr(control, HOLDING_AMPLITUDE) is not None:
        return None
    end_game = law.fine.end_game
    limits = build_tolerances(candidate.scenario)
    # Two rates of this amplitude in phase; |w| of the tilt is half the angle.
    rate, tilt = limits.relative_rate / math.sqrt(2), limits.w * math.sqrt(2) * end_game.frequency
    tilt = tilt if end_game.roundness is None else tilt / LARGEST_FALL
    amplitude = float(f"{min(RATE_SHARE * float(rate), TILT_SHARE * float(tilt)):.3g}")
    if amplitude <= end_game.largest_amplitude:
        return None
    scenario = candidate.scenario.with_keys("control", **{HOLDING_AMPLITUDE: amplitude})
    return Candidate(f"{candidate.name}, larger end game", scenario)


Maker = Callable[[Scale], dict[str, Any]]
"""Function from a scale to a `[control]` table."""

UNIT = Scale((1.0, 1.0), 1.0)


def _orbital_law(judgement: Judgement) -> Law | None:
    """Return the law for magnetorquers if they decide, None otherwise."""
    laws = (known_law(name) for name in FLYABLE[judgement.laws].laws)
    return next((law for law in laws if law and law.declaration.takes_orbits), None)


def _tables(
    scenario: Scenario, names: list[str], law: str, orbital: Law | None
) -> Iterator[tuple[str, Maker]]:
    """Yield names of candidates of these laws, and the maker of each `[control]` table."""
    own = scenario.control.model_dump(exclude_none=True)
    for name in names:
        default = name == own["law"] and _is_default(own, name)
        is_own = name == own["law"] and (law == name or (law == QUICK and not default))
        if is_own and not default:
            yield f"{name}, as given", lambda scale: own
        elif is_own:
            yield name, _own_maker(scenario, orbital)
        if is_own and default:
            continue
        for variant, gains in GAINS.get(name, {}).items():
            yield name + variant, _maker(name, gains, scenario, orbital)
        if not is_own and name not in GAINS:
            yield name, lambda scale, name=name: {"law": name}


def _is_default(own: Mapping[str, Any], name: str) -> bool:
    """Whether a `[control]` table has the gains that a candidate of that law would have."""
    law = known_law(name)
    return law is not None and not any(own.get(key) is not None for key in law.declaration.tunable)


def _own_maker(scenario: Scenario, orbital: Law | None) -> Maker:
    """Return the maker of the `[control]` table of the scenario itself."""
    own = scenario.control.model_dump(exclude_none=True)
    return lambda scale: own | _period(scenario, known_law(own["law"]), scale, orbital)


def _period(
    scenario: Scenario, law: Law | None, scale: Scale, orbital: Law | None
) -> dict[str, float]:
    """Return the `period_s` of a law's table, which only a sampled law has."""
    if law is None or not law.declaration.sampled:
        return {}
    return {"period_s": control_period(scenario, law, scale, orbital)}


def _maker(name: str, gains: Gains, scenario: Scenario, orbital: Law | None) -> Maker:
    """Return the maker of the table of a built-in law, with the model of the scenario."""
    law, own = known_law(name), scenario.control.model_dump(exclude_none=True)
    assert law is not None
    rates, numbers = gains
    has_model = law.declaration.has_model and "model" in own
    model = {"model": own["model"]} if has_model else {}

    def table(scale: Scale) -> dict[str, Any]:
        units = {"k4": scale.moment / scale.time, "attitude_weight_N_m": scale.torque}
        scaled_gains = {
            key: float(f"{value * units.get(key, 1 / scale.time):.4g}")
            for key, value in rates.items()
        }
        period = _period(scenario, law, scale, orbital)
        return {"law": name, **numbers, **model, **period, **scaled_gains}

    return table


def _scenario_or_reason(
    scenario: Scenario, table: Maker, complete: Callable[[Scenario, Scale], Scenario]
) -> Scenario | str:
    """Return the completed scenario under a law, or the reason why the law does not fit."""
    try:
        scale = scale_of(_with_control(scenario, table(UNIT), UNIT))
        complete_scenario = complete(_with_control(scenario, table(scale), scale), scale)
        build(complete_scenario)
        return complete_scenario
    except ValidationError as error:
        messages = (f"{key_of(one.location)} {one.message}" for one in issues_of(error))
        return "; ".join(dict.fromkeys(messages))
    except ValueError as error:
        return str(error).rstrip(".")


def _with_control(scenario: Scenario, control: dict[str, Any], scale: Scale) -> Scenario:
    """Return the scenario under a law, with integration steps and save times that suit it."""
    data = scenario.model_dump(exclude_none=True)
    law = known_law(control["law"])
    if control["law"] != data["control"]["law"]:
        data.pop("tuning", None)
        data["simulation"].pop("solver", None)
        data["simulation"].pop("coordinates", None)
    data["control"] = control
    table = data["simulation"]
    solver = table.get("solver", {})
    steps_given = bool(solver.keys() & {"name", *SOLVER_KEYS})
    if law is not None and law.declaration.sampled:
        period = control["period_s"]
        save = period * max(1, round(table["save_every_s"] / period))
        table["save_every_s"] = save
        table["duration_s"] = math.ceil(table["duration_s"] / save - 1e-9) * save
        quick = period <= QUICK_PERIOD * scale.time and not scenario.thruster
        if quick and not steps_given:
            table["solver"] = {**solver, "name": "bosh3", "substeps": 1}
    elif not steps_given:
        table["solver"] = {**solver, "rtol": 1e-9, "atol": 1e-10, "min_step_s": 1e-6}
    return Scenario.model_validate(data)


def required_law_to_design(own: str, law: str | None = None) -> str:
    """Return the law to design: `law`, or a scenario's `own` law, or `ALL` or `QUICK`.

    Raises `ArgumentError` for an unknown law or one that aims at no attitude.
    """
    name = own if law is None else law
    choices = f"a law ({', '.join(GAINS)}), {ALL} or {QUICK}"
    declaration = None if name in (ALL, QUICK) else required_law(name, choices).declaration
    if declaration is None or (declaration.regulates_attitude and declaration.torques):
        return name
    if law is None:
        rule = f"must be given, as {own}, the scenario's own, aims at no attitude: {choices}"
        raise ArgumentError("law", rule, "nothing")
    raise ArgumentError("law", f"must be one that aims at an attitude: {choices}", law)
