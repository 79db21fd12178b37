"""The Earth's magnetic field of the IGRF-14, anywhere and along a circular orbit.

`igrf14.shc` has the coefficients of the International Association of Geomagnetism and Aeronomy
(IAGA; https://doi.org/10.5281/zenodo.14012302; also by NOAA): every five years from 1900 to 2025,
and for 2030 extrapolated by secular variation. Between these dates they are linear in time.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import as_float
from jaxsat.core.earth import EARTH_GRAVITY, IGRF_DATES
from jaxsat.core.errors import ArgumentError
from jaxsat.core.once import latest, once
from jaxsat.core.package_files import text_of
from jaxsat.spacecraft.environment.orbit import (
    REFERENCE_RADIUS,
    AbstractMagneticField,
    AbstractPlace,
    CircularOrbit,
    place_on_circle,
)

DEGREE = 13
ORDERS = DEGREE + 1

EXACT = 32
"""Number of orbital phases, and of Earth angles, that determines this degree exactly."""

PLACES = 160
"""Number of orbital phases, and of Earth angles, in the table of `IgrfField`."""

Coefficients = Float[np.ndarray, "2 orders orders"]
"""g and h of degrees (rows) and orders (columns) from 0 on, T, Schmidt semi-normalised."""


@once
def _published() -> tuple[np.ndarray, Float[np.ndarray, "dates 2 orders orders"]]:
    """Return the dates of the published coefficients, and the coefficients, T."""
    text = text_of("jaxsat.spacecraft.environment", "igrf14.shc")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    dates = np.array([f"{float(year):.0f}-01-01" for year in lines[1].split()], "datetime64[us]")
    table = np.zeros((len(dates), 2, ORDERS, ORDERS))
    for line in lines[2:]:
        degree, order, *values = line.split()
        table[:, int(int(order) < 0), int(degree), abs(int(order))] = np.array(values, float)
    return dates, 1e-9 * table


def igrf_coefficients(date: np.datetime64) -> Coefficients:
    """Return the coefficients at a UTC date; raises `ArgumentError` beyond the IGRF-14."""
    first, last = IGRF_DATES
    if not first <= date <= last:
        raise ArgumentError("date", f"must be from {first} to {last}", date)
    dates, table = _published()
    late = min(int(np.searchsorted(dates, date, side="right")), len(dates) - 1)
    share = (date - dates[late - 1]) / (dates[late] - dates[late - 1])
    return table[late - 1] + share * (table[late] - table[late - 1])


def _recursion() -> Float[np.ndarray, "3 orders orders"]:
    """Return factors of degrees n - 1 and n - 2 in the recursion for n, and constants."""
    follow, drop, begin = np.zeros((3, ORDERS, ORDERS))
    begin[0, 0] = begin[1, 1] = 1.0
    for n in range(1, ORDERS):
        m = np.arange(n)
        size = np.sqrt(n**2 - m**2)
        follow[n, :n] = (2 * n - 1) / size
        drop[n, :n] = np.sqrt(np.maximum((n - 1) ** 2 - m**2, 0)) / size
        if n > 1:
            begin[n, n] = begin[n - 1, n - 1] * np.sqrt((2 * n - 1) / (2 * n))
    return np.stack([follow, drop, begin])


def _slopes() -> Float[np.ndarray, "orders orders"]:
    """Return the factors between the derivative of order m and the function of order m + 1."""
    n, m = np.mgrid[:ORDERS, :ORDERS]
    squares = np.maximum((n - m) * (n + m + 1), 0) / np.where(m == 0, 2, 1)
    return np.sqrt(squares)


RECURSION, SLOPES = _recursion(), _slopes()


def igrf_field(
    position: Float[Array | np.ndarray, "*shape 3"], coefficients: Coefficients
) -> Float[Array | np.ndarray, "*shape 3"]:
    """Return B (T) at a `position` (m) in Earth-fixed axes: z north, x to Greenwich.

    The array type, JAX or NumPy, is that of the position. B = -∇V,

        V = a Σ (a/r)ⁿ⁺¹ Σ (g C_m + h S_m) H_n^m(u),    C_m + i S_m = (s + i t)^m,

    (s, t, u) = position / r, a the `REFERENCE_RADIUS`. H_n^m is the Schmidt semi-normalised
    Legendre function over sin^m of the colatitude, a polynomial, so that no pole is special:
    Pines, AIAA Journal 11(11), 1973, pages 1508-1511.
    """
    xp = position.__array_namespace__()
    r = xp.sqrt(xp.sum(position**2, axis=-1))
    s, t, u = (position[..., axis] / r for axis in range(3))
    cosines, sines = _powers(xp, s, t)
    none = 0 * cosines[..., :1]
    lower_cosines = xp.concatenate([none, cosines[..., :-1]], axis=-1)
    lower_sines = xp.concatenate([none, sines[..., :-1]], axis=-1)
    rows = _functions(u[..., None])
    m, ratio, total = np.arange(ORDERS), REFERENCE_RADIUS / r, 0 * position
    along = 0 * r
    for n in range(1, ORDERS):
        g, h = coefficients[:, n]
        row, scale = rows[n], ratio ** (n + 2)
        higher = xp.concatenate([row[..., 1:], none], axis=-1)
        waves = g * cosines + h * sines
        parts = [
            m * row * (g * lower_cosines + h * lower_sines),
            m * row * (h * lower_cosines - g * lower_sines),
            SLOPES[n] * higher * waves,
        ]
        slope = xp.stack([xp.sum(part, axis=-1) for part in parts], axis=-1)
        total = total + scale[..., None] * slope
        along = along + scale * (n + 1) * xp.sum(row * waves, axis=-1)
    up = xp.stack([s, t, u], axis=-1)
    return (along + xp.sum(up * total, axis=-1))[..., None] * up - total


def _powers(xp: Any, s: Any, t: Any) -> tuple[Any, Any]:
    """Return real and imaginary parts of (s + i t)^m, m from 0 to the degree, along a last axis."""
    cosines, sines = [1 + 0 * s], [0 * s]
    for _ in range(DEGREE):
        c, d = cosines[-1], sines[-1]
        cosines.append(c * s - d * t)
        sines.append(c * t + d * s)
    return xp.stack(cosines, axis=-1), xp.stack(sines, axis=-1)


def _functions(u: Any) -> list[Any]:
    """Return H_n^m(u) of every order m along the last axis, for degrees n from 0 on."""
    rows = [RECURSION[2, 0] + 0 * u]
    for n in range(1, ORDERS):
        follow, drop, begin = RECURSION[:, n]
        rows.append(follow * u * rows[-1] - drop * (rows[-2] if n > 1 else 0.0) + begin)
    return rows


class IgrfField(AbstractMagneticField):
    """The IGRF-14 at a `date` (UTC) along the circular `orbit`, within 1e-6 of the field.

    In orbit axes the field is periodic in the argument of latitude and in the longitude of the
    node, a trigonometric polynomial of degree 13 in both, here a `table` of cubic B-splines, T,
    padded by three places in each so that interpolation needs no wrapping. Secular variation within
    a run is left out. Raises `ArgumentError` for a date that the IGRF-14 lacks.
    """

    orbit: AbstractPlace
    table: Float[Array, "phases turns 3"]
    first_degree: Vector

    def __init__(self, orbit: CircularOrbit, date: np.datetime64):
        g, h = igrf_coefficients(date)[:, 1]
        self.orbit, self.first_degree = orbit, as_float([g[1], h[1], g[0]])
        self.table = as_float(_splines(float(orbit.rate), float(orbit.inclination), date))

    @property
    def dipole(self) -> Vector:
        """The first degree at the date, T."""
        return self.first_degree

    def over(self, t: RealScalar, turn: RealScalar) -> Vector:
        """Return B in orbit axes, T, with the orbit at time `t` (s) and the Earth turned by `turn`
        (rad) since time zero: periodic in both."""
        orbit = self.circle
        phase, late = place_on_circle(orbit.argument_of_latitude + orbit.rate * t, PLACES)
        node, east = place_on_circle(orbit.node - orbit.sidereal_angle - turn, PLACES)
        near = jax.lax.dynamic_slice(self.table, (phase, node, 0), (4, 4, 3))
        rows = jnp.sum(jnp.stack(_weights(east))[None, :, None] * near, axis=1)
        return jnp.sum(jnp.stack(_weights(late))[:, None] * rows, axis=0)

    def sampled(
        self, t: Float[np.ndarray, "*#shape"], turn: Float[np.ndarray, "*#shape"]
    ) -> Float[np.ndarray, "*both 3"]:
        """Return `over` for broadcast NumPy arrays."""
        orbit, table = self.circle, np.asarray(self.table)
        phase, late = _place(float(orbit.argument_of_latitude) + float(orbit.rate) * t)
        node, east = _place(float(orbit.node) - float(orbit.sidereal_angle) - turn)
        total = np.zeros(3)
        for row, weight in enumerate(_weights(late)):
            for column, other in enumerate(_weights(east)):
                total = total + (weight * other)[..., None] * table[phase + row, node + column]
        return total


def _place(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return `place_on_circle` in NumPy."""
    place = np.mod(angle * (PLACES / (2 * np.pi)), PLACES)
    low = np.minimum(np.floor(place), PLACES - 1).astype(int)
    return low, place - low


