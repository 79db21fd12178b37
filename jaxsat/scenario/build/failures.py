"""From a scenario to what strikes its thrusters in flight."""

import dataclasses
import math

import numpy as np

from jaxsat.core.declaration.failures import FailureKind, failure_kind
from jaxsat.scenario.parts.actuator import number_of
from jaxsat.scenario.parts.failures import FailureTable
from jaxsat.scenario.parts.thrusters import ThrusterTable, signs, working_torques
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft import Actuators, FailureEvents


def failing(scenario: Scenario, ideal: Actuators) -> Actuators:
    """Thrusters of `spacecraft.thruster_torque_axes` with what strikes those that work."""
    table = scenario.spacecraft
    if scenario.thruster or not scenario.failure:
        return ideal
    rows = range(1, len(table.thruster_torque_axes or ()) + 1)
    working = [number for number in rows if number not in table.failed_thrusters]
    axes = np.asarray(ideal.torque_axes)
    found = [(number_of(one.of, "thruster", rows), one) for one in scenario.failure]
    events = []
    for number, one in found:
        if number is None or number + 1 not in working:
            continue
        place, turned = working.index(number + 1), axes.copy()
        if one.turn_rad is not None:
            turned[:, place] = _rotated(turned[:, place], one.turn_rad)
        events.append((one, place, turned))
    return dataclasses.replace(ideal, failures=_events(events, None))


def thruster_failures(
    tables: tuple[FailureTable, ...], thrusters: tuple[ThrusterTable, ...]
) -> FailureEvents | None:
    """Events on working thrusters; those on one that has failed already change nothing.

    Kinds that strike one way of a two-sided thruster strike that which is declared.
    """
    events = []
    places = _places(thrusters)
    nominal = working_torques(thrusters)
    for table in tables:
        number = number_of(table.of, "thruster", thrusters)
        if number is None or not places[number]:
            continue
        turned = nominal.copy()
        if table.turn_rad is not None:
            for place in places[number]:
                turned[:, place] = _turned(thrusters[number], nominal[:, place], table.turn_rad)
        events.append((table, places[number][0], turned))
    partner = [place for both in places for place in reversed(both)]
    return _events(events, partner if any(len(both) > 1 for both in places) else None)


def _events(
    events: list[tuple[FailureTable, int, np.ndarray]], partner: list[int] | None
) -> FailureEvents | None:
    """Tables, which column each strikes, and the torques as it would turn them."""
    if not events:
        return None
    kinds = [failure_kind(FailureKind, table) for table, _, _ in events]
    return FailureEvents(
        thruster=[place for _, place, _ in events],
        at=[table.at_s for table, _, _ in events],
        kind=kinds,
        amount=[kind.amount(table) for kind, (table, _, _) in zip(kinds, events, strict=True)],
        turned=np.stack([turned for _, _, turned in events]),
        partner=partner,
    )


def _places(thrusters: tuple[ThrusterTable, ...]) -> list[list[int]]:
    """Columns of each thruster among those that work: none, one, or two of a two-sided one."""
    places, column = [], 0
    for one in thrusters:
        count = 0 if one.failed else len(signs(one))
        places.append(list(range(column, column + count)))
        column += count
    return places


def _turned(thruster: ThrusterTable, torque: np.ndarray, rotation: tuple[float, ...]) -> np.ndarray:
    """The torque (N m) once the force, or the torque itself, is turned by a rotation vector."""
    if thruster.position_m is None:
        return _rotated(torque, rotation)
    way = math.copysign(1.0, float(torque @ thruster.torque()))
    return np.cross(np.array(thruster.position_m), _rotated(way * thruster.force(), rotation))


def _rotated(vector: np.ndarray, rotation: tuple[float, ...]) -> np.ndarray:
    """A vector turned by a rotation vector, rad."""
    from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

    return Rotation.from_rotvec(rotation).apply(vector)
