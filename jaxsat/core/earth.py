"""The Earth, and circular orbits around it."""

import math

EARTH_GRAVITY = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, equatorial, WGS 84
EARTH_OBLATENESS = 1.08262668e-3  # J2, EGM96

MAX_ECCENTRICITY = 0.9
"""Up to which Kepler's equation is solved."""


def circular_orbit_rate(altitude: float) -> float:
    """Two-body angular rate ω0 of a circular orbit around the Earth, rad/s; `altitude` in m."""
    if not altitude > -EARTH_RADIUS:
        raise ValueError(
            f"Argument `altitude` must be above the Earth's centre, but got {altitude}."
        )
    return math.sqrt(EARTH_GRAVITY / (EARTH_RADIUS + altitude) ** 3)
