"""Thrusters and wheels as plain arrays, the input of `judge` and `failure_table`."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.controllability.layout import Numbers, finite

LEVER_ROUNDING = 1e-9
"""Tolerance on a torque r × f relative to |r||f|, below which the force points at the centre."""


MOMENTUM_ROUNDING = 1e-12
"""Tolerance on a total momentum, relative to the sum of the sizes of its parts."""


def sum_of_momenta(momenta: Float[np.ndarray, "3 n"]) -> Float[np.ndarray, "3"]:
    """Return the sum of the columns; zero where columns cancel to round-off."""
    total = momenta.sum(axis=1)
    size = np.linalg.norm(momenta, axis=0).sum()
    return total if np.linalg.norm(total) > MOMENTUM_ROUNDING * size else np.zeros(3)


@dataclass(frozen=True, eq=False)
class ActuatorSet:
    """The torque of every thruster at full force, and the axis of every wheel.

    - `torques`: columns in N m, body axes; `two_sided` marks thrusters of both signs.
    - `forces`: columns in N, the force on the body with the torque; None where positions and
      directions are unknown.
    - `wheel_axes`: columns of any length; a wheel takes up momentum of either sign.
    - `momentum`: total angular momentum Jω + Σ a h at the start, N m s, body axes; without
      external torque it is conserved in inertial axes.
    - `stored`: momentum of each rotor about its axis, J_w (Ω + a·ω), N m s: its momentum h
      relative to the body plus J_w a·ω. Only a motor changes it.
    - `rotors`: inertia J_w of each rotor about its axis, kg m².
    - `coasting`: momentum Σ a h of the failed wheels, N m s, body axes. A dead motor leaves it
      unchanged until friction has stopped the wheel. `coasting_rotors` is Σ J_w a aᵀ of the failed
      wheels, kg m².
    - `target_turns`: whether the target attitude turns in inertial axes.
    """

    torques: Float[np.ndarray, "3 m"]
    two_sided: Bool[np.ndarray, " m"]
    forces: Float[np.ndarray, "3 m"] | None
    thrusters: tuple[str, ...]
    wheel_axes: Float[np.ndarray, "3 k"]
    wheels: tuple[str, ...]
    momentum: Float[np.ndarray, "3"]
    stored: Float[np.ndarray, " k"]
    rotors: Float[np.ndarray, " k"]
    coasting: Float[np.ndarray, "3"]
    coasting_rotors: Float[np.ndarray, "3 3"]
    target_turns: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all thrusters, then of all wheels."""
        return (*self.thrusters, *self.wheels)

    @property
    def columns(self) -> Float[np.ndarray, "3 n"]:
        """Torques of the thrusters, then axes of the wheels."""
        return np.concatenate([self.torques, self.wheel_axes], axis=1)

    def only(self, places: Sequence[int]) -> "ActuatorSet":
        """Return the actuators of these places in `names`; the other wheels coast.

        The total momentum does not change.
        """
        count = len(self.thrusters)
        coasting_wheels = [i - count for i in range(count, len(self.names)) if i not in places]
        axes = self._unit_axes[:, coasting_wheels]
        jets = [i for i in places if i < count]
        wheel_places = [i - count for i in places if i >= count]
        return dataclasses.replace(
            self,
            torques=self.torques[:, jets],
            two_sided=self.two_sided[jets],
            forces=None if self.forces is None else self.forces[:, jets],
            thrusters=tuple(self.thrusters[i] for i in jets),
            wheel_axes=self.wheel_axes[:, wheel_places],
            wheels=tuple(self.wheels[i] for i in wheel_places),
            stored=self.stored[wheel_places],
            rotors=self.rotors[wheel_places],
            coasting=sum_of_momenta(
                np.column_stack([self.coasting, axes * self.stored[coasting_wheels]])
            ),
            coasting_rotors=self.coasting_rotors + (axes * self.rotors[coasting_wheels]) @ axes.T,
        )

    @property
    def _unit_axes(self) -> Float[np.ndarray, "3 k"]:
        lengths = np.linalg.norm(self.wheel_axes, axis=0)
        return self.wheel_axes / np.where(lengths > 0, lengths, 1.0)

    @property
    def free_rotors(self) -> Float[np.ndarray, "3 3"]:
        """Σ J_w a aᵀ of all wheels, kg m²: the inertia that does not turn with the body."""
        axes = self._unit_axes
        return self.coasting_rotors + (axes * self.rotors) @ axes.T

    @property
    def once_stopped(self) -> "ActuatorSet":
        """The same actuators after friction has stopped the coasting wheels."""
        return dataclasses.replace(self, coasting=np.zeros(3), coasting_rotors=np.zeros((3, 3)))

    @property
    def with_wheels_still(self) -> "ActuatorSet":
        """The same actuators without momentum in any failed wheel."""
        return dataclasses.replace(self.once_stopped, stored=np.zeros_like(self.stored))


