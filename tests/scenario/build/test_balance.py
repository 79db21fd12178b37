"""Balances of the environment about an axis that nothing drives: closed forms, and SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from jaxsat.scenario.build.balance import undriven_balance
from jaxsat.scenario.build.load import load
from jaxsat.synthesis.controller_design.variants import turned
from jaxsat.synthesis.controller_design.vehicle import vehicle_verdict

PRESSURE, AREA, ARM, ABSORBED = 4.56e-6, 5.1, 1.2, 0.9
SUN = np.array([0.0, 0.0, -1.0])  # in the reference frame of the scenario


def plates(half_angle, *others):
    """Overrides: two plates whose normals, `half_angle` (degrees) from -z, pass through x."""
    sine, cosine = (float(f(math.radians(half_angle))) for f in (np.sin, np.cos))
    listed = [
        f"{{area_m2={AREA}, normal=[0, {side * sine}, {-cosine}], specular={1 - ABSORBED},"
        f" centre_m=[0.25, {side * ARM * sine}, {-ARM * cosine}]}}"
        for side in (1, -1)
    ]
    return f"panel=[{', '.join([*listed, *others])}]"


def stiffness(half_angle):
    """Light that is absorbed pushes at distance a: -Σ P A (1 - s) a cos x sin x of both plates."""
    factor = 2 * PRESSURE * AREA * ABSORBED * ARM
    return -factor * math.cos(2 * math.radians(half_angle))


def torque_by_hand(scenario, turn):
    """The torque of light on a body turned by a rotation vector, N m."""
    sun = Rotation.from_rotvec(turn).inv().apply(SUN)
    torque = np.zeros(3)
    for one in scenario.panel:
        normal = np.array(one.normal) / np.linalg.norm(one.normal)
        cosine = max(normal @ sun, 0.0)
        push = (1 - one.specular) * sun + 2 * (one.specular * cosine + one.diffuse / 3) * normal
        torque += np.cross(one.centre_m, -PRESSURE * one.area_m2 * cosine * push)
    return torque


@pytest.mark.parametrize("half_angle", [30, 60])
def test_a_ridge_of_two_plates_has_the_closed_form(half_angle):
    """A ridge of less than a right angle between its normals drives the body away, else back."""
    error = 0.1
    tilt, sine = math.radians(23.44), math.sin(error)  # the Sun turned about x by `error`
    sun = [math.cos(error), sine * math.sin(tilt), -sine * math.cos(tilt)]
    found = undriven_balance(load("k2", [plates(half_angle), f"disturbance.sun_direction={sun}"]))
    assert found is not None
    assert found.turn is not None
    np.testing.assert_allclose(found.normal, [1, 0, 0])
    np.testing.assert_allclose(np.abs(found.turn), [error, 0, 0], atol=1e-6)
    np.testing.assert_allclose(found.stiffness, stiffness(half_angle), rtol=1e-5)
    size = abs(stiffness(half_angle)) / 2 * math.sin(2 * error)
    np.testing.assert_allclose(abs(found.torque), size, rtol=1e-9)
    np.testing.assert_allclose(found.rate, math.sqrt(abs(stiffness(half_angle)) / 960), rtol=1e-5)
    assert ("unstable" in found.lines()[1]) == (half_angle < 45)


def test_errors_grow_as_told():
    """SciPy flies the three axes, of which two are held, from a small error about the third."""
    scenario = load("k2")
    found = undriven_balance(scenario)
    assert found is not None
    assert found.turn is not None
    inertia, start = np.diag([960.0, 2420.0, 2420.0]), Rotation.from_rotvec(found.turn)
    held = np.diag([0.0, 1.0, 1.0])

    def slope(t, state):
        attitude, omega = Rotation.from_rotvec(state[:3]), state[3:]
        error = (start.inv() * attitude).as_rotvec()
        torque = torque_by_hand(scenario, state[:3])
        gyroscopic = np.cross(omega, inertia @ omega)
        torque = torque + held @ (gyroscopic - inertia @ (1e-2 * omega + 1e-4 * error))
        change = np.linalg.solve(inertia, torque - gyroscopic)
        x = state[:3]
        size = np.linalg.norm(x)
        rest = (1 - size / 2 / np.tan(size / 2)) / size**2
        turning = omega + np.cross(x, omega) / 2 + rest * np.cross(x, np.cross(x, omega))
        return np.concatenate([turning, change])

    error, times = 1e-4, np.array([1.0, 2.0]) / found.rate
    first = (start * Rotation.from_rotvec([error, 0, 0])).as_rotvec()
    flown = solve_ivp(slope, (0, times[-1]), [*first, 0, 0, 0], t_eval=times, rtol=1e-9, atol=1e-13)
    errors = [(start.inv() * Rotation.from_rotvec(x)).as_rotvec()[0] for x in flown.y[:3].T]
    np.testing.assert_allclose(errors, error * np.cosh([1, 2]), rtol=1e-3)


def test_the_balance_is_the_nearest():
    scenario = load("k2", ["disturbance.sun_direction=[1, 0, 0]", plates(30, TURNED)])
    found = undriven_balance(scenario)
    assert found is not None
    assert found.turn is not None
    assert abs(torque_by_hand(scenario, found.turn)[0]) < 1e-12

    def balance(turn):
        return 1e5 * torque_by_hand(scenario, turn)[0]

    near = np.array(found.turn) + 0.02
    best = minimize(lambda v: v @ v, near, constraints={"type": "eq", "fun": balance}, tol=1e-12)
    assert best.success
    assert np.linalg.norm(found.turn) <= np.linalg.norm(best.x) + 1e-6


TURNED = "{area_m2=1, normal=[0.5, 0.3, -1], centre_m=[-1, 0.9, 0.2], diffuse=0.4}"


def test_a_design_for_the_nearest_attitude_turns_the_panels_too():
    scenario = load("k2")
    verdict = vehicle_verdict(scenario)
    assert verdict.holds  # by thrusters
    assert verdict.turn is not None
    assert np.linalg.norm(verdict.turn) > 0.005
    assert "No wheel makes a torque about (1, 0, 0)" in " ".join(verdict.lines())
    before, after = (undriven_balance(one) for one in (scenario, turned(scenario, verdict.turn)))
    assert before is not None
    assert after is not None
    assert abs(after.torque) < 1e-6 * abs(before.torque)
    np.testing.assert_allclose(after.stiffness, before.stiffness, rtol=1e-4)


@pytest.mark.parametrize(
    "changes",
    [
        [plates(30), "orbit.rate_rad_s=1e-3"],  # in a frame that turns
        ["panel=[]"],  # no light
        ["wheel=[{axis=[1, 0, 0], torque_limit_N_m=0.1}]"],  # thrusters drive the others
    ],
)
def test_no_balance_is_told_where_there_is_no_axis_or_no_torque(changes):
    assert undriven_balance(load("k2", changes, caution=lambda text: None)) is None
