"""What failures leave, and how a torque is shared among the thrusters left."""

import functools
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.thruster_layouts import allocated, canted, pairs
from jaxsat.control.diagnosis.residual import ActuatorCondition
from jaxsat.control.reconfiguration import (
    Rank,
    Reconfiguration,
    failed_set,
    failed_sets,
)
from jaxsat.controllability.cone import torque_cone

KINDS = {3: Rank.THREE_AXES, 2: Rank.PLANE, 1: Rank.LESS, 0: Rank.LESS}


def tables(torque):
    return _tables(tuple(map(tuple, torque.tolist())))


@functools.cache
def _tables(rows):
    torque = np.array(rows)
    return Reconfiguration.of(torque, np.linalg.norm(torque, axis=0), failed_sets(torque))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_left_is_what_the_controllability_analysis_finds(seed):
    rng = np.random.default_rng([3, seed])
    layouts = (canted()[0], pairs(), rng.normal(size=(3, 7)))
    for torque in layouts:
        count = torque.shape[1]
        for failed in itertools.chain(*(itertools.combinations(range(count), k) for k in range(4))):
            found = failed_set(torque, failed)
            kept = np.delete(torque, failed, axis=1)
            cone = torque_cone(kept, np.zeros(kept.shape[1], bool))
            assert found.rank == KINDS[cone.two_sided]
            if found.rank != Rank.PLANE:
                continue
            normal = np.cross(*found.directions.T)
            assert abs(normal @ cone.normal) == pytest.approx(1)


@pytest.mark.slow
def test_the_torque_is_made_by_those_left_as_by_a_table_of_their_own():
    torque = canted()[0]
    made = tables(torque)
    rng = np.random.default_rng(4)
    allocate = eqx.filter_jit(made.duties)
    for gone in ((), (2,), (1, 6)):
        failed = np.isin(np.arange(8), gone)
        kept = torque[:, ~failed]
        alone = allocated(kept)
        cost = np.linalg.norm(kept, axis=0)
        for command in rng.normal(size=(20, 3)) * 1e-3:
            duty = np.asarray(allocate(command, jnp.where(failed, 0.0, 1.0), jnp.zeros(3))[0])
            assert not duty[failed].any()
            np.testing.assert_allclose(torque @ duty, command, atol=1e-15)
            assert cost @ duty[~failed] == pytest.approx(
                cost @ np.asarray(alone(jnp.asarray(command))[0])
            )


@pytest.mark.slow
def test_no_torque_is_made_in_place_of_one_that_cannot_be():
    torque = pairs()
    made = tables(torque)
    failed = jnp.where(np.arange(6) == 5, 0.0, 1.0)
    for third, part in ((-0.3, 0.0), (0.0, 1.0), (0.3, 1.0)):
        wanted = np.array([0.1, -0.2, third])
        duty = np.asarray(made.duties(jnp.asarray(wanted), failed, jnp.zeros(3))[0])
        np.testing.assert_allclose(torque @ duty, part * wanted, atol=1e-15)


@pytest.mark.slow
def test_what_a_stuck_thruster_makes_is_opposed_before_anything_else():
    """By all others where one alone cannot; what can be opposed at all is SciPy's to say."""
    torque = canted()[0]
    made = tables(torque)
    allocate = eqx.filter_jit(made.duties)
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
                thrusts, _ = allocate(command, jnp.asarray(others), jnp.asarray(share * steady))
                duty = np.asarray(thrusts)
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


@pytest.mark.slow
def test_beside_a_plane_a_torque_is_opposed_where_a_thruster_pushes_across():
    """Of six one way each, one gone: the other of its pair pushes one way across the plane."""
    torque = pairs()
    made = tables(torque)
    limit = np.where(np.arange(6) == 5, 0.0, 1.0)
    directions = jnp.asarray(failed_set(torque, (5,)).directions)
    rng = np.random.default_rng(12)
    for steady in rng.uniform(-0.3, 0.3, (10, 3)):
        asked = made.beside_plane(jnp.asarray(limit), jnp.asarray(steady), directions)
        opposed = np.append(steady[:2], max(steady[2], 0.0))
        np.testing.assert_allclose(asked, opposed, atol=1e-15)
        duty = np.asarray(made.duties(jnp.zeros(3), jnp.asarray(limit), asked)[0])
        np.testing.assert_allclose(torque @ duty, opposed, atol=1e-9)


def found(torque, part, flow, before=None):
    """What is left where thrusters make these parts of their thrust, and flows all the time."""
    count = torque.shape[1]
    part = jnp.asarray(part) * jnp.ones(count)
    condition = ActuatorCondition.sound(count)._replace(
        failed=part < 1, part=part, flow=jnp.asarray(flow) * jnp.ones(count)
    )
    made = tables(torque)
    return eqx.filter_jit(made.find)(condition, before or made.whole)


@pytest.mark.slow
def test_a_flow_that_can_be_opposed_stands_for_the_failed_thruster():
    """It leaves nothing where it is small, nor where it is as strong as the one that opposes it."""
    last = np.arange(6) == 5
    for flow, left in ((0.0, 1), (0.03, 1), (0.5, 0), (0.99, 1)):
        assert found(pairs(), 1.0 - last, flow * last).rank == left


