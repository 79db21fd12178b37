"""Constants of the Earth, circular orbits, and dates."""

import math
import re

import numpy as np

from jaxsat.core.errors import ArgumentError

EARTH_GRAVITY = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, equatorial, WGS 84
EARTH_OBLATENESS = 1.08262668e-3  # J2, EGM96

MAX_ECCENTRICITY = 0.9
"""Largest eccentricity for which Kepler's equation is solved."""


def circular_orbit_rate(altitude: float) -> float:
    """Return the two-body rate ω0 of a circular orbit around the Earth, rad/s; `altitude` in m."""
    if not altitude > -EARTH_RADIUS:
        raise ArgumentError("altitude", "must be above the Earth's centre", altitude)
    return math.sqrt(EARTH_GRAVITY / (EARTH_RADIUS + altitude) ** 3)


EPOCH_FORM = "a date and time in UTC such as 2026-03-20T12:00:00, without another zone"

_EPOCH = re.compile(
    r"(\d{4}-\d\d-\d\dT(?:[01]\d|2[0-3]):[0-5]\d(?::[0-5]\d)?)(?:\.(\d{1,9}))?Z?", re.ASCII
)
"""Pattern of an epoch; a leap second (60) is excluded."""

_LEAP_SECOND = re.compile(r"(T\d\d:\d\d):60")

_FIRST_YEAR, _LAST_YEAR = "1678", "2262"


IGRF_DATES = np.datetime64("1900-01-01"), np.datetime64("2030-01-01")
"""First and last date of the IGRF-14."""


def epoch_of(text: str) -> np.datetime64:
    """Parse an epoch to its last decimal. Raises `ArgumentError` for an invalid text."""
    match = _EPOCH.fullmatch(text.strip())
    if match is None and _EPOCH.fullmatch(_LEAP_SECOND.sub(r"\1:59", text.strip())):
        raise ArgumentError("epoch", f"must be {EPOCH_FORM}, and no leap second", text)
    if match is None:
        raise ArgumentError("epoch", f"must be {EPOCH_FORM}", text or "nothing")
    try:
        begin = np.datetime64(match[1], "s")
    except ValueError:  # such as February 30
        raise ArgumentError("epoch", f"must be {EPOCH_FORM}", text) from None
    digits = (match[2] or "").ljust(9, "0")
    if digits.endswith("000"):  # microseconds reach beyond all years, nanoseconds to 2262
        return begin + np.timedelta64(int(digits[:6]), "us")
    if not _FIRST_YEAR < match[1] < _LAST_YEAR:
        raise ArgumentError("epoch", f"must be {EPOCH_FORM}, with at most six decimals", text)
    return begin + np.timedelta64(int(digits), "ns")


def sidereal_angle(epoch: np.datetime64) -> float:
    """Compute Greenwich mean sidereal time at an epoch, rad from 0 to 2π.

    The expression of 1982 (Aoki and others, Astronomy and Astrophysics 105, 1982, pages 359-361),
    with UTC for UT1: they differ by less than 0.9 s, 7e-5 rad.
    """
    seconds = (epoch - np.datetime64("2000-01-01T12:00:00")) / np.timedelta64(1, "s")
    days, centuries = seconds / 86400, seconds / 86400 / 36525
    more = 67310.54841 + (8640184.812866 + (0.093104 - 6.2e-6 * centuries) * centuries) * centuries
    turns = days % 1.0 + more / 86400
    return float(2 * np.pi * (turns % 1.0))
