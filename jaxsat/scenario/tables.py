"""The tables of a scenario file apart from `[control]`."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Len, Lt
from jaxtyping import Float

from jaxsat.core.allocation import unit_columns
from jaxsat.core.ranges import (
    MAX_FIXED_STEPS,
    SECONDS,
    SETTLED_RATE,
    SETTLED_TURN,
    TORQUE_LIMIT,
    Range,
)
from jaxsat.scenario.quantities import (
    STAND_IN,
    Inertia,
    Number,
    Position3,
    Positive,
    ScenarioTable,
    TorqueAxes,
    UnitQuaternion,
    Vector2,
    Vector3,
    Whole,
    choice,
    quantity,
    within,
)

SolverName = Literal["euler", "midpoint", "heun", "ralston", "bosh3", "tsit5", "dopri5", "dopri8"]
EulerSequence = Literal[
    "xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz"
]
MRP = Range(-1e6, 1e6)
Seconds = Annotated[Number, within(SECONDS)]

MAX_SAMPLED_STEPS = 2**26
"""Largest number of steps of a run under a sampled law; a week at 0.1 s and four steps a period."""


class SpacecraftTable(ScenarioTable):
    """`[spacecraft]`: the rigid body, its thrusters and their failures."""

    inertia_kg_m2: Inertia = quantity(
        "Inertia in body axes: three principal moments, or three rows of a symmetric positive "
        "definite matrix",
        "kg m²",
    )
    thruster_torque_axes: TorqueAxes | None = quantity(
        "One row a thruster: direction cosines of its torque in body axes, (3) of the paper; "
        "each thruster makes a torque of either sign. Tables [[thruster]] have real ones",
        "1",
        None,
    )
    failed_thrusters: Annotated[tuple[Annotated[Whole, Ge(1), Le(1000)], ...], Len(0, 1000)] = (
        quantity("Numbers, from 1, of the thrusters that have failed", "1", ())
    )
    torque_limit_N_m: Annotated[Number, within(TORQUE_LIMIT)] | None = quantity(
        "Largest torque of each thruster; by default unlimited. With [[thruster]], the largest "
        "command about each axis; by default what the thrusters can make",
        "N m",
        None,
    )
    third_rate: Literal["free", "held"] = choice(
        'Whether ω3 moves as (37) has it ("free") or an ideal torque holds it at zero ("held")',
        "free",
    )
    centre_of_mass_m: Position3 | None = quantity(
        "The centre of mass, from the origin of position_m of thrusters, centre_m of panels, "
        "drag_centre_m and solar_centre_m; by default they are from the centre of mass",
        "m",
        **STAND_IN,
    )


def working_axes(
    axes: tuple[tuple[float, ...], ...], failed: Sequence[int]
) -> Float[np.ndarray, "3 m"]:
    """Unit columns of the working thrusters, from a row of direction cosines for each thruster."""
    rows = [row for number, row in enumerate(axes, 1) if number not in failed]
    return unit_columns(np.array(rows, dtype=float).reshape(-1, 3).T)


class InitialTable(ScenarioTable):
    """`[initial]`: the state at the start, the attitude in one of four forms."""

    w: Vector2 | None = quantity(
        "Tilt relative to the orbit frame, Tsiotras-Longuski parameters w1, w2", "1", None
    )
    z_rad: Number | None = quantity("Turn about the third axis", "rad", None)
    quaternion: UnitQuaternion | None = quantity(
        "Unit quaternion from orbit to body frame, scalar first", "1", None
    )
    euler_rad: Vector3 | None = quantity(
        "Euler angles from orbit to body frame, in the order of euler_sequence", "rad", **STAND_IN
    )
    euler_sequence: EulerSequence | None = choice(
        'Axes of the turned body about which the Euler angles turn, in order; "zyx" is yaw, pitch, '
        "roll",
        **STAND_IN,
    )
    mrp: Annotated[tuple[Annotated[Number, within(MRP)], ...], Len(3, 3)] | None = quantity(
        "Modified Rodrigues parameters from orbit to body frame, axis times tan(angle / 4)",
        "1",
        **STAND_IN,
    )
    omega_rad_s: Vector3 = quantity("Inertial angular velocity in body axes", "rad/s")


FIXED_STEP_KEYS = ("step_s",)
ADAPTIVE_STEP_KEYS = ("rtol", "atol", "min_step_s", "max_steps")
"""Keys of `[simulation.solver]` for one kind of steps alone."""


class SolverTable(ScenarioTable):
    """`[simulation.solver]`: the integration of the loop; the defaults suit the loop."""

    name: SolverName | None = choice("Explicit Runge-Kutta solver of diffrax", None)
    steps: Literal["adaptive", "fixed"] | None = choice(
        "Steps chosen to meet tolerances, or all equal", None
    )
    rtol: Annotated[Number, Gt(0), Le(1)] | None = quantity(
        "Relative tolerance of adaptive steps", "1", None
    )
    atol: Positive | None = quantity(
        "Absolute tolerance of adaptive steps, in the unit of each state; for a wheel's momentum, "
        "of that over the mean moment of inertia",
        "1",
        None,
    )
    min_step_s: Annotated[Number, Gt(0), Le(SECONDS.high)] | None = quantity(
        "Smallest adaptive step, taken whatever the error there", "s", None
    )
    max_steps: Annotated[Whole, Ge(1), Le(MAX_FIXED_STEPS)] | None = quantity(
        "Largest number of steps of a run with adaptive steps", "1", None
    )
    step_s: Seconds | None = quantity("Size of fixed steps", "s", None)
    substeps: Annotated[Whole, Ge(1), Le(10000)] | None = quantity(
        "Equal steps in each period of a sampled control law; by default as many as resolve the "
        "periodic torque, spin, nutation and viscous friction",
        "1",
        None,
    )
    rate_error_rad_s: Positive = quantity(
        "Largest error of the rate that equal steps may leave without a warning, by the estimate",
        "rad/s",
        1e-4,
    )
    attitude_error_rad: Positive = quantity(
        "Largest error of the attitude that equal steps may leave without a warning, likewise",
        "rad",
        1e-2,
    )

    @property
    def tolerance(self) -> dict[str, float | int]:
        """Given options of adaptive steps, by the names of `jaxsat.simulation.methods.adaptive`."""
        return {
            key.removesuffix("_s"): value
            for key in ADAPTIVE_STEP_KEYS
            if (value := getattr(self, key)) is not None
        }


class SettledTable(ScenarioTable):
    """`[settled]`: tolerances, and the time within them, for a case to count as settled."""

    tilt_rad: Annotated[Number, Gt(0), Lt(math.pi)] | None = quantity(
        "Largest angle between the third axes of body and orbit frame; by default 2 arctan 0.05, "
        "5.7 degrees",
        "rad",
        None,
    )
    turn_rad: Annotated[Number, Gt(0), Le(math.pi)] = quantity(
        "Largest turn about the third axis", "rad", SETTLED_TURN
    )
    rate_rad_s: Positive = quantity(
        "Largest rate relative to the orbit frame; of laws that only stop a rotation, largest "
        "rate beyond that of the orbit",
        "rad/s",
        SETTLED_RATE,
    )
    dwell_s: Seconds | None = quantity(
        "How long before the end it must have settled; by default a tenth of the duration",
        "s",
        None,
    )


class SimulationTable(ScenarioTable):
    """`[simulation]`: duration, saved samples, and the form in which the loop is integrated."""

    duration_s: Seconds = quantity("Simulated time", "s")
    save_every_s: Seconds = quantity("Time between saved samples", "s", 1.0)
    attitude: Literal["wz", "quaternion"] = choice(
        "Attitude parameters that are integrated", "quaternion"
    )
    coordinates: Literal["auto", "error", "torque"] = choice(
        'Integrate the rate errors as in (43) ("error") or the rates under the torque ("torque"); '
        '"auto" takes error coordinates for the printed three-axis law where they hold',
        "auto",
    )
    attitude_cost: Literal["rotation", "wz"] = choice(
        "How the cost of studies and tuning counts the attitude: "
        '"rotation", sin²(tilt/2) and 4 q3², or "wz", |w|² and z², without bound upside down',
        "rotation",
    )
    seed: Annotated[Whole, Ge(0), Le(2**63 - 1)] = quantity(
        "Seed of everything random; recorded with the results", "1", 0
    )
    solver: SolverTable = choice("Solver, steps and tolerances", SolverTable())
