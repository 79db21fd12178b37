"""What failures leave, and how a torque is shared among the thrusters left."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.thruster_layouts import allocated, canted, pairs
from jaxsat.control.reconfiguration import Left, Reconfiguration, failed_sets, what_is_left
from jaxsat.controllability import torque_cone

KINDS = {3: Left.THREE_AXES, 2: Left.PLANE, 1: Left.LESS, 0: Left.LESS}


def tables(torque):
    return Reconfiguration.of(torque, np.linalg.norm(torque, axis=0), failed_sets(torque))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_left_is_what_the_controllability_analysis_finds(seed):
    rng = np.random.default_rng([3, seed])
    layouts = (canted()[0], pairs(), rng.normal(size=(3, 7)))
    for torque in layouts:
        count = torque.shape[1]
        for failed in itertools.chain(*(itertools.combinations(range(count), k) for k in range(4))):
            found = what_is_left(torque, failed)
            kept = np.delete(torque, failed, axis=1)
            cone = torque_cone(kept, np.zeros(kept.shape[1], bool))
            assert found.left == KINDS[cone.two_sided]
            if found.left != Left.PLANE:
                continue
            normal = np.cross(*found.directions.T)
            assert abs(normal @ cone.normal) == pytest.approx(1)
            assert np.allclose(found.missing, 0 if cone.opposed is None else cone.opposed)


@pytest.mark.slow
def test_the_torque_is_made_by_those_left_as_by_a_table_of_their_own():
    torque = canted()[0]
    made = tables(torque)
    rng = np.random.default_rng(4)
    allocate = eqx.filter_jit(made.allocate)
    for gone in ((), (2,), (1, 6)):
        failed = np.isin(np.arange(8), gone)
        kept = torque[:, ~failed]
        alone = allocated(kept)
        cost = np.linalg.norm(kept, axis=0)
        for command in rng.normal(size=(20, 3)) * 1e-3:
            duty = np.asarray(allocate(jnp.asarray(failed), command, jnp.zeros(3)))
            assert not duty[failed].any()
            np.testing.assert_allclose(torque @ duty, command, atol=1e-15)
            assert cost @ duty[~failed] == pytest.approx(
                cost @ np.asarray(alone(jnp.asarray(command)))
            )


@pytest.mark.slow
def test_where_a_torque_cannot_be_made_the_rest_of_it_is():
    torque = pairs()
    made = tables(torque)
    failed = np.arange(6) == 5
    duty = np.asarray(
        made.allocate(jnp.asarray(failed), jnp.array([0.1, -0.2, -0.3]), jnp.zeros(3))
    )
    np.testing.assert_allclose(torque @ duty, [0.1, -0.2, 0.0], atol=1e-15)


@pytest.mark.slow
def test_what_a_stuck_thruster_makes_is_opposed_before_anything_else():
    """By all others where one alone cannot; what can be opposed at all is SciPy's to say."""
    torque = canted()[0]
    made = tables(torque)
    allocate = eqx.filter_jit(made.allocate)
    rng = np.random.default_rng(9)
    at_full_thrust = 0
    for stuck in range(8):
        failed = np.arange(8) == stuck
        others = np.where(failed, 0.0, 1.0)
        steady = -torque[:, stuck]
        most = linprog(
            np.append(np.zeros(8), -1.0),
            A_eq=np.column_stack([torque, -steady]) / np.abs(torque).max(),
            b_eq=np.zeros(3),
            bounds=[*((0, one) for one in others), (0, None)],
        ).x[-1]
        for share in np.array([0.3, 0.6, 0.9]) * most:
            for command in (np.zeros(3), *rng.normal(size=(3, 3))):
                duty = np.asarray(
                    allocate(jnp.asarray(failed), command, jnp.asarray(share * steady))
                )
                assert not duty[failed].any()
                assert duty.min() >= 0
                assert duty.max() <= 1 + 1e-12
                left = torque @ duty - share * steady
                assert np.linalg.norm(np.cross(left, command)) <= 1e-5 * np.linalg.norm(command)
                assert left @ command >= -1e-12
                if not command.any():
                    np.testing.assert_allclose(left, 0, atol=1e-12)
                at_full_thrust += duty.max() > 1 - 1e-9
    assert at_full_thrust > 20


@pytest.mark.parametrize(("flow", "left"), [(0, 1), (0.05, 1), (0.5, 0), (0.99, 1)])
def test_a_flow_that_can_be_opposed_stands_for_the_failed_thruster(flow, left):
    made = tables(pairs())
    failed = jnp.arange(6) == 5
    assert made.find(failed, jnp.where(failed, flow, 0.0))[1] == left


def test_more_failures_than_tables_leave_less():
    made = tables(canted()[0])
    assert made.find(jnp.arange(8) < 3, jnp.zeros(8))[1] == Left.LESS


def test_a_program_for_many_thrusters_is_as_long_as_one_for_few():
    """Otherwise compilers take minutes over sixteen of them."""
    rng = np.random.default_rng(5)

    def equations(torque):
        made, count = tables(torque), torque.shape[1]

        def step(failed, flow, wanted):
            return made.find(failed, flow), made.allocate(failed, wanted, made.torque @ flow)

        return str(jax.make_jaxpr(step)(jnp.zeros(count, bool), jnp.zeros(count), jnp.zeros(3)))

    few, many = (equations(rng.normal(size=(3, count))) for count in (6, 12))
    assert few.count("\n") == many.count("\n")
