"""Net force of torques against linear programmes and general minimisation."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from jaxsat.controllability.actuators import actuator_set, thruster_torques
from jaxsat.controllability.cone import torque_cone
from jaxsat.controllability.net_forces import net_force


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


def nearly_alike(seed, directions):
    """Return 9 to 14 thrusters at a few places that are off by 0.1 mm to 1 mm."""
    rng = np.random.default_rng(seed)
    count = rng.integers(9, 15)
    places = rng.integers(-1, 2, size=(count, 3)) + rng.normal(size=(count, 3)) * 10.0 ** (
        rng.uniform(-4, -3)
    )
    return layout(places, rng.choice(directions, count) * rng.choice([-1, 1], (count, 1)))


@pytest.mark.parametrize("seed", range(20))
def test_thrusters_that_nearly_replace_one_another_push_as_a_linear_programme_allows(seed):
    actuators = nearly_alike(seed, [[0, 0, 1]])  # a force along z: its size is linear in thrusts
    found = found_by(actuators)
    assert found.ratios.size
    torques, forces = actuators.torques[:2], actuators.forces[2:]
    for direction, ratio in zip(found.directions.T, found.ratios, strict=True):
        shared = linprog(
            [*np.zeros(torques.shape[1]), 1, 1],
            A_eq=np.block([[torques, np.zeros((2, 2))], [forces, 1, -1]]),
            b_eq=[*direction[:2], 0],
            bounds=(0, None),
        )
        assert ratio == pytest.approx(shared.fun, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_net_force_of_nearly_alike_thrusters_is_within_the_sums_of_its_parts(seed):
    actuators = nearly_alike(seed, np.eye(3))
    found = found_by(actuators)
    torques, forces = actuators.torques, actuators.forces
    count = torques.shape[1]
    for direction, ratio in zip(found.directions.T, found.ratios, strict=True):
        parts = linprog(  # the least |x| + |y| + |z| of the force
            [*np.zeros(count), *np.ones(6)],
            A_eq=np.block([[torques, np.zeros((3, 6))], [forces, np.eye(3), -np.eye(3)]]),
            b_eq=[*direction, 0, 0, 0],
            bounds=(0, None),
        )
        assert parts.fun / np.sqrt(3) - 1e-7 <= ratio <= parts.fun + 1e-7  # its tolerance


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
