"""Conditions under which a scenario's requirements are verified by many cases."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS, EFFECTORS
from jaxsat.core.declaration.failures import FRACTION, AbstractFailureKind
from jaxsat.core.errors import JaxsatError
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build
from jaxsat.scenario.parts.actuator import names_of
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.studies.dispersion_problems import limits_of
from jaxsat.synthesis.comparison.acceptance import validated

DISPERSED = "dispersed"
"""Name of the condition of the scenario's own `[dispersion]` table."""

LEAST_AMOUNT, MOST_AMOUNT = 0.1, 0.9
"""Limits of the drawn amount of a failure, a fraction."""

LAST = 0.5
"""Fraction of the duration within which failures strike."""


class Condition(NamedTuple):
    """A scenario with dispersions, the name of its files, and a description."""

    name: str
    text: str
    scenario: Scenario


def conditions_of(scenario: Scenario, failures: bool) -> tuple[list[Condition], list[str]]:
    """Return the scenario's own dispersions, with `failures` also those with one failing actuator.

    There is one condition with failures for each kind of actuator whose failures the scenario does
    not draw itself. The second result has sentences on conditions that cannot be tried.
    """
    conditions = [Condition(DISPERSED, "dispersed", scenario)]
    obstacles = [] if failures else ["Failures besides those of the scenario were not tried."]
    for actuator in ACTUATORS if failures else ():
        if not _working(scenario, actuator) or _draws(scenario, actuator):
            continue
        try:
            failing = with_one_failure(scenario, actuator)
        except JaxsatError as error:
            reason = " ".join(str(error).split())
            obstacles.append(f"Failures of a {actuator.name} in flight were not tried: {reason}")
            continue
        text = f"dispersed, and one {actuator.name} fails"
        conditions.append(Condition(f"{actuator.name}-fails", text, failing))
    return conditions, obstacles


def with_one_failure(scenario: Scenario, actuator: ActuatorDeclaration) -> Scenario:
    """Return the scenario in which one actuator of this kind fails in each case of a study.

    Device, kind, time and amount are drawn: every device and every kind with equal weights, the
    time within the first half of the run, a fraction from 0.1 to 0.9. Kinds with another amount
    than a fraction are left out. Raises `ScenarioError` or `BuildError` where the spacecraft or its
    law do not support such a failure.
    """
    data = scenario.model_dump(exclude_none=True, exclude={"tuning"})
    end = LAST * scenario.simulation.duration_s
    first = _working(scenario, actuator)[0]
    event = {"of": f"{actuator.name} {first}", "at_s": end, "kind": actuator.drawn[0].text}
    data["failure"] = [event]
    own = {k: v for k, v in data["dispersion"].items() if not k.startswith(("failure_", "failed_"))}
    data["dispersion"] = own
    loop = build(validated(data, scenario.title)).loop
    kinds = [int(kind) for kind in _drawable(actuator, loop)]
    number = actuator.failed_quantity.name
    data["dispersion"] = own | {
        number: _any_working(scenario, actuator, _most(number, loop)),
        "failure_kind": _one_of(kinds),
        "failure_amount": _uniform(LEAST_AMOUNT, MOST_AMOUNT),
        "failure_time_s": _uniform(0.0, end),
    }
    return validated(data, f"{scenario.title}: one {actuator.name} fails")


def _drawable(actuator: ActuatorDeclaration, loop: AbstractLoop) -> Iterator[AbstractFailureKind]:
    """Yield the kinds that a study of this loop can draw, without amount or with a fraction."""
    most = _most("failure_kind", loop)
    for kind in actuator.drawn:
        if kind <= most and kind.amounts in ((), (FRACTION,)):
            yield kind


def _most(name: str, loop: AbstractLoop) -> float:
    return float(np.max(np.asarray(limits_of(name, False, loop).high)))


def _any_working(
    scenario: Scenario, actuator: ActuatorDeclaration, most: float
) -> Mapping[str, Any]:
    """Return the distribution of the index, up to `most`, of a device that works at the start.

    Failed thrusters have no index.
    """
    tables = getattr(scenario, actuator.name) if actuator in EFFECTORS else ()
    working = [number for number, one in enumerate(tables) if not one.failed]
    return _uniform(-0.5, most) if len(working) == len(tables) else _one_of(working)


def _one_of(values: Sequence[int]) -> Mapping[str, Any]:
    return {"distribution": "discrete", "values": values, "weights": [1] * len(values)}


def _uniform(low: float, high: float) -> Mapping[str, Any]:
    return {"distribution": "uniform", "low": low, "high": high}


def _working(scenario: Scenario, actuator: ActuatorDeclaration) -> list[str]:
    """Return the names of the devices of a kind that work at the start."""
    tables, body = getattr(scenario, actuator.name), scenario.spacecraft
    if tables or actuator.name != "thruster":
        return [name for one, name in zip(tables, names_of(tables), strict=True) if not one.failed]
    numbers = range(1, 1 + len(body.thruster_torque_axes or ()))
    return [str(number) for number in numbers if number not in body.failed_thrusters]


def _draws(scenario: Scenario, actuator: ActuatorDeclaration) -> bool:
    """Whether the scenario's own dispersions draw failures of this kind."""
    dispersion = scenario.dispersion
    return dispersion is not None and actuator.failed_quantity.name in dispersion.distributions
