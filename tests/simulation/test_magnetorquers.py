"""Magnetorquers alone, and beside wheels: against a SciPy program that shares no code."""

import dataclasses
import itertools

import equinox as eqx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.magnetic import FAILURES, scenario
from jaxsat.scenario.build.run import build
from oracle import magnetic as oracle

INERTIA = np.array([[0.05, 0.002, -0.001], [0.002, 0.04, 0.003], [-0.001, 0.003, 0.03]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wheels", "failing", "tolerant"),
    [*itertools.product([0, 2, 3], [False, True], [False]), (3, True, True)],
)
def test_runs_are_those_of_an_independent_program(wheels, failing, tolerant):
    """Under quaternion feedback, and the fault-tolerant law where nothing fails that it sees.

    The program has no trials of magnetorquers, so that the law does without their diagnosis."""
    chosen = scenario(wheels, failing, tolerant)
    run = build(chosen)
    if tolerant:
        loop = eqx.tree_at(lambda one: one.controller.rods.fit, run.loop, None)
        run = dataclasses.replace(run, loop=loop)
    found = run.simulate()
    count = len(found.times) - 1
    axes = np.array([one.axis for one in chosen.magnetorquer], float).T
    limits = np.array([one.dipole_limit_A_m2 for one in chosen.magnetorquer])
    spun = np.array([one.axis for one in chosen.wheel], float).reshape(-1, 3).T
    w, x, y, z = chosen.initial.quaternion
    table = chosen.orbit
    orbit = (
        float(run.loop.plant.orbit.rate),
        table.inclination_rad,
        table.ascending_node_rad,
        table.argument_of_latitude_rad,
        table.sidereal_angle_rad,
    )
    rows, dipoles = oracle.fly(
        Rotation.from_quat([x, y, z, w]).as_matrix().T,
        np.array(chosen.initial.omega_rad_s),
        np.array([one.momentum_N_m_s for one in chosen.wheel]),
        count,
        chosen.control.period_s,
        inertia=INERTIA,
        orbit=orbit,
        torquers=(axes / np.linalg.norm(axes, axis=0), limits),
        wheels=(spun / np.linalg.norm(spun, axis=0), 2e-3 if wheels else 0.0),
        gains=(chosen.control.natural_frequency_rad_s, chosen.control.damping),
        failures=FAILURES if failing else (),
    )
    np.testing.assert_allclose(found.signals.omega, rows[:, 9:12], atol=1e-9 * 0.01)
    turned = Rotation.from_matrix(rows[:, :9].reshape(-1, 3, 3).transpose(0, 2, 1))
    told = Rotation.from_quat(np.asarray(found.signals.quaternion), scalar_first=True)
    assert (turned.inv() * told).magnitude().max() < 1e-9
    np.testing.assert_allclose(found.signals.parts["dipole"][:-1], dipoles, atol=1e-8)
    if not wheels:
        assert np.abs(dipoles / limits).max() > 0.999  # some limit is met
    else:
        np.testing.assert_allclose(found.signals.parts["wheel_momentum"], rows[:, 12:], atol=1e-11)
