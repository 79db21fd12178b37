"""`[[wheel]]`: reaction wheels."""

from typing import Annotated

import numpy as np

from jaxsat.core.allocation import least_squares_map, unit_columns, what_is_left
from jaxsat.core.ranges import FRICTION, MOMENT, TORQUE, TORQUE_LIMIT, WHEEL_MOMENTUM, WHEEL_NOISE
from jaxsat.scenario.quantities import Line, Number, Switch, Table, choice, quantity, within
from jaxsat.scenario.thruster_tables import Direction


class WheelTable(Table):
    """`[[wheel]]`: one reaction wheel."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)
    axis: Direction = quantity("Direction of its axis, body axes", "1")
    torque_limit_N_m: Annotated[Number, within(TORQUE_LIMIT)] | None = quantity(
        "Largest torque of its motor; by default unlimited", "N m", None
    )
    momentum_limit_N_m_s: Annotated[Number, within(WHEEL_MOMENTUM)] | None = quantity(
        "Largest momentum relative to the body; by default unlimited", "N m s", None
    )
    momentum_N_m_s: Annotated[Number, within(TORQUE)] = quantity(
        "Momentum relative to the body at the start", "N m s", 0.0
    )
    rotor_inertia_kg_m2: Annotated[Number, within(MOMENT)] | None = quantity(
        "Inertia of its rotor about the axis, part of spacecraft.inertia_kg_m2; its momentum then "
        "also changes as the body turns faster, and viscous friction needs it. Without it, 0 is "
        "assumed: the momentum changes by motor and friction alone",
        "kg m²",
        None,
    )
    viscous_friction_N_m_s: Annotated[Number, within(FRICTION)] = quantity(
        "Viscous friction, for each rad/s of the rotor", "N m s", 0.0
    )
    coulomb_friction_N_m: Annotated[Number, within(FRICTION)] = quantity(
        "Coulomb friction, which may hold the rotor at rest", "N m", 0.0
    )
    tachometer_noise_N_m_s: Annotated[Number, within(WHEEL_NOISE)] = quantity(
        "Standard deviation of white noise on the momentum that a sampled law is told, a sample",
        "N m s",
        0.0,
    )
    failed: Switch = choice(
        "Whether its motor has failed before the start, and the law knows it; it coasts", False
    )


def rotors(wheels: tuple[WheelTable, ...]) -> np.ndarray:
    """Σ J_w a aᵀ (3, 3) of all wheels, kg m²."""
    axes = wheel_axes(wheels)
    inertia = np.array([one.rotor_inertia_kg_m2 or 0.0 for one in wheels])
    return (inertia * axes) @ axes.T


def wheel_axes(wheels: tuple[WheelTable, ...]) -> np.ndarray:
    """A unit column for each wheel."""
    return unit_columns(np.array([one.axis for one in wheels], float).reshape(-1, 3).T)


def failed_wheels(wheels: tuple[WheelTable, ...]) -> tuple[int, ...]:
    """Numbers, from 1, of those that have failed."""
    return tuple(number for number, one in enumerate(wheels, 1) if one.failed)


def left_by_wheels(wheels: tuple[WheelTable, ...], torques: int) -> np.ndarray:
    """The part (torques, torques) of a command that the working wheels do not make."""
    axes = wheel_axes(tuple(one for one in wheels if not one.failed))
    return what_is_left(axes, least_squares_map(axes, torques))


def wheels_make_all(wheels: tuple[WheelTable, ...], torques: int) -> bool:
    """Whether the working wheels make every command, so that thrusters beside them do nothing."""
    return not left_by_wheels(wheels, torques).any()


def limit_of_wheels(wheels: tuple[WheelTable, ...], torques: int) -> float | None:
    """The largest command (N m) about all axes at once for which no working wheel is at its limit.

    Of what they make of it; None for no limit.
    """
    working = tuple(one for one in wheels if not one.failed)
    if torques not in (2, 3):
        return None
    shares = np.abs(least_squares_map(wheel_axes(working), torques)).sum(axis=1)
    limits = [
        one.torque_limit_N_m / share
        for one, share in zip(working, shares, strict=True)
        if one.torque_limit_N_m is not None and share > 1e-9
    ]
    return min(limits, default=None)
