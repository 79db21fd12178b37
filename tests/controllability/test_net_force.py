"""Net force of torques against linear programmes and general minimisation."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from jaxsat.controllability.actuators import actuator_set, net_force, thruster_torques
from jaxsat.controllability.cone import torque_cone


def layout(positions, directions, **options):
    forces = np.array(directions, float).T
    torques = thruster_torques(np.array(positions, float).T, forces)
    return actuator_set(torques, forces=forces, **options)


def found_by(actuators):
    cone = torque_cone(actuators.torques, actuators.two_sided)
    return net_force(actuators, cone)


@pytest.mark.parametrize("seed", range(10))
def test_least_net_force_of_random_thrusters(seed):
    rng = np.random.default_rng(seed)
    count = rng.integers(3, 9)
    actuators = layout(rng.normal(size=(count, 3)), rng.normal(size=(count, 3)))
    found = found_by(actuators)
    torques, forces = actuators.torques, actuators.forces
    for direction, ratio in zip(found.directions.T, found.ratios, strict=True):
        start = linprog(np.ones(count), A_eq=torques, b_eq=direction, bounds=(0, None)).x
        best = minimize(
            lambda thrusts: float(np.sum((forces @ thrusts) ** 2)),
            start,
            jac=lambda thrusts: 2 * forces.T @ (forces @ thrusts),
            bounds=[(0, None)] * count,
            constraints={
                "type": "eq",
                "fun": lambda thrusts, wanted: torques @ thrusts - wanted,
                "jac": lambda thrusts, wanted: torques,
                "args": (direction,),
            },
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert ratio == pytest.approx(np.sqrt(best.fun), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("seed", range(10))
def test_couples_are_what_a_linear_programme_of_six_rows_finds(seed):
    rng = np.random.default_rng(seed)
    positions = rng.integers(-1, 2, size=(14, 3))
    directions = np.eye(3)[rng.integers(3, size=14)] * rng.choice([-1, 1], size=(14, 1))
    actuators = layout(positions, directions)
    found = found_by(actuators)
    wrenches = np.concatenate([actuators.torques, actuators.forces])
    for direction, ratio in zip(found.directions.T, found.ratios, strict=True):
        wanted = np.concatenate([direction, np.zeros(3)])
        couple = linprog(np.ones(14), A_eq=wrenches, b_eq=wanted, bounds=(0, None)).status == 0
        assert couple == (ratio == 0)


def test_couples_single_thrusters_and_unknown_forces():
    # Two opposite thrusters at ±x: a couple about z; one alone pushes 1 N with 2 N m.
    pair = layout([[2, 0, 0], [-2, 0, 0]], [[0, 1, 0], [0, -1, 0]])
    assert found_by(pair).couples
    single = found_by(layout([[2, 0, 0]], [[0, 1, 0]]))
    np.testing.assert_allclose(single.ratios, [0.5], rtol=1e-6)
    assert not single.couples
    # A thruster through the centre makes no torque but takes the push back.
    balanced = found_by(layout([[2, 0, 0], [0, 1, 0]], [[0, 1, 0], [0, -1, 0]]))
    np.testing.assert_allclose(balanced.directions, [[0], [0], [1]])
    assert balanced.couples
    assert found_by(actuator_set(np.eye(3))) is None


def test_a_lever_that_is_rounding_makes_no_torque():
    force = np.array([[0.3], [0.7], [0.648]])
    torques = thruster_torques(3 * force + 1e-13, force)
    assert not torques.any()
    assert thruster_torques([[0.0], [1], [0]], [[0.0], [0], [1]], [0.0, 0.5, 0]).T.tolist() == [
        [0.5, 0, 0]
    ]
