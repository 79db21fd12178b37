"""The tables of a scenario file apart from `[control]`."""

import datetime
import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Len, Lt
from jaxtyping import Float
from pydantic import AfterValidator, BeforeValidator

from jaxsat.core.allocation import unit_columns
from jaxsat.core.earth import EARTH_RADIUS, circular_orbit_rate
from jaxsat.core.epoch import epoch_of, sidereal_angle
from jaxsat.core.ranges import (
    MAX_FIXED_STEPS,
    ORBIT_RATE,
    SECONDS,
    SETTLED_RATE,
    SETTLED_TURN,
    TORQUE_LIMIT,
    TURN,
    Range,
)
from jaxsat.scenario.quantities import (
    STAND_IN,
    Inertia,
    Line,
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

Relation = Literal["exact", "small-angle"]
SolverName = Literal["euler", "midpoint", "heun", "ralston", "bosh3", "tsit5", "dopri5", "dopri8"]
EulerSequence = Literal[
    "xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz"
]
MRP = Range(-1e6, 1e6)
Seconds = Annotated[Number, within(SECONDS)]

MAX_ALTITUDE = 1.5e6
"""km; farther out the Earth does not hold an orbit."""

MAX_SAMPLED_STEPS = 2**26
"""Steps of a run under a sampled law: a week at 0.1 s and four steps a period, and more."""


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
    """A unit column for each thruster left, of one row of direction cosines for each thruster."""
    rows = [row for number, row in enumerate(axes, 1) if number not in failed]
    return unit_columns(np.array(rows, dtype=float).reshape(-1, 3).T)


def _known_epoch(text: str) -> str:
    epoch_of(text)
    return text


def _as_text(value: object) -> object:
    """A date or a date and time of TOML as text."""
    if isinstance(value, datetime.date):
        return value.isoformat().replace("+00:00", "Z")
    return value


Epoch = Annotated[Line, BeforeValidator(_as_text), AfterValidator(_known_epoch)]


ELLIPTIC_KEYS = (
    "perigee_altitude_km",
    "apogee_altitude_km",
    "argument_of_perigee_rad",
    "mean_anomaly_rad",
    "j2",
)
"""Keys of `[orbit]` that say what an elliptic orbit is, the first of which makes it one."""


class OrbitTable(ScenarioTable):
    """`[orbit]`: a circular orbit, by rate or by altitude, or an elliptic one."""

    rate_rad_s: Annotated[Number, within(ORBIT_RATE)] | None = quantity(
        "Orbital rate ω0", "rad/s", None
    )
    altitude_km: Annotated[Number, Gt(0), Le(MAX_ALTITUDE)] | None = quantity(
        "Altitude above the Earth's equator, for the two-body rate", "km", None
    )
    perigee_altitude_km: Annotated[Number, Gt(0), Le(MAX_ALTITUDE)] | None = quantity(
        "Altitude of the perigee above the Earth's equator: an elliptic orbit, in which attitudes "
        "are relative to inertial axes; with apogee_altitude_km",
        "km",
        None,
    )
    apogee_altitude_km: Annotated[Number, Gt(0), Le(MAX_ALTITUDE)] | None = quantity(
        "Altitude of the apogee", "km", None
    )
    argument_of_perigee_rad: Annotated[Number, within(TURN)] | None = quantity(
        "Argument of perigee at the start; by default 0", "rad", None
    )
    mean_anomaly_rad: Annotated[Number, within(TURN)] | None = quantity(
        "Mean anomaly of the spacecraft at the start; by default 0", "rad", None
    )
    j2: bool | None = choice(
        "Whether node, perigee and mean anomaly move at the secular rates of the Earth's "
        "oblateness; by default false",
        None,
    )
    inclination_rad: Annotated[Number, within(TURN)] = quantity(
        "Inclination; this and the angles below matter to magnetic, drag and solar torques, and to "
        "inertial axes in `jaxsat convert`",
        "rad",
        0.0,
    )
    ascending_node_rad: Annotated[Number, within(TURN)] = quantity(
        "Right ascension of the ascending node", "rad", 0.0
    )
    argument_of_latitude_rad: Annotated[Number, within(TURN)] = quantity(
        "Argument of latitude of the spacecraft at the start", "rad", 0.0
    )
    sidereal_angle_rad: Annotated[Number, within(TURN)] = quantity(
        "Right ascension of Greenwich at the start; that of the epoch where there is one",
        "rad",
        0.0,
    )
    epoch: Epoch | None = choice("UTC at the start, such as 2026-03-20T12:00:00", None)
    field: Literal["dipole", "igrf"] = choice(
        'The Earth\'s magnetic field: "dipole", the tilted dipole of 2020, or "igrf", the IGRF-14 '
        "at the epoch",
        "dipole",
    )
    relation: Relation = choice(
        'How the orbit frame\'s rate enters (11): "exact", or "small-angle" with C_bo ≈ I',
        "exact",
    )

    def rate(self) -> float:
        """ω0 of the reference frame, rad/s, given or by the altitude; 0 in an elliptic orbit."""
        if self.rate_rad_s is not None or self.altitude_km is None:
            return self.rate_rad_s or 0.0
        return circular_orbit_rate(1000 * self.altitude_km)

    def ellipse(self) -> tuple[float, float] | None:
        """Semi-major axis (m) and eccentricity of an elliptic orbit; None in a circular one."""
        if self.perigee_altitude_km is None or self.apogee_altitude_km is None:
            return None
        heights = (self.perigee_altitude_km, self.apogee_altitude_km)
        low, high = (EARTH_RADIUS + 1000 * height for height in heights)
        return (low + high) / 2, (high - low) / (high + low)

    def greenwich(self) -> float:
        """The right ascension of Greenwich at the start, rad, given or by the epoch."""
        if self.epoch is None:
            return self.sidereal_angle_rad
        return sidereal_angle(epoch_of(self.epoch))


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
"""Keys of `[simulation.solver]` that belong to steps of one kind alone."""


class SolverTable(ScenarioTable):
    """`[simulation.solver]`: how the loop is integrated; by default what suits the loop."""

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
        """What is given of adaptive steps, by the names of `jaxsat.simulation.methods.adaptive`."""
        return {
            key.removesuffix("_s"): value
            for key in ADAPTIVE_STEP_KEYS
            if (value := getattr(self, key)) is not None
        }


class SettledTable(ScenarioTable):
    """`[settled]`: within what, and for how long, a case counts as settled."""

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
    """`[simulation]`: how long, what to save, and in which form the loop is integrated."""

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