def actuator_set(
    torques: Numbers = ((), (), ()),
    *,
    two_sided: Sequence[bool] | bool = False,
    forces: Numbers | None = None,
    names: Sequence[str] | None = None,
    wheel_axes: Numbers = ((), (), ()),
    wheel_names: Sequence[str] | None = None,
    momentum: Numbers = (0.0, 0.0, 0.0),
    stored: Numbers | None = None,
    rotors: Numbers | None = None,
    target_turns: bool = False,
) -> ActuatorSet:
    """Check arrays and return an `ActuatorSet` of them.

    `torques` and `forces` (3, m), `wheel_axes` (3, k), `momentum` (3,), `stored` and `rotors` (k,),
    by default zeros; `two_sided` for all thrusters or for each. Names default to g1, g2, … and w1,
    w2, ….

    Raises ValueError or TypeError for a wrong shape, entries that are not finite, and names that do
    not match or repeat.
    """
    columns = _columns("torques", torques)
    count = columns.shape[1]
    pushes = None if forces is None else _columns("forces", forces)
    if pushes is not None and pushes.shape != columns.shape:
        raise ValueError(f"Argument `forces` must have shape (3, {count}), but got {pushes.shape}")
    signs = np.broadcast_to(np.asarray(two_sided, bool), (count,))
    axes = _columns("wheel_axes", wheel_axes)
    total = finite("momentum", momentum)[0]
    if total.shape != (3,):
        raise ValueError(f"Argument `momentum` must have shape (3,), but got {total.shape}")
    thrusters = _names("names", names, "g", count)
    wheels = _names("wheel_names", wheel_names, "w", axes.shape[1])
    if len({*thrusters, *wheels}) < len(thrusters) + len(wheels):
        raise ValueError(f"Actuators must have different names, but got {[*thrusters, *wheels]}")
    momenta, inertias = (
        _of_each(*x, len(wheels)) for x in (("stored", stored), ("rotors", rotors))
    )
    return ActuatorSet(
        columns,
        signs,
        pushes,
        thrusters,
        axes,
        wheels,
        total,
        momenta,
        inertias,
        np.zeros(3),
        np.zeros((3, 3)),
        target_turns,
    )


def thruster_torques(
    positions: Numbers, forces: Numbers, centre: Numbers = (0.0, 0.0, 0.0)
) -> Float[np.ndarray, "3 m"]:
    """Compute torques r × f (N m) of forces (3, m) in N at positions (3, m) in m about a centre.

    A torque that is round-off beside |r||f| is zero. Raises ValueError as `actuator_set` does.
    """
    push = _columns("forces", forces)
    lever = _columns("positions", positions) - finite("centre", centre)[0].reshape(3, 1)
    torques = np.cross(lever, push, axis=0)
    size = np.linalg.norm(lever, axis=0) * np.linalg.norm(push, axis=0)
    return np.where(np.linalg.norm(torques, axis=0) > LEVER_ROUNDING * size, torques, 0.0)


def _columns(name: str, values: Numbers) -> Float[np.ndarray, "3 m"]:
    array, _ = finite(name, values)
    if array.ndim != 2 or array.shape[0] != 3:
        raise ValueError(f"Argument `{name}` must have shape (3, m), but got {array.shape}")
    return array


def _of_each(name: str, values: Numbers | None, count: int) -> Float[np.ndarray, " k"]:
    numbers = finite(name, np.zeros(count) if values is None else values)[0]
    if numbers.shape != (count,):
        raise ValueError(f"Argument `{name}` must hold {count} numbers, but got {numbers.shape}")
    return numbers


def _names(name: str, labels: Sequence[str] | None, letter: str, count: int) -> tuple[str, ...]:
    if labels is None:
        return tuple(f"{letter}{number}" for number in range(1, count + 1))
    if len(labels) != count:
        raise ValueError(f"Argument `{name}` must hold {count} names, but got {len(labels)}")
    return tuple(labels)
