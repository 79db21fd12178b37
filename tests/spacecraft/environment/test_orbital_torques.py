"""Dipole, drag and light: against a program that shares no code, and values worked out by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.strategies import rotations, vectors
from jaxsat.core.attitude import DCM, Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.earth import circular_orbit_rate
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build_uncontrolled
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from jaxsat.spacecraft.environment.orbital_torques import (
    AerodynamicTorque,
    MagneticTorque,
    SolarPressureTorque,
)
from oracle import orbital_torques as oracle

RATE = circular_orbit_rate(400e3)
RADIUS = 6778137.0
NONE = jnp.eye(3)
ALIGNED = Quaternion([1.0, 0.0, 0.0, 0.0])
angles = st.floats(-np.pi, np.pi)


@settings(max_examples=20)
@given(rotations(), vectors(3), vectors(3), st.floats(0, 1e5), st.tuples(*4 * [angles]))
def test_torques_are_those_of_an_independent_program(rotation, dipole, centre, t, turns):
    inclination, node, latitude, greenwich = turns
    orbit, attitude = CircularOrbit(RATE, *turns), DCM(rotation.as_matrix().T)
    position, velocity = oracle.place(t, RATE, inclination, node, latitude)
    axes = oracle.orbit_axes(position, velocity)
    np.testing.assert_allclose(orbit.axes(jnp.array(t)), axes, atol=1e-10)

    def in_body(vector):
        return rotation.inv().apply(axes @ vector)

    field = oracle.field(position, greenwich + oracle.EARTH_ROTATION * t)
    time, torque = jnp.array(t), MagneticTorque(dipole, DipoleField(orbit))
    np.testing.assert_allclose(
        torque(time, attitude, NONE), oracle.lever(dipole, in_body(field)), atol=1e-12
    )
    force = -0.5 * 3e-12 * 2.2 * 0.7 * np.linalg.norm(velocity) * velocity
    drag = AerodynamicTorque(3e-12, 2.2, 0.7, centre, orbit)
    np.testing.assert_allclose(
        drag(time, attitude, NONE), oracle.lever(centre, in_body(force)), atol=1e-13
    )
    sun = np.array([0.3, -0.5, 0.2])
    force = -4.56e-6 * 1.4 * 2.5 * sun / np.linalg.norm(sun)
    light = SolarPressureTorque(1.4, 2.5, centre, sun, orbit)
    np.testing.assert_allclose(
        light(time, attitude, NONE), oracle.lever(centre, in_body(force)), atol=1e-14
    )


def test_values_worked_out_by_hand():
    """At 400 km above the equator and Greenwich, flying east: x is east, y is south, z is down."""
    orbit, t = CircularOrbit(RATE), jnp.array(0.0)
    assert float(orbit.radius) == pytest.approx(RADIUS, rel=1e-12)
    shrunk = (6371.2e3 / RADIUS) ** 3
    field = shrunk * np.array([-4652.5e-9, -29404.8e-9, 2901.8e-9])  # east, south, down
    np.testing.assert_allclose(DipoleField(orbit)(t), field, rtol=1e-12)
    torque = MagneticTorque([0.0, 0.0, 2.0], DipoleField(orbit))(t, ALIGNED, NONE)
    np.testing.assert_allclose(torque, [-2 * field[1], 2 * field[0], 0], rtol=1e-12)
    drag = AerodynamicTorque(3e-12, 2.2, 1.0, [0.0, 0.0, 0.1], orbit)(t, ALIGNED, NONE)
    force = 0.5 * 3e-12 * 2.2 * (3.986004418e14 / RADIUS)
    np.testing.assert_allclose(drag, [0, -0.1 * force, 0], rtol=1e-12)
    light = SolarPressureTorque(1.5, 2.0, [0.0, 0.1, 0.0], [2.0, 0.0, 0.0], orbit)
    # the Sun is overhead, -z: it pushes down, along +z
    np.testing.assert_allclose(light(t, ALIGNED, NONE), [0.1 * 4.56e-6 * 3, 0, 0], atol=1e-20)


CHANGES = ["orbit.altitude_km=400", "orbit.relation=exact"]


def test_a_scenario_has_them_where_it_asks_for_them():
    plain = build_uncontrolled(load("free-third-rate", CHANGES))[0].plant
    asked = [
        "disturbance.residual_dipole_A_m2=[0.1, 0.0, 0.2]",
        "disturbance.drag_density_kg_m3=3e-12",
        "disturbance.drag_centre_m=[0.0, 0.02, 0.1]",
        "disturbance.solar_area_m2=2.0",
        "disturbance.solar_centre_m=[0.0, 0.1, 0.0]",
        "orbit.inclination_deg=51.6",
        "orbit.ascending_node_deg=30.0",
        "orbit.argument_of_latitude_deg=-70.0",
        "orbit.sidereal_angle_deg=100.0",
    ]
    plant = build_uncontrolled(load("free-third-rate", [*CHANGES, *asked]))[0].plant
    orbit = CircularOrbit(RATE, *np.radians([51.6, 30.0, -70.0, 100.0]))
    t, centre = jnp.array(55.0), [0.0, 0.02, 0.1]
    expected = sum(
        part(t, ALIGNED, NONE)
        for part in (
            plain.disturbance,
            MagneticTorque([0.1, 0.0, 0.2], DipoleField(orbit)),
            AerodynamicTorque(3e-12, 2.2, 1.0, centre, orbit),
            SolarPressureTorque(1.5, 2.0, [0.0, 0.1, 0.0], [1.0, 0.0, 0.0], orbit),
        )
    )
    np.testing.assert_allclose(plant.disturbance(t, ALIGNED, NONE), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            ["orbit.rate_rad_s=0.0", "disturbance.residual_dipole_A_m2=[1, 0, 0]"],
            "above the ground",
        ),
        (["orbit.rate_rad_s=0.01", "disturbance.drag_density_kg_m3=1e-12"], "above the ground"),
        (["disturbance.solar_area_m2=1", "disturbance.sun_direction=[0, 0, 0]"], "direction"),
    ],
)
def test_what_cannot_be_is_told(changes, said):
    with pytest.raises(ScenarioError, match=said):
        load("free-third-rate", changes)


def test_a_table_of_the_field_in_numpy_is_the_field():
    orbit = CircularOrbit(1.1e-3, 1.2, 0.4, -0.7, 2.1)
    field = DipoleField(orbit)
    instants, turns = np.array([0.0, 700.0, 4321.0]), np.array([0.0, 2.5])
    table = field.sampled(instants, turns[:, None])
    over = jax.vmap(jax.vmap(field.over, (0, None)), (None, 0))
    there = np.asarray(jax.jit(over)(as_float(instants), as_float(turns)))
    np.testing.assert_allclose(table, there, rtol=0, atol=1e-13 * np.abs(there).max())
