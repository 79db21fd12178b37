"""Air and light on flat plates, and the Earth's shadow: by an independent program and by hand."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from jaxsat.core.attitude import DCM, Quaternion
from jaxsat.core.earth import circular_orbit_rate
from jaxsat.scenario import ScenarioError, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build_uncontrolled
from jaxsat.spacecraft.environment.orbit import CircularOrbit
from jaxsat.spacecraft.environment.orbital_torques import (
    AerodynamicTorque,
    SolarPressureTorque,
    Sunlight,
)
from jaxsat.spacecraft.environment.panels import PanelDrag, Panels, PanelSolarPressure
from oracle import orbital_torques as oracle

RATE = circular_orbit_rate(400e3)
RADIUS = 6778137.0
NONE, ALIGNED = jnp.eye(3), Quaternion([1.0, 0.0, 0.0, 0.0])
TURNS = (0.9, 0.4, -1.1, 0.3)
SUN = np.array([0.3, -0.5, 0.2])


def plates(count=7):
    random = np.random.default_rng(5)
    share = random.uniform(0, 0.5, size=(2, count))
    return Panels(
        random.uniform(0.1, 2, count),
        random.normal(size=(count, 3)),
        random.normal(size=(count, 3)),
        random.uniform(2, 3, count),
        *share,
    )


def truth(panels, rotation, t, density):
    """Torques of air and light, plate by plate; nothing is shared with jaxsat."""
    position, velocity = oracle.place(t, RATE, *TURNS[:3])
    into_body = rotation.inv().as_matrix() @ oracle.orbit_axes(position, velocity)
    wind, sun = into_body @ velocity, into_body @ SUN / np.linalg.norm(SUN)
    speed = np.linalg.norm(wind)
    air, light = np.zeros(3), np.zeros(3)
    columns = (np.asarray(getattr(panels, name)) for name in panels.__dataclass_fields__)
    rows = zip(*columns, strict=True)
    for area, normal, centre, drag, mirror, even in rows:
        n = normal / np.linalg.norm(normal)
        if n @ wind > 0:
            across = area * (n @ wind) / speed
            air += oracle.lever(centre, -0.5 * density * speed * drag * across * wind)
        cosine = n @ sun
        if cosine > 0:
            taken = (1 - mirror - even) * sun  # absorbed
            sent = mirror * 2 * cosine * n + even * (sun + 2 / 3 * n)  # and reflected
            light += oracle.lever(centre, -4.56e-6 * area * cosine * (taken + sent))
    return air, light


@pytest.mark.parametrize("t", [0.0, 1234.5])
def test_torques_are_those_of_an_independent_program(t):
    orbit, panels = CircularOrbit(RATE, *TURNS), plates()
    drag, light = PanelDrag(3e-12, panels, orbit), PanelSolarPressure(panels, Sunlight(SUN, orbit))
    for rotation in Rotation.random(4, random_state=2):
        attitude = DCM(rotation.as_matrix().T)
        air, push = truth(panels, rotation, t, 3e-12)
        np.testing.assert_allclose(drag(jnp.array(t), attitude, NONE), air, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(light(jnp.array(t), attitude, NONE), push, rtol=1e-9, atol=1e-16)


def test_a_plate_across_air_and_light_is_the_constant_area():
    """At 400 km above the equator, flying east: x is forward and z down; the Sun is overhead."""
    orbit, t = CircularOrbit(RATE), jnp.array(0.0)
    centre = [0.1, -0.2, 0.3]
    ahead = Panels([2.0], [[3.0, 0, 0]], [centre], [2.2], [0.0], [0.0])
    expected = AerodynamicTorque(3e-12, 2.2, 2.0, centre, orbit)(t, ALIGNED, NONE)
    found = PanelDrag(3e-12, ahead, orbit)(t, ALIGNED, NONE)
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    for mirror, coefficient in ((0.0, 1.0), (1.0, 2.0)):
        above = Panels([2.0], [[0, 0, -1.0]], [centre], [0.0], [mirror], [0.0])
        light = PanelSolarPressure(above, Sunlight([1.0, 0, 0], orbit))
        same = SolarPressureTorque(coefficient, 2.0, centre, [1.0, 0, 0], orbit)
        np.testing.assert_allclose(
            light(t, ALIGNED, NONE), same(t, ALIGNED, NONE), rtol=1e-14, atol=1e-25
        )
    below = Panels([2.0], [[0, 0, 1.0]], [centre], [2.2], [0.5], [0.5])
    assert not PanelSolarPressure(below, Sunlight([1.0, 0, 0], orbit))(t, ALIGNED, NONE).any()


def test_the_shadow_begins_and_ends_where_the_cylinder_does():
    """With the Sun in the plane of the orbit it is dark for 2 arcsin(R / r) of a turn."""
    orbit = CircularOrbit(RATE)
    light = Sunlight([2.0, 0.0, 0.0], orbit, eclipses=True)
    half = np.arcsin(6378137.0 / RADIUS)
    for angle, lit in ((half, 0.0), (half * (1 + 1e-9), 1.0)):
        for side in (-1, 1):
            inside = angle * (1 - 1e-9) if lit == 0 else angle
            t = jnp.array((np.pi + side * inside) / RATE)
            assert light(t)[1] == lit
    tilted = CircularOrbit(RATE, *TURNS)

    def clear(t):
        """Distance from the axis of the shadow less its radius, from positions alone."""
        position, _ = oracle.place(t, RATE, *TURNS[:3])
        sun = SUN / np.linalg.norm(SUN)
        behind = position @ sun
        return np.linalg.norm(position - behind * sun) - 6378137.0 if behind < 0 else 1e6

    grid = np.arange(0, 2 * np.pi / RATE, 20.0)
    shade = Sunlight(SUN, tilted, eclipses=True)
    found = [float(shade(jnp.array(t))[1]) for t in grid[::6]]
    np.testing.assert_array_equal(found, [float(clear(t) >= 0) for t in grid[::6]])
    edges = [k for k in range(len(grid) - 1) if (clear(grid[k]) < 0) != (clear(grid[k + 1]) < 0)]
    assert edges
    for k in edges:
        at = brentq(clear, grid[k], grid[k + 1], xtol=1e-9)
        before, after = (float(shade(jnp.array(at + d))[1]) for d in (-1e-4, 1e-4))
        assert {before, after} == {0.0, 1.0}
    plain = SolarPressureTorque(1.0, 1.0, [0.0, 0.1, 0.0], [1.0, 0, 0], orbit, eclipses=True)
    assert not plain(jnp.array(np.pi / RATE), ALIGNED, NONE).any()


HIGH = ["orbit.altitude_km=400", "orbit.relation=exact"]
PANEL = (
    "panel=[{area_m2=2.0,normal=[1.0,0.0,0.0],centre_m=[0.1,-0.2,0.3]},"
    "{area_m2=1.0,normal=[0.0,0.0,-2.0],centre_m=[0.0,0.5,0.0],specular=0.7,diffuse=0.2}]"
)


def test_a_scenario_has_panels_in_place_of_constant_areas(tmp_path):
    asked = [PANEL, "disturbance.drag_density_kg_m3=3e-12", "disturbance.eclipses=true"]
    scenario = load("free-third-rate", [*HIGH, *asked])
    file = tmp_path / "again.toml"
    file.write_text(dump(scenario), encoding="utf-8")
    assert load(file) == scenario
    terms = build_uncontrolled(scenario)[0].plant.disturbance.terms
    drag, light = terms[-2:]
    assert isinstance(drag, PanelDrag)
    assert isinstance(light, PanelSolarPressure)
    assert light.light.eclipses
    np.testing.assert_array_equal(light.panels.specular, [0.0, 0.7])
    assert not any(isinstance(one, AerodynamicTorque | SolarPressureTorque) for one in terms)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ([PANEL.replace("0.2}", "0.4}")], "must be at most 1 with specular"),
        ([PANEL, "disturbance.drag_area_m2=2.0"], "must be omitted with"),
        ([PANEL, "disturbance.solar_area_m2=2.0"], "must be omitted with"),
        ([PANEL, "disturbance.sun_direction=[0, 0, 0]"], "must be a direction"),
        ([PANEL.replace("[0.0,0.0,-2.0]", "[0.0,0.0,0.0]")], "must be a direction"),
        (["orbit.rate_rad_s=0.0", "disturbance.eclipses=true"], "above the ground"),
    ],
)
def test_what_cannot_be_is_told(changes, said):
    with pytest.raises(ScenarioError, match=said):
        load("free-third-rate", changes if "orbit" in changes[0] else [*HIGH, *changes])
