"""`[orbit]`: an orbit, the epoch, and the magnetic field; rules across its keys."""

import datetime
from typing import Annotated, Literal

from annotated_types import Gt, Le
from pydantic import AfterValidator, BeforeValidator

from jaxsat.core.declaration.disturbances import needs_orbit
from jaxsat.core.earth import (
    EARTH_RADIUS,
    IGRF_DATES,
    MAX_ECCENTRICITY,
    circular_orbit_rate,
    epoch_of,
    sidereal_angle,
)
from jaxsat.core.ranges import ORBIT_RATE, TURN
from jaxsat.scenario.quantities import (
    Line,
    Number,
    Relation,
    ScenarioTable,
    choice,
    quantity,
    within,
)
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown

MAX_ALTITUDE = 1.5e6
"""Largest altitude, km; farther out the Earth does not hold an orbit."""


def _known_epoch(text: str) -> str:
    epoch_of(text)
    return text


def _as_text(value: object) -> object:
    """Return a date or date-time of TOML as text."""
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
"""Keys of `[orbit]` that define an elliptic orbit; the first one selects it."""


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
        'How the orbit frame\'s rate enters (11): "exact", or "small-angle" with C_bo ≈ I', "exact"
    )

    def rate(self) -> float:
        """ω0 of the reference frame, rad/s, given or from the altitude; 0 in an elliptic orbit."""
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
        """Right ascension of Greenwich at the start, rad, given or from the epoch."""
        if self.epoch is None:
            return self.sidereal_angle_rad
        return sidereal_angle(epoch_of(self.epoch))


@rule("orbit.rate_rad_s", "orbit.altitude_km", "orbit.perigee_altitude_km")
def _one_orbit(rate, altitude, perigee):
    if rate is None and altitude is None and perigee is None:
        message = "must be given in rad/s, or altitude_km or perigee_altitude_km, got none of them"
        yield at("orbit.rate_rad_s", message, True)
    if rate is not None and altitude is not None:
        yield at("orbit.altitude_km", f"must not be given with rate_rad_s, got {shown(altitude)}")


@rule("orbit.rate_rad_s", "orbit.altitude_km", *(f"orbit.{key}" for key in ELLIPTIC_KEYS))
def _one_ellipse(rate, altitude, perigee, apogee, *others):
    if perigee is None:
        for key, value in zip(ELLIPTIC_KEYS[1:], (apogee, *others), strict=True):
            if value is not None:
                message = f"must be given with perigee_altitude_km alone, got {shown(value)}"
                yield at(f"orbit.{key}", message)
        return
    for key, value in (("rate_rad_s", rate), ("altitude_km", altitude)):
        if value is not None:
            yield at(f"orbit.{key}", f"must not be given with perigee_altitude_km, got {value}")
    if apogee is None:
        yield at("orbit.apogee_altitude_km", "must be given with perigee_altitude_km", True)
        return
    radius = EARTH_RADIUS / 1000
    most = (radius + perigee) * (1 + MAX_ECCENTRICITY) / (1 - MAX_ECCENTRICITY) - radius
    if not perigee <= apogee <= most:
        yield at(
            "orbit.apogee_altitude_km",
            f"must be from perigee_altitude_km, {shown(perigee)}, to {most:.6g} km, of "
            f"eccentricity {MAX_ECCENTRICITY}, got {shown(apogee)}",
        )


CIRCULAR_ONLY = (
    ("orbit.argument_of_latitude_rad", 0.0, "argument_of_perigee_rad and mean_anomaly_rad"),
    ("orbit.field", "dipole", '"dipole"'),
    ("disturbance.drag_density_kg_m3", 0.0, "no drag, whose density is that of one altitude"),
    ("magnetorquer", (), "no magnetorquers, whose laws take the orbit for a circle"),
)
"""Keys for circular orbits alone, their only values in an elliptic one, and the alternative."""


@rule("orbit.perigee_altitude_km", *(key for key, _, _ in CIRCULAR_ONLY))
def _ellipse_is_supported(perigee, *values):
    for (key, allowed, instead), value in zip(CIRCULAR_ONLY, values, strict=True):
        if perigee is not None and value != allowed:
            got = f"{len(value)} tables" if isinstance(value, tuple) else shown(value)
            yield at(key, f"must have {instead} in an elliptic orbit, got {got}")


@rule("orbit.epoch", "orbit.sidereal_angle_rad")
def _one_angle_of_greenwich(epoch, angle):
    if epoch is not None and angle:
        yield at("orbit.sidereal_angle_rad", f"must not be given with epoch, got {shown(angle)}")


@rule("orbit.field", "orbit.epoch")
def _epoch_of_the_igrf(field, epoch):
    if field != "igrf":
        return
    first, last = IGRF_DATES
    if epoch is None:
        yield at("orbit.epoch", 'must be given with field = "igrf", got nothing', True)
    elif not first <= epoch_of(epoch) <= last:
        yield at("orbit.epoch", f'must be from {first} to {last} with field = "igrf", got {epoch}')


@rule("orbit.rate_rad_s", "orbit.field")
def _orbit_in_the_igrf(rate, field):
    for finding in needs_orbit("orbit.field", 'field = "igrf"').check(rate, field == "igrf"):
        yield at(*finding)
