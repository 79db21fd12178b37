"""Elliptic orbits against SciPy: the root of Kepler's equation, and integrated motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from jaxsat.core.attitude import DCM, Quaternion
from jaxsat.core.earth import EARTH_GRAVITY, EARTH_OBLATENESS, EARTH_RADIUS
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build_uncontrolled
from jaxsat.spacecraft.environment.disturbances import (
    GravityGradient,
    GravityGradientAt,
    SumOfDisturbances,
)
from jaxsat.spacecraft.environment.ellipse import EllipticOrbit, eccentric_anomaly
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from jaxsat.spacecraft.environment.orbital_torques import Sunlight
from oracle import orbital_torques as oracle

DAY = 86400.0
INERTIA = jnp.array([[10.0, 0.5, -0.2], [0.5, 12.0, 0.1], [-0.2, 0.1, 7.0]])
ELEMENTS = (26.6e6, 0.74, 1.107, 0.4, -1.5, 0.3, 2.1)
TURNED = DCM(Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix())
ALIGNED = Quaternion([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.5, 0.9])
def test_keplers_equation_and_its_derivatives(eccentricity):
    means = np.concatenate([np.linspace(-np.pi, np.pi, 101), [1e-12, 1e-6, 0.01]])

    def excess(angle, mean):
        return angle - eccentricity * np.sin(angle) - mean

    expected = np.array([brentq(excess, -4, 4, (mean,), 1e-15) for mean in means])
    e = jnp.array(eccentricity)
    found = jax.vmap(lambda mean: eccentric_anomaly(mean, e))(jnp.array(means))
    np.testing.assert_allclose(found, expected, atol=1e-13)
    slopes = jax.vmap(jax.grad(eccentric_anomaly, (0, 1)), (0, None))(jnp.array(means), e)
    slope = 1 - eccentricity * np.cos(expected)
    np.testing.assert_allclose(slopes[0], 1 / slope, rtol=1e-11)
    np.testing.assert_allclose(slopes[1], np.sin(expected) / slope, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize(
    "elements",
    [(26.6e6, 0.74, 1.107, 0.4, -1.5, 0.3), (6.9e6, 0.01, 1.7, 2, 1, -3), (24.4e6, 0.73, 0.1)],
)
def test_a_day_of_two_body_motion_integrated(elements):
    """The start is that of the orbit itself, its velocity by differences of both places."""
    orbit, times = EllipticOrbit(*elements), np.linspace(0, DAY, 25)
    start = jax.jvp(orbit.position, (jnp.array(0.0),), (jnp.array(1.0),))
    energy = 0.5 * float(start[1] @ start[1]) - EARTH_GRAVITY / np.linalg.norm(start[0])
    assert energy == pytest.approx(-EARTH_GRAVITY / (2 * elements[0]), rel=1e-12)

    def rate(_, x):
        return [*x[3:], *(-EARTH_GRAVITY * x[:3] / np.linalg.norm(x[:3]) ** 3)]

    solution = solve_ivp(
        rate, (0, DAY), np.concatenate(start), "DOP853", times, rtol=1e-13, atol=1e-6
    )
    found = jax.jit(jax.vmap(orbit.position))(jnp.array(times))
    np.testing.assert_allclose(found, solution.y[:3].T, rtol=0, atol=1.0)


def averaged_rates(axis, eccentricity, inclination):
    """What J2 gives node, perigee and mean anomaly: Gauss' equations, averaged over the anomaly."""
    motion, p = np.sqrt(EARTH_GRAVITY / axis**3), axis * (1 - eccentricity**2)
    momentum = np.sqrt(EARTH_GRAVITY * p)
    perigee, total = 0.7, np.zeros(3)
    for anomaly in np.arange(720) * 2 * np.pi / 720:
        r, u = p / (1 + eccentricity * np.cos(anomaly)), anomaly + perigee
        size = -1.5 * EARTH_OBLATENESS * EARTH_GRAVITY * EARTH_RADIUS**2 / r**4
        radial = size * (1 - 3 * (np.sin(inclination) * np.sin(u)) ** 2)
        along = size * np.sin(inclination) ** 2 * np.sin(2 * u)
        normal = size * np.sin(2 * inclination) * np.sin(u)
        c, s, e = np.cos(anomaly), np.sin(anomaly), eccentricity
        node = r * np.sin(u) / (momentum * np.sin(inclination)) * normal
        turn = (-p * c * radial + (p + r) * s * along) / (momentum * e)
        turn -= node * np.cos(inclination)
        drift = ((p * c - 2 * r * e) * radial - (p + r) * s * along) * np.sqrt(1 - e**2)
        weight = r**2 * motion / momentum / 720  # of time
        total += weight * np.array([node, turn, drift / (momentum * e)])
    return total


def test_secular_rates_are_averages_of_gauss_equations():
    axis, e, inclination = 7.5e6, 0.1, 1.2
    found = np.array(
        EllipticOrbit(axis, e, inclination, oblateness=EARTH_OBLATENESS).secular_rates()
    )
    found[2] -= np.sqrt(EARTH_GRAVITY / axis**3)
    np.testing.assert_allclose(found, averaged_rates(axis, e, inclination), rtol=1e-9)


