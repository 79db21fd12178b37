"""Conditions under which a scenario's requirements are verified by many cases."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS, EFFECTORS
from jaxsat.core.declaration.failures import FRACTION
from jaxsat.core.errors import JaxsatError
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build
from jaxsat.scenario.parts.named import names_of
from jaxsat.simulation.loops import AbstractLoop, failures_of
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


def conditions_of(
    scenario: Scenario, failures: bool, pairs: bool = False
) -> tuple[list[Condition], list[str]]:
    """Return the scenario's own dispersions, with `failures` also those with one failing actuator.

    There is one condition with failures for each kind of actuator whose failures the scenario does
    not draw itself; with `pairs` also one for each two kinds, of which two actuators fail. The
    second result has sentences on conditions that cannot be tried.
    """
    conditions = [Condition(DISPERSED, "dispersed", scenario)]
    which = "of single actuators " if pairs else ""
    obstacles = (
        [] if failures else [f"Failures {which}besides those of the scenario were not tried."]
    )
    working = [one for one in ACTUATORS if _working(scenario, one)]
    kinds = [one for one in working if not _draws(scenario, one)]
    if pairs and len(kinds) < len(working):
        names = " or a ".join(one.name for one in working if one not in kinds)
        obstacles.append(
            f"Pairs with a {names} were not tried: the scenario draws its failures itself."
        )
    groups = [(one,) for one in kinds] if failures else []
    groups += _pairs(scenario, kinds) if pairs else []
    for group in groups:
        what = _group_text(group)
        try:
            failing = with_failures(scenario, group)
        except JaxsatError as error:
            reason = " ".join(str(error).split())
            obstacles.append(f"Flights in which {what} were not tried: {reason}")
            continue
        name = "-".join(one.name for one in group)
        name += "-fails" if len(group) == 1 else "-fail"
        conditions.append(Condition(name, f"dispersed, and {what}", failing))
    return conditions, obstacles


def _pairs(
    scenario: Scenario, kinds: Sequence[ActuatorDeclaration]
) -> list[tuple[ActuatorDeclaration, ...]]:
    """Return every two kinds of actuators; a kind with itself if it has two that work."""
    every = itertools.combinations_with_replacement(kinds, 2)
    return [two for two in every if two[0] is not two[1] or len(_working(scenario, two[0])) > 1]


def _group_text(group: Sequence[ActuatorDeclaration]) -> str:
    """Return the text "one wheel fails", "two wheels fail" or "a thruster and a wheel fail"."""
    names = [one.name for one in group]
    if len(names) == 1:
        return f"one {names[0]} fails"
    return f"two {names[0]}s fail" if len({*names}) == 1 else f"a {' and a '.join(names)} fail"


def with_failures(scenario: Scenario, group: Sequence[ActuatorDeclaration]) -> Scenario:
    """Return the scenario in which an actuator of each kind in `group` fails in each case.

    A kind that is there twice fails twice, the same actuator in some cases. `group` has the order
    of `ACTUATORS`. Device, kind, time and amount are drawn: every device and every kind with equal
    weights, the time within the first half of the run, a fraction from 0.1 to 0.9. Kinds with
    another amount than a fraction are left out; failures of sensors stay. Raises `ScenarioError` or
    `BuildError` where the spacecraft or its law do not support such failures.
    """
    data = scenario.model_dump(exclude_none=True, exclude={"tuning"})
    end = LAST * scenario.simulation.duration_s
    pairs = zip(scenario.failure, data.get("failure", ()), strict=True)
    data["failure"] = [
        *(table for one, table in pairs if one.of_sensor),
        *(
            {
                "of": f"{one.name} {_working(scenario, one)[group[:place].count(one)]}",
                "at_s": end,
                "kind": one.drawn[0].text,
            }
            for place, one in enumerate(group)
        ),
    ]
    left_out = ("failure_", "failed_", "case", "point")
    own = {k: v for k, v in data["dispersion"].items() if not k.startswith(left_out)}
    data["dispersion"] = own
    loop = build(validated(data, scenario.title)).loop
    data["dispersion"] = own | {
        "failure_kind": _any_kinds(loop),
        "failure_amount": _uniform(LEAST_AMOUNT, MOST_AMOUNT),
        "failure_time_s": _uniform(0.0, end),
    }
    for one in group:
        number = one.failed_quantity.name
        most = float(np.max(np.asarray(limits_of(number, False, loop).high)))
        data["dispersion"][number] = _any_working(scenario, one, most)
    return validated(data, f"{scenario.title}: {_group_text(group)}")


def _any_kinds(loop: AbstractLoop) -> Mapping[str, Any]:
    """Return the distribution of the kind of each failure: those that a study of this loop can
    draw, without amount or with a fraction."""
    kinds_of = {one.name: one.drawn for one in ACTUATORS}
    failing = [kinds_of[one.part] for one in failures_of(loop) for _ in range(one.count)]
    high = np.asarray(limits_of("failure_kind", False, loop).high)
    kinds = [
        [int(kind) for kind in one if kind <= most and kind.amounts in ((), (FRACTION,))]
        for one, most in zip(failing, np.broadcast_to(high, len(failing)), strict=True)
    ]
    longest = max(map(len, kinds))
    more = [longest - len(one) for one in kinds]
    return {
        "distribution": "discrete",
        "values": [one + one[:1] * n for one, n in zip(kinds, more, strict=True)],
        "weights": [[1] * len(one) + [0] * n for one, n in zip(kinds, more, strict=True)],
    }


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
