"""Rules that tie keys of `[orbit]` together, and to what acts there."""

from jaxsat.core.declaration.disturbances import needs_orbit
from jaxsat.core.earth import EARTH_RADIUS, MAX_ECCENTRICITY
from jaxsat.core.epoch import IGRF_DATES, epoch_of
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.tables import ELLIPTIC_KEYS
from jaxsat.scenario.wording import shown


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
"""Keys for circular orbits alone, what they must be in another, and what to take there."""


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
