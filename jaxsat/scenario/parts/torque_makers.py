"""Wheels and thrusters that make a law's torques: wheels first, thrusters the rest."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.core.allocation import (
    allocation_matrix,
    largest_torque,
    least_propellant,
    least_squares_map,
    plane_map,
    pushed_directions,
    require_all_ways,
    torque_directions,
    unit_columns,
    unmade_map,
)
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.scenario.tables import working_axes

MISSING = 1e-9
"""Part of a command, relative to the command, below which it is treated as made."""

UNBOUNDED = 1e9
"""Limit of a wheel without one, relative to the largest limit of the others."""

Tables = Sequence[Any]
"""Checked tables of one kind of actuator."""


@dataclass(frozen=True)
class TorqueMakers:
    """Tables `[[wheel]]` and `[[thruster]]`, and the declaration of the law that they serve.

    `wheels_idle`: whether working wheels make no torque, because thrusters make the two torques of
    the law, and wheels would make a part of them: no such law models their momentum.
    """

    wheels: Tables
    thrusters: Tables
    law: LawDeclaration
    wheels_idle: bool = False

    @staticmethod
    def of(scenario: Any) -> "TorqueMakers":
        """Return the torque makers of a checked scenario."""
        table, law = scenario.spacecraft, scenario.law.declaration
        ideal = working_axes(table.thruster_torque_axes or (), table.failed_thrusters)
        return TorqueMakers.among(scenario.wheel, scenario.thruster, ideal, law)

    @staticmethod
    def among(
        wheels: Tables, thrusters: Tables, ideal: Float[np.ndarray, "3 m"], law: LawDeclaration
    ) -> "TorqueMakers":
        """Return the torque makers, wheels idle where thrusters, or ideal ones along unit axes,
        should make what wheels make a part of."""
        makers = TorqueMakers(wheels, thrusters, law)
        if law.torques != 2 or not makers.working_wheels or makers.wheels_make_all:
            return makers
        return replace(makers, wheels_idle=_make_both(makers.pushes, ideal, law.any_plane))

    @property
    def working_wheels(self) -> Tables:
        """Wheels that have not failed before the start, and are not idle."""
        return [one for one in self.wheels if not (one.failed or self.wheels_idle)]

    @property
    def axes(self) -> Float[np.ndarray, "3 k"]:
        """Unit columns of the working wheels."""
        return wheel_axes(self.working_wheels)

    @property
    def pushes(self) -> Float[np.ndarray, "3 m"]:
        """Full-thrust torques (N m) of working thrusters, both directions of two-sided ones."""
        return working_torques(self.thrusters)

    @property
    def directions(self) -> Float[np.ndarray, "3 torques"]:
        """Directions about which the law commands wheels.

        They are `torque_directions` of working wheels in a plane under a law for any plane, else
        the first body axes. A law without commanded torques is treated as one that commands three.
        """
        axes = self.axes
        if self.law.any_plane and axes.size and np.linalg.matrix_rank(axes, tol=MISSING) == 2:
            return torque_directions(axes)
        return np.eye(3)[:, : self.law.torques or 3]

    @property
    def remainder(self) -> Float[np.ndarray, "torques torques"]:
        """Part of a command about `directions` that wheels do not make; all without wheels."""
        directions = self.directions
        if not self.wheels or self.wheels_idle:
            return np.eye(directions.shape[1])
        return left_by_wheels(self.wheels, directions.shape[1], directions)

    @property
    def wheels_make_all(self) -> bool:
        """Whether wheels make every command, so that thrusters beside them stay idle."""
        return bool(self.wheels) and not self.remainder.any()

    @property
    def thrusters_make_all(self) -> bool:
        """Whether thrusters make torques of either sign about all three axes by themselves."""
        return spans_all_ways(self.pushes)

    @property
    def all_ways(self) -> bool:
        """Whether wheels and thrusters together make torques of either sign about all axes."""
        axes = self.axes
        return spans_all_ways(np.concatenate([unit_columns(self.pushes), axes, -axes], axis=1))

    @property
    def two_wheels_fly(self) -> bool:
        """Whether wheels along two axes fly alone, whatever thrusters are beside them."""
        rank = np.linalg.matrix_rank(self.axes, tol=MISSING) if self.axes.size else 0
        return bool(self.law.commands_actuators and rank >= 2)

    @property
    def plane_flies(self) -> bool:
        """Whether thrusters fly by two torques under a law that commands each actuator.

        They do where nothing makes a third torque and no wheel has momentum; a wheel that works
        stays idle.
        """
        still = all(one.momentum_N_m_s == 0 for one in self.wheels)
        commands = self.law.commands_actuators and not self.two_wheels_fly
        return commands and still and not self.all_ways

    @property
    def torques_of_thrusters(self) -> tuple[int, bool]:
        """Number of torques that a law needs of thrusters, and whether two may be in any plane."""
        law = self.law
        if self.plane_flies:
            return 2, True
        return law.torques or 3, law.any_plane and not self.working_wheels

    @property
    def driven_directions(self) -> Float[np.ndarray, "3 k"]:
        """Unit columns of the torques that thrusters make in both senses, one for each axis where
        these are less than two."""
        try:
            return pushed_directions(self.pushes)
        except ValueError:
            return unit_columns(self.pushes)

    @property
    def together(self) -> bool:
        """Whether wheels and thrusters together make the torques of the law."""
        return self.law.torques == 3 or self.law.commands_actuators

    @property
    def relieved(self) -> bool:
        """Whether thrusters make the torque or momentum that wheels lack.

        Of two torques they make only the part that wheels do not make at all.
        """
        return bool(self.wheels and self.pushes.size and self.together)

    @property
    def wheel_limit(self) -> float | None:
        """Largest command (N m) about all axes at once that wheels make within their limits.

        The part that they do not make at all is ignored; None for no limit.
        """
        torque_limits = [one.torque_limit_N_m for one in self.working_wheels]
        largest = max((one for one in torque_limits if one is not None), default=None)
        if largest is None or self.law.torques not in (2, 3):
            return None
        axes, directions = self.axes, self.directions
        limits = np.array([UNBOUNDED * largest if one is None else one for one in torque_limits])
        shares = least_squares_map(axes, self.law.torques, directions=directions)
        most = largest_torque(axes, -limits, limits, axes @ shares)
        return most if most < largest * UNBOUNDED / 2 else None

    @property
    def limit_of_both(self) -> float:
        """Largest torque (N m) about all three axes that wheels and thrusters make together."""
        full = np.sqrt(np.sum(self.pushes**2, axis=0))
        unbounded = UNBOUNDED * full.max()
        limits = np.array([one.torque_limit_N_m or unbounded for one in self.working_wheels])
        columns = np.concatenate([unit_columns(self.pushes), self.axes], axis=1)
        return largest_torque(columns, np.r_[0 * full, -limits], np.r_[full, limits], np.eye(3))


def _make_both(
    pushes: Float[np.ndarray, "3 m"], ideal: Float[np.ndarray, "3 k"], any_plane: bool
) -> bool:
    """Whether thrusters make both torques of a law by themselves."""
    try:
        if pushes.size:
            command = plane_map(pushes, 2, any_plane)
            return bool(least_propellant(pushes, np.ones(pushes.shape[1]), command).size)
        return bool((torque_directions if any_plane else allocation_matrix)(ideal).size)
    except ValueError:
        return False


def spans_all_ways(torque: Float[np.ndarray, "3 m"]) -> bool:
    """Whether thrusters with these torques make some of either sign about all axes."""
    try:
        require_all_ways(torque)
    except ValueError:
        return False
    return True


def wheel_axes(wheels: Tables) -> Float[np.ndarray, "3 k"]:
    """Unit columns of the wheels."""
    return unit_columns(np.array([one.axis for one in wheels], float).reshape(-1, 3).T)


def left_by_wheels(
    wheels: Tables, torques: int, directions: np.ndarray | None = None
) -> Float[np.ndarray, "torques torques"]:
    """Part of a command that the working wheels do not make.

    The command is about the first body axes, or about `directions` (3, torques).
    """
    axes = wheel_axes([one for one in wheels if not one.failed])
    shares = least_squares_map(axes, torques, directions=directions)
    return unmade_map(axes, shares, directions)


def signs(thruster: Any) -> tuple[float, ...]:
    """Signs of a thruster's torque: 1 and, if it is two-sided, -1."""
    return (1.0, -1.0) if thruster.two_sided else (1.0,)


def working_torques(thrusters: Tables) -> Float[np.ndarray, "3 m"]:
    """Full-thrust torques (N m) of working thrusters, both directions of two-sided ones."""
    columns = [sign * one.torque() for one in thrusters if not one.failed for sign in signs(one)]
    return np.array(columns).reshape(-1, 3).T
