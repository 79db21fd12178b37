"""Wheels that torques from outside fill, told before the run; momenta by closed forms."""

import numpy as np
import pytest

from jaxsat.scenario.build.balance import full_wheels_words
from jaxsat.scenario.build.load import load

GRAVITY, RADIUS = 3.986004418e14, 6378137.0
ORBIT = np.sqrt(GRAVITY / (RADIUS + 420e3) ** 3)
LIMIT = 0.4


def wheels(*axes, limit=LIMIT):
    rows = (
        f"{{axis={axis},torque_limit_N_m=0.05,momentum_limit_N_m_s={limit}}}"
        for axis in axes or ("[1,0,0]", "[0,1,0]", "[0,0,1]")
    )
    return f"wheel=[{','.join(rows)}]"


def told(*changes, duration=6000):
    cautions = []
    start = f"initial={{quaternion=[1,0,0,0],omega_rad_s=[0,{-ORBIT},0]}}"
    given = (
        "orbit={altitude_km=420}",
        "spacecraft.inertia_kg_m2=[90,70,50]",
        "failure=[]",
        "dispersion={}",
        start,
    )
    last = (f"simulation.duration_s={duration}",)
    changes = [*given, wheels(), *last, *changes]
    scenario = load("failures-telescope", changes, caution=cautions.append)
    about_momentum = [one for one in cautions if "momentum" in one]
    assert len(about_momentum) <= 1
    return about_momentum, full_wheels_words(scenario)


def full_at(words):
    return float(words.split("full after ")[1].split(" s")[0])


DRAG = "drag_density_kg_m3=5e-12,drag_area_m2=6,drag_centre_m="
TORQUE = 0.3 * 0.5 * 5e-12 * 2.2 * 6 * GRAVITY / (RADIUS + 420e3)
"""Of drag 0.3 m beside the centre of mass, N m."""


def test_drag_about_the_orbit_normal_fills_a_wheel_in_proportion_to_time():
    drag = f"disturbance={{{DRAG}[0,0,0.3]}}"
    cautions, words = told(drag)
    assert full_at(words) == pytest.approx(LIMIT / TORQUE, rel=2e-3)
    assert cautions[0].endswith(words)
    assert told(drag, duration=int(0.9 * LIMIT / TORQUE)) == ([], None)


@pytest.mark.parametrize(("part", "angle"), [(0.6, np.arcsin(0.6)), (1.5, 2 * np.pi / 3)])
def test_the_orbit_turns_the_momentum_of_a_torque_across_its_normal(part, angle):
    """T/ω0 (1 - cos, sin) about x and z of a torque T about z that turns with the orbit."""
    few = wheels(limit=part * TORQUE / ORBIT)
    _, words = told(f"disturbance={{{DRAG}[0,0.3,0]}}", few)
    assert full_at(words) == pytest.approx(angle / ORBIT, rel=2e-3)
    enough = wheels(limit=2.01 * TORQUE / ORBIT)
    assert told(f"disturbance={{{DRAG}[0,0.3,0]}}", enough) == ([], None)


def test_gravity_gradient_is_told_of_products_of_inertia():
    """3 ω0² z × Jz, about y: J o is about y itself, so that nothing of it turns."""
    inertia = "spacecraft.inertia_kg_m2=[[90,0,6],[0,70,0],[6,0,50]]"
    _, words = told(inertia, "disturbance={gravity_gradient=true}", wheels(limit=0.02))
    assert full_at(words) == pytest.approx(0.02 / (3 * ORBIT**2 * 6), rel=2e-3)


def test_a_fast_periodic_torque_is_not_taken_for_a_steady_one():
    """2 A/omega at most, a hundredth of what the wheels hold."""
    fast = "amplitude_N_m=[5e-4,0,0],frequency_rad_s=[0.2,0,0]"
    assert told(f"disturbance={{gravity_gradient=true,{fast}}}") == ([], None)


def test_gravity_gradient_along_an_ellipse_has_its_mean():
    """Of 3 mu/r^3 r x Jr the part about y is 3/2 n^2 Jxz/(1 - e^2)^1.5 in the mean of an orbit."""
    inertia = "spacecraft.inertia_kg_m2=[[90,0,6],[0,70,0],[6,0,50]]"
    perigee, apogee = RADIUS + 500e3, RADIUS + 2000e3
    axis, eccentricity = (perigee + apogee) / 2, (apogee - perigee) / (apogee + perigee)
    rate = 1.5 * GRAVITY / axis**3 * 6 / (1 - eccentricity**2) ** 1.5
    _, words = told(
        inertia,
        "orbit={perigee_altitude_km=500,apogee_altitude_km=2000}",
        "disturbance={gravity_gradient=true}",
        "initial={quaternion=[1,0,0,0],omega_rad_s=[0,0,0]}",
        wheels(limit=2.0),
        duration=260_000,
    )
    assert full_at(words) == pytest.approx(2.0 / rate, rel=0.02)


def test_what_others_tell_or_take_out_is_not_told_again():
    rods = "magnetorquer=[{axis=[1,0,0],dipole_limit_A_m2=9},{axis=[0,1,0],dipole_limit_A_m2=9}]"
    assert told(f"disturbance={{{DRAG}[0,0,0.3]}}", rods) == ([], None)
    cautions, words = told(f"disturbance={{constant_N_m=[0,1e-3,0],{DRAG}[0,0,0.3]}}")
    assert words is None
    assert "constant_N_m" in cautions[0]