def _weights(share: Any) -> list[Any]:
    """Return six times the weights of the overlapping cubic B-splines, at a share of the way
    between the middle two."""
    rest = 1 - share
    first, last = rest * rest * rest, share * share * share
    second, third = (4 - 3 * x * x * (2 - x) for x in (share, rest))
    return [first, second, third, last]


def _exact(
    radius: float, inclination: float, coefficients: Coefficients
) -> Float[np.ndarray, "phases turns 3"]:
    """Return B in orbit axes at equally spaced arguments of latitude and longitudes of the node."""
    turns = np.arange(EXACT) * 2 * np.pi / EXACT
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]
    east, north = np.cos(turns), np.sin(turns)
    ci, si = np.cos(inclination), np.sin(inclination)
    up = _vectors(east * c - north * s * ci, north * c + east * s * ci, s * si)
    forward = _vectors(-east * s - north * c * ci, -north * s + east * c * ci, c * si)
    normal = _vectors(north * si, -east * si, ci)
    field = igrf_field(radius * up, coefficients)
    return np.stack([np.sum(field * axis, axis=-1) for axis in (forward, -normal, -up)], axis=-1)


def _vectors(*parts: Any) -> Float[np.ndarray, "phases turns 3"]:
    return np.stack([np.broadcast_to(part, (EXACT, EXACT)) for part in parts], axis=-1)


@latest(8)
def _splines(
    rate: float, inclination: float, date: np.datetime64
) -> Float[np.ndarray, "phases turns 3"]:
    """Return the coefficients of B-splines divided by 36, T.

    They are the Fourier coefficients divided by the transform of a B-spline. The relative error of
    a wave of number p is that of its aliases, 2 (p / PLACES)^4.
    """
    radius = float(np.cbrt(EARTH_GRAVITY / rate**2))
    exact = _exact(radius, inclination, igrf_coefficients(date))
    waves = np.fft.fftfreq(EXACT, 1 / EXACT).astype(int)
    transform = np.sinc(waves / PLACES) ** 4
    spectrum = np.fft.fft2(exact, axes=(0, 1)) / (transform[:, None] * transform)[..., None]
    wide = np.zeros((PLACES, PLACES, 3), complex)
    wide[np.ix_(waves, waves)] = spectrum * (PLACES / EXACT) ** 2 / 36
    table = np.fft.ifft2(wide, axes=(0, 1)).real
    return np.pad(table, ((1, 2), (1, 2), (0, 0)), mode="wrap")
