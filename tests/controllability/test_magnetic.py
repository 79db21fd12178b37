"""Magnetorquers about rest in the orbit frame, against SciPy with a field of its own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsat.control.linear_motion import linear_motion
from jaxsat.controllability.magnetic import (
    magnetic_authority,
    magnetic_law_words,
    magnetic_words,
)
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from oracle import magnetic
from oracle import orbital_torques as earth

INERTIA = np.array([0.04, 0.05, 0.02])
RATE = 1.1e-3
ANGLES = (1.1, 0.4, 0.7, 2.0)
LIMITS = np.array([0.4, 0.3, 0.5])
AXES = np.array([[1.0, 0.0, 0.2], [0.1, 1.0, 0.0], [0.0, 0.3, 1.0]])
ALIGNED = np.eye(3)
UNITS = AXES / np.linalg.norm(AXES, axis=0)


def found_of(axes=AXES, limits=LIMITS, angles=ANGLES, to_body=ALIGNED):
    """Of the body at the rest `to_body`, about which axes are those of the orbit frame."""
    inertia, field = (
        to_body @ np.diag(INERTIA) @ to_body.T,
        DipoleField(CircularOrbit(RATE, *angles)),
    )
    return magnetic_authority(inertia, to_body @ axes, limits, field, to_body)


def inputs(t):
    """J⁻¹ (a × B) limit, columns, by the field of the oracle."""
    field = magnetic.field(t, (RATE, *ANGLES))
    return np.cross((UNITS * LIMITS).T, field).T / INERTIA[:, None]


def drift(x):
    """Errors of a body at rest in the orbit frame: angle and rate, by hand for principal axes."""
    angle, rate = x[:3], x[3:]
    frame = np.array([0, -RATE, 0])
    spin = np.cross(INERTIA * rate, frame) + np.cross(INERTIA * frame, rate)
    return np.concatenate([rate - np.cross(frame, angle), spin / INERTIA])


def test_the_field_and_the_torques_are_those_of_an_independent_program():
    found = found_of()
    instants = np.arange(0, 86164, 300.0)
    fields = np.array([magnetic.field(t, (RATE, *ANGLES)) for t in instants])
    sizes = np.linalg.norm(fields, axis=1)
    np.testing.assert_allclose(found.field, (sizes.min(), sizes.max()), rtol=5e-3)
    torques = np.cross((UNITS * LIMITS).T[None], fields[:, None])
    np.testing.assert_allclose(found.torque, np.abs(torques).sum(axis=1).mean(axis=0), rtol=2e-3)
    assert found.largest == pytest.approx(np.abs(torques).sum(axis=1).max(), rel=5e-3)


def test_torques_and_efforts_of_a_body_that_rests_turned_are_about_its_own_axes():
    """A quarter turn about z exchanges x and y; torques of any turn are those of turned fields."""
    aligned, quarter = found_of(), found_of(to_body=np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]]))
    for name in ("torque", "effort"):
        before, after = getattr(aligned, name), getattr(quarter, name)
        np.testing.assert_allclose(after, before[[1, 0, 2]], rtol=1e-9)
    turn = Rotation.from_euler("xyz", [0.2, -0.3, 0.1]).as_matrix()
    fields = np.array([magnetic.field(t, (RATE, *ANGLES)) for t in np.arange(0, 86164, 300.0)])
    torques = np.cross((turn @ UNITS * LIMITS).T[None], (fields @ turn.T)[:, None])
    expected = np.abs(torques).sum(axis=1).mean(axis=0)
    np.testing.assert_allclose(found_of(to_body=turn).torque, expected, rtol=2e-3)


@pytest.mark.slow
def test_the_effort_is_that_of_the_least_command_which_removes_a_degree():
    """The Gramian by SciPy; its least command is flown, and leaves nothing."""
    orbit, state = 2 * np.pi / RATE, np.array([drift(one) for one in np.eye(6)]).T

    def grown(t, y):
        phi = y[:36].reshape(6, 6)
        b = phi @ np.concatenate([np.zeros((3, 3)), inputs(t)])
        return np.concatenate([(-phi @ state).ravel(), (b @ b.T).ravel()])

    start = np.concatenate([np.eye(6).ravel(), np.zeros(36)])
    run = solve_ivp(grown, (0, orbit), start, "DOP853", rtol=1e-10, atol=1e-14, dense_output=True)
    gramian = run.y[36:, -1].reshape(6, 6)
    found = found_of()
    for axis in range(3):
        error = np.zeros(6)
        error[axis] = np.pi / 180
        weights = np.linalg.solve(gramian, error)
        assert found.effort[axis] == pytest.approx(np.sqrt(error @ weights / orbit), rel=1e-3)

        def rate(t, x, weights=weights):
            phi = run.sol(t)[:36].reshape(6, 6)
            u = -np.concatenate([np.zeros((3, 3)), inputs(t)]).T @ phi.T @ weights
            return state @ x + np.concatenate([np.zeros(3), inputs(t) @ u])

        flown = solve_ivp(rate, (0, orbit), error, "DOP853", rtol=1e-9, atol=1e-12)
        assert np.abs(flown.y[:3, -1]).max() < 1e-5 * error[axis]


def test_a_dipole_along_the_orbit_normal_never_turns_the_body_about_it():
    found = found_of(np.eye(3)[:, 1:2], LIMITS[:1])
    assert found.torque[1] == 0
    assert np.isinf(found.effort[1])
    assert np.all(np.isfinite(found.effort[[0, 2]]))
    told = " ".join(magnetic_words(found, 0.01, wheels=True))
    assert "unload wheel momentum" in told
    assert "of a thruster's" in told


@pytest.mark.slow
def test_an_orbit_that_comes_to_the_magnetic_equator_is_told():
    """The normal of one is along the dipole of the field at one of the turns of the Earth."""
    dipole = np.array([earth.G11, earth.H11, earth.G10])
    east = np.arctan2(dipole[1], dipole[0])
    tilt = np.arccos(-dipole[2] / np.linalg.norm(dipole))
    near = DipoleField(CircularOrbit(RATE, tilt, east - np.pi / 2))
    for place, told in ((near, "they hardly fall"), (polar(), "as the Earth turns (Floquet")):
        motion = linear_motion(
            np.diag(INERTIA), place, np.eye(3), np.zeros(3), gravity_gradient=True
        )
        assert told in magnetic_law_words(motion, 0.1)


def polar():
    return DipoleField(CircularOrbit(RATE, 1.5))
