"""Place in a circular orbit, and the field of a tilted dipole by the slope of its potential."""

import numpy as np
from scipy.spatial.transform import Rotation

GM = 3.986004418e14
EARTH_ROTATION = 7.292115e-5
G10, G11, H11 = -29404.8e-9, -1450.9e-9, 4652.5e-9
A = 6371.2e3


def place(t, rate, inclination, node, latitude):
    """Return position (m) and velocity (m/s) in inertial axes."""
    plane = Rotation.from_euler("ZXZ", [node, inclination, latitude + rate * t])
    radius = np.cbrt(GM / rate**2)
    return radius * plane.apply([1, 0, 0]), rate * radius * plane.apply([0, 1, 0])


def orbit_axes(position, velocity):
    """Return the orbit frame's axes as rows: along the velocity, minus the normal, to the Earth."""
    z = -position / np.linalg.norm(position)
    x = velocity / np.linalg.norm(velocity)
    return np.array([x, np.cross(z, x), z])


def potential(place_on_earth):
    """Return the potential of the IGRF's first degree, T m, in axes that turn with the Earth."""
    r = np.linalg.norm(place_on_earth)
    polar = np.arccos(place_on_earth[2] / r)
    east = np.arctan2(place_on_earth[1], place_on_earth[0])
    harmonic = G10 * np.cos(polar) + (G11 * np.cos(east) + H11 * np.sin(east)) * np.sin(polar)
    return A * (A / r) ** 2 * harmonic


def field(position, greenwich):
    """Return minus the gradient of the potential in inertial axes, T; good to about 1e-9 of it."""
    earth = Rotation.from_euler("Z", greenwich)
    here, step = earth.inv().apply(position), 100.0
    slope = [
        (potential(here + step * e) - potential(here - step * e)) / (2 * step) for e in np.eye(3)
    ]
    return -earth.apply(slope)


def lever(centre, force):
    """Return the torque of a force at a place, component by component."""
    x, y, z = centre
    fx, fy, fz = force
    return np.array([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx])
