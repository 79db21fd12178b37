"""Cautions about thrusters and wheels that contribute to no torque that the law commands."""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.core.allocation import BASIS_TOLERANCE, least_squares_map
from jaxsat.scenario.derived import command_torques, ideal_shares
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.parts.named import names_of
from jaxsat.scenario.parts.torque_makers import TorqueMakers, signs
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tables import working_axes


def idle_actuators(scenario: Scenario) -> Iterator[Issue]:
    """Yield cautions about idle actuators; under three torques only ideal thrusters can be idle."""
    law = scenario.law.declaration
    if law.torques == 2 and not law.commands_actuators:
        yield from _idle_thrusters(scenario)
        yield from _idle_wheels(scenario)
    if law.torques and scenario.actuators is None:
        yield from _idle_ideal_thrusters(scenario, law.torques)


def _idle_thrusters(scenario: Scenario) -> Iterator[Issue]:
    makers = TorqueMakers.of(scenario)
    working = [place for place, one in enumerate(makers.thrusters) if not one.failed]
    if not working or makers.relieved:
        return
    remainder = makers.remainder
    if not remainder.any():
        message = (
            "should leave the thrusters a torque to make: the wheels make all that the law "
            f"commands and thrusters do not unload them, so that none of {len(working)} ever fires"
        )
        yield Issue(("thruster",), message)
        return
    torque, _, command = command_torques(scenario)
    owners = np.array([place for place in working for _ in signs(makers.thrusters[place])])
    busy = owners[columns_in_use(torque, command @ remainder)]
    idle = [place for place in working if place not in busy]
    names = names_of(makers.thrusters)
    yield from _issues(scenario, ("thruster",), (names[place] for place in idle))


def _idle_ideal_thrusters(scenario: Scenario, torques: int) -> Iterator[Issue]:
    """Yield a caution about idle `thruster_torque_axes`, which share what wheels do not make at
    all.

    The shares are fixed; thrusters that could replace others count as used.
    """
    table = scenario.spacecraft
    axes = working_axes(table.thruster_torque_axes or (), table.failed_thrusters)
    remainder = TorqueMakers.of(scenario).remainder
    if not axes.size:
        return
    busy = np.zeros(axes.shape[1], bool)
    if remainder.any():
        shares = ideal_shares(scenario, axes) @ remainder
        busy = np.abs(shares).max(axis=1) > BASIS_TOLERANCE
        if torques == 3:
            both_ways = np.hstack([axes, -axes])
            busy |= columns_in_use(both_ways, remainder).reshape(2, -1).any(axis=0)
    numbers = range(1, len(table.thruster_torque_axes or ()) + 1)
    working = [number for number in numbers if number not in table.failed_thrusters]
    idle = [number for number, one in zip(working, busy, strict=True) if not one]
    yield from _issues(scenario, ("spacecraft", "thruster_torque_axes"), map(str, idle))


def _idle_wheels(scenario: Scenario) -> Iterator[Issue]:
    makers = TorqueMakers.of(scenario)
    working = np.array([place for place, one in enumerate(makers.wheels) if not one.failed], int)
    busy, names = np.zeros(working.size, bool), names_of(makers.wheels)
    if working.size and not makers.wheels_idle:
        axes, directions = makers.axes, makers.directions
        busy = columns_in_use(np.hstack([axes, -axes]), directions).reshape(2, -1).any(axis=0)
        shares = least_squares_map(axes, 2, directions=directions)
        busy |= np.abs(shares).max(axis=1) > BASIS_TOLERANCE
    yield from _issues(scenario, ("wheel",), (names[place] for place in working[~busy]))


def _issues(scenario: Scenario, location: Location, idle: Iterable[str]) -> Iterator[Issue]:
    names = ", ".join(idle)
    if names:
        message = (
            f'should each have a part in the torques that the law "{scenario.control.law}" '
            f"commands; never used: {names}"
        )
        yield Issue(location, message)


def columns_in_use(
    torque: Float[np.ndarray, "3 m"], command: Float[np.ndarray, "3 k"]
) -> Bool[np.ndarray, " m"]:
    """Mask of the pushing thrusters that contribute to some torque along the columns of `command`.

    `torque` has a column per thruster, at full thrust. The others could only cancel each other. The
    duties that make such torques are a cone; its edges belong to the fewest thrusters that cancel
    the components across the commands, at most one more than there are such directions.
    """
    torque = torque / np.sqrt(np.sum(torque**2, axis=0))
    directions, sizes, _ = np.linalg.svd(command)
    across = directions[:, int(np.sum(sizes > BASIS_TOLERANCE * sizes[0])) :].T @ torque
    rows, sizes, _ = np.linalg.svd(across)
    across = rows[:, sizes > BASIS_TOLERANCE].T @ across
    size = len(across) + 1
    groups = np.array(list(itertools.combinations(range(torque.shape[1]), size)), int)
    groups = groups.reshape(-1, size)
    duties = _cancelling(across[:, groups])
    duties *= np.sign(duties.sum(axis=1, keepdims=True))
    torques = np.einsum("igs,gs->ig", torque[:, groups], duties)
    edges = np.all(duties >= -BASIS_TOLERANCE, axis=1)
    edges &= np.abs(torques).max(axis=0) > BASIS_TOLERANCE
    in_use = np.zeros(torque.shape[1], bool)
    in_use[groups[edges][duties[edges] > BASIS_TOLERANCE]] = True
    return in_use


def _cancelling(across: Float[np.ndarray, "r g s"]) -> Float[np.ndarray, "g s"]:
    """Duties with which each group's torques cancel; r rows, s = r + 1 thrusters, r from 0 to 2.

    They are zero for a group with more than one solution.
    """
    if len(across) == 2:
        return np.cross(across[0], across[1])
    if len(across) == 1:
        return np.stack([across[0, :, 1], -across[0, :, 0]], axis=1)
    return np.ones(across.shape[1:])
