"""Allocation by a table of bases, against the simplex method."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.thruster_layouts import allocated, canted
from jaxsat.allocation import largest_torque, least_propellant, plane_map
from jaxsat.vehicle import LeastPropellant
from oracle import pulses


@pytest.mark.slow
def test_duties_cost_and_give_what_those_of_the_simplex_method_do():
    rng = np.random.default_rng(20260101)
    compared = 0
    for _ in range(12):
        torque = rng.normal(size=(3, rng.integers(6, 13)))
        try:
            table = allocated(torque)
        except ValueError:
            continue  # these thrusters leave a direction out
        cost = np.linalg.norm(torque, axis=0)
        commands = rng.normal(size=(40, 3)) * rng.choice([0.01, 0.1, 10.0], size=(40, 1))
        found = np.asarray(jax.vmap(table)(commands))
        for wanted, duties in zip(commands, found, strict=True):
            best = pulses.least_propellant(torque, cost, wanted)
            np.testing.assert_allclose(cost @ duties, cost @ best, rtol=1e-9)
            np.testing.assert_allclose(torque @ duties, torque @ best, rtol=0, atol=1e-9)
            assert duties.min() >= 0
            assert np.count_nonzero(duties) <= table.firing
            compared += 1
    assert compared >= 160


def test_a_command_beyond_the_thrusters_is_reduced_not_turned():
    torque, _ = canted()
    table = allocated(torque)
    command = np.array([0.3, -0.2, 0.1])
    made = torque @ np.asarray(table(jnp.asarray(command)))
    assert np.linalg.norm(np.cross(made, command)) < 1e-15
    assert 0 < made @ command < command @ command
    assert np.asarray(table(jnp.asarray(command))).max() == pytest.approx(1)


def test_thrusters_in_a_plane_make_two_torques_in_it():
    rng = np.random.default_rng(20260102)
    plane = np.linalg.qr(rng.normal(size=(3, 2)))[0]
    angles = np.arange(4) * np.pi / 2 + 0.2
    torque = plane @ np.stack([np.cos(angles), np.sin(angles)])
    made = plane_map(torque, 2)
    table = LeastPropellant.of(least_propellant(torque, np.ones(4), made))
    assert table.firing == 2
    for command in rng.normal(size=(20, 2)) * 0.1:
        reached = torque @ np.asarray(table(jnp.asarray(command)))
        np.testing.assert_allclose(reached[:2], command, atol=1e-14)
        assert abs(np.cross(plane[:, 0], plane[:, 1]) @ reached) < 1e-14


def test_the_largest_torque_is_that_of_full_thrust():
    torque = np.kron(np.diag([1.0, 2.0, 3.0]), [[1, -1]])
    duties = least_propellant(torque, np.ones(6), np.eye(3))
    assert largest_torque(duties) == pytest.approx(1.0)
    assert largest_torque(duties[:, :, 1:]) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("torque", "missing"),
    [
        (np.diag([1.0, 1.0, 1.0]), "-1.0"),
        (np.stack([[0, 0, 1.0]] * 4, axis=1), "1.0, 0.0, 0.0"),
        (np.array([[1.0, -1, 0, 0], [0, 0, 1, -1], [0, 0, 0, 0]]), "0.0, 0.0, 1.0"),
    ],
)
def test_a_torque_that_cannot_be_made_is_named(torque, missing):
    with pytest.raises(ValueError, match=rf"makes a torque along .*{missing}"):
        least_propellant(torque, np.ones(torque.shape[1]), np.eye(3))


def test_next_to_no_command_the_torque_changes_as_the_command_does():
    torque, _ = canted()
    duties = allocated(torque)
    for command in np.vstack([np.eye(3), [0.3, -0.5, 0.8]]):
        made = jax.jvp(lambda u: torque @ duties(u), (jnp.zeros(3),), (jnp.asarray(command),))[1]
        np.testing.assert_allclose(
            made, torque @ duties(jnp.asarray(1e-6 * command)) / 1e-6, atol=1e-9
        )
        np.testing.assert_allclose(made, command, atol=1e-12)