def test_torques_are_those_of_the_place():
    orbit, t = EllipticOrbit(*ELEMENTS, EARTH_OBLATENESS), jnp.array(5e4)
    position = np.array(orbit.position(t))
    distance = np.linalg.norm(position)
    down, size = -position / distance, 3 * EARTH_GRAVITY / distance**3
    nadir = TURNED.matrix @ down
    expected = size * np.cross(nadir, INERTIA @ nadir)
    found = GravityGradientAt(orbit)(t, TURNED, INERTIA)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    field = oracle.field(position, 2.1 + oracle.EARTH_ROTATION * 5e4)
    np.testing.assert_allclose(DipoleField(orbit)(t), field, rtol=1e-7)
    turns = oracle.EARTH_ROTATION * np.array([5e4])
    sampled = DipoleField(orbit).sampled(np.array([5e4]), turns)
    np.testing.assert_allclose(sampled[0], field, rtol=1e-7)


def test_a_round_ellipse_is_a_circle():
    """Torques in the orbit frame of a circle, turned into inertial axes, are those there."""
    rate, angles, t = 1.05e-3, (1.2, 0.4, -0.7, 2.1), jnp.array(3000.0)
    circle = CircularOrbit(rate, *angles)
    ellipse = EllipticOrbit(circle.radius, 0.0, 1.2, 0.4, 0.0, -0.7, 2.1)
    attitude, axes = ALIGNED.as_dcm(), DCM(circle.axes(t))
    np.testing.assert_allclose(
        GravityGradientAt(ellipse)(t, axes, INERTIA),
        GravityGradient(rate)(t, attitude, INERTIA),
        rtol=1e-9,
        atol=1e-18,
    )
    turned = axes.matrix @ DipoleField(ellipse)(t)
    np.testing.assert_allclose(DipoleField(circle)(t), turned, rtol=1e-9)


def test_the_shadow_ends_where_the_apogee_is_high():
    """On the line of apsides, the distance from the axis of the shadow by hand."""
    orbit = EllipticOrbit(20e6, 0.5)  # perigee at x = 10,000 km, apogee at x = -30,000 km
    half = jnp.pi / orbit.secular_rates()[2]
    for sun, t, light in (
        ([1.0, 0, 0], 0.0, 1.0),
        ([-1.0, 0, 0], 0.0, 0.0),
        ([-1.0, 0, 0.9], 0.0, 1.0),
        ([-1.0, 0, 0.5], 0.0, 0.0),  # 4,472 km from the axis of the shadow
        ([1.0, 0, 0.5], half, 1.0),  # 13,416 km
        ([1.0, 0, 0.1], half, 0.0),  # 2,985 km
    ):
        towards, found = Sunlight(sun, orbit, eclipses=True)(jnp.array(t))
        assert float(found) == light
        np.testing.assert_allclose(towards, np.array(sun) / np.linalg.norm(sun))


MOLNIYA = [
    "orbit.perigee_altitude_km=600",
    "orbit.apogee_altitude_km=39750",
    "orbit.inclination_deg=63.4",
    "orbit.argument_of_perigee_deg=-90",
    "orbit.mean_anomaly_rad=0.2",
    "orbit.j2=true",
]


def test_a_scenario_flies_it():
    scenario = load("free-third-rate", [*MOLNIYA, "disturbance.gravity_gradient=true"])
    plant = build_uncontrolled(scenario)[0].plant
    assert float(plant.orbit.rate) == 0 == scenario.orbit.rate()
    assert isinstance(plant.disturbance, SumOfDisturbances)
    acting = plant.disturbance.terms[1]
    axis = EARTH_RADIUS + 1e3 * (600 + 39750) / 2
    e = 1e3 * (39750 - 600) / 2 / axis
    turns = (np.radians(63.4), 0.0, -np.pi / 2, 0.2, scenario.orbit.greenwich())
    expected = GravityGradientAt(EllipticOrbit(axis, e, *turns, EARTH_OBLATENESS))
    t = jnp.array(400.0)
    inertia = plant.spacecraft.inertia
    found = acting(t, TURNED, inertia)
    np.testing.assert_allclose(found, expected(t, TURNED, inertia), rtol=1e-9)
    assert np.linalg.norm(found) > 1e-6


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("orbit.apogee_altitude_km=500", "must be from perigee_altitude_km, 600.0, to"),
        ("orbit.apogee_altitude_km=2e5", "of eccentricity 0.9"),
        ("orbit.argument_of_latitude_rad=0.1", "argument_of_perigee_deg .* and mean_anomaly_rad"),
        ("disturbance.drag_density_kg_m3=1e-13", "no drag"),
        ('orbit.field="igrf"', '"dipole" in an elliptic orbit'),
    ],
)
def test_what_needs_a_circle_is_refused(change, said):
    with pytest.raises(ScenarioError, match=said):
        load("free-third-rate", [*MOLNIYA, "orbit.epoch=2026-03-20T12:00:00", change])


def test_magnetorquers_are_refused():
    with pytest.raises(ScenarioError, match=r"no magnetorquers, .* got 3 tables"):
        load("rods-only", ["orbit.perigee_altitude_km=600", "orbit.apogee_altitude_km=700"])


def test_half_an_ellipse_is_told():
    with pytest.raises(ScenarioError, match=r"apogee_altitude_km.* must be given with perigee"):
        load("free-third-rate", ["orbit.perigee_altitude_km=600"])
    with pytest.raises(ValueError, match="Expected a circular orbit"):
        _ = DipoleField(EllipticOrbit(7e6, 0.01)).circle