@pytest.mark.slow
def test_a_weak_thruster_is_used_only_where_it_is_needed():
    last = np.arange(6) == 5
    ability = found(pairs(), 1 - 0.6 * last, 0.0)
    assert ability.rank == Rank.THREE_AXES
    np.testing.assert_allclose(ability.limit, 1 - 0.6 * last)
    np.testing.assert_array_equal(
        found(canted()[0], 1 - 0.6 * (np.arange(8) == 2), 0.0).limit[2], 0
    )
    assert found(pairs(), 1 - 0.97 * last, 0.0).rank == Rank.PLANE


@pytest.mark.slow
def test_a_weak_thruster_helps_to_oppose_a_stuck_one_where_others_do_not():
    """With little to spare, by SciPy; more is asked of others before a helper is left out again."""
    torque = canted()[0]
    made, helped = tables(torque), 0
    find, whole = eqx.filter_jit(made.find), made.whole
    for stuck, weak in itertools.permutations(range(8), 2):
        failed = np.isin(np.arange(8), (stuck, weak))
        if failed_set(torque, tuple(np.flatnonzero(failed).tolist())).rank != Rank.THREE_AXES:
            continue
        part = np.where(failed, 0.4 * (np.arange(8) == weak), 1.0)
        most = linprog(
            np.append(np.zeros(8), -1.0),
            A_eq=np.column_stack([torque, torque[:, stuck]]) / np.abs(torque).max(),
            b_eq=np.zeros(3),
            bounds=[*((0, 1 - one) for one in failed), (0, None)],
        ).x[-1]
        for flow, before in itertools.product((0.5, 0.7, 0.9), (0.0, 0.4)):
            spare = 1.05 if before == 0 else 1.1
            condition = ActuatorCondition.sound(8)._replace(
                failed=jnp.asarray(failed),
                part=jnp.asarray(part),
                flow=jnp.asarray(flow * (np.arange(8) == stuck)),
            )
            limit = np.where(np.arange(8) == weak, before, whole.limit)
            ability = find(condition, whole._replace(limit=jnp.asarray(limit)))
            helps = spare * flow > most
            assert ability.rank == Rank.THREE_AXES
            np.testing.assert_array_equal(ability.limit, np.where(failed & ~helps, 0.0, part))
            helped += helps
    assert helped > 10


@pytest.mark.slow
@pytest.mark.parametrize("torque", [canted()[0], pairs()])
def test_a_thruster_is_needed_where_less_than_three_axes_is_left_without_it(torque):
    made, count = tables(torque), torque.shape[1]
    for gone in ((), (1,), (0, 3)):
        failed = np.isin(np.arange(count), gone)
        found = np.asarray(made.needed(jnp.asarray(failed)))
        for one in np.flatnonzero(~failed):
            tabled = len(gone) < 2
            left = failed_set(torque, tuple(sorted((*gone, int(one))))).rank
            assert found[one] == (not tabled or left != Rank.THREE_AXES)
        assert not found[failed].any()


@pytest.mark.slow
def test_what_is_left_does_not_go_to_and_fro_about_a_limit():
    """It takes half of what it took to count as three axes until it does not any more."""
    last = np.arange(6) == 5
    assert found(pairs(), 1 - 0.92 * last, 0.0).rank == Rank.PLANE
    before = found(pairs(), 1 - 0.6 * last, 0.0)
    changes = 0
    rng = np.random.default_rng(3)
    for noise in rng.uniform(-0.02, 0.02, 60):
        after = found(pairs(), 1.0 - last, (0.1 + noise) * last, before)
        changes += int(after.rank != before.rank)
        before = after
    assert changes <= 1


@pytest.mark.slow
def test_more_failures_than_tables_are_judged_by_what_can_be_made():
    """Never as more than the controllability analysis finds; less where little torque is left."""
    eight, three = canted()[0], 0
    for failed in itertools.combinations(range(8), 3):
        kept = np.delete(eight, failed, axis=1)
        most = KINDS[torque_cone(kept, np.zeros(5, bool)).two_sided]
        left = found(eight, 1.0 * ~np.isin(np.arange(8), failed), 0.0).rank
        assert left in (most, Rank.LESS)
        three += left == Rank.THREE_AXES
    assert three > 10
    rng = np.random.default_rng(8)
    twelve = rng.normal(size=(3, 12))
    assert found(twelve, np.arange(12) % 4 > 0, 0.0).rank == Rank.THREE_AXES
    assert found(twelve, np.arange(12) > 8, 0.0).rank == Rank.LESS


def test_a_program_for_many_thrusters_is_as_long_as_one_for_few():
    """Otherwise compilers take minutes over sixteen of them."""
    rng = np.random.default_rng(5)

    def equations(torque):
        made, count = tables(torque), torque.shape[1]

        def step(failed, flow, wanted):
            condition = ActuatorCondition(failed, 1 - flow, flow, wanted, jnp.array(0.0))
            ability = made.find(condition, made.whole)
            return made.duties(wanted, ability.limit, made.torque @ flow)[0]

        return str(jax.make_jaxpr(step)(jnp.zeros(count, bool), jnp.zeros(count), jnp.zeros(3)))

    few, many = (equations(rng.normal(size=(3, count))) for count in (6, 12))
    assert few.count(" = ") == many.count(" = ")
