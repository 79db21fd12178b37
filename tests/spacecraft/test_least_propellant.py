"""Allocation by least propellant against linear programmes, by XLA and the compiled engine."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import linprog

from helpers.thruster_layouts import canted, pairs
from jaxsat.compiler import Mapped
from jaxsat.core.allocation import allocation_matrix, largest_torque, least_propellant, plane_map
from jaxsat.spacecraft.least_propellant import LeastPropellant

AMOUNTS = (0.1, 0.5, 0.8, 1.0, 1.5, 10.0)
"""Of the greatest torque in a direction: within, at and beyond what can be made."""


def layouts(rng, count):
    """Random ones, opposite pairs, columns of few directions, and torques in a plane."""
    halves = rng.normal(size=(3, (count + 1) // 2))
    few = rng.integers(-1, 2, size=(3, count)) + 0.0
    few[:, :3] = np.eye(3)
    few[:, ~few.any(axis=0)] = 1.0
    plane = rng.normal(size=(3, 2)) @ rng.normal(size=(2, count))
    for torque in (
        rng.normal(size=(3, count)),
        np.hstack([halves, -halves])[:, :count],
        few,
        plane,
    ):
        sizes = 10 ** rng.uniform(-0.5, 0.5, count)
        yield torque * sizes, rng.choice([1.0, 2.0], size=count)


def limits(rng, count, trial):
    """None, some or more of them failed, and some weak."""
    failed = rng.random(count) < trial % 3 * 0.15
    return np.where(failed, 0.0, rng.choice([1.0, 1.0, 0.4, rng.random()], size=count))


def fraction(torque, limit, wanted, given=0.0):
    """The greatest fraction of a torque beside what is given, and 1 at most."""
    scale = np.abs(torque).max()
    size = np.abs(wanted).max() / scale
    found = linprog(
        np.append(np.zeros(len(limit)), -1.0),
        A_eq=np.column_stack([torque / scale, -wanted / scale / size]),
        b_eq=given / scale * np.ones(3),
        bounds=[*((0, one) for one in limit), (0, size)],
    )
    assert found.status == 0
    return found.x[-1] / size


def least_cost(torque, cost, limit, wanted):
    """Of a torque that can be made."""
    scale = np.abs(torque).max()
    found = linprog(
        cost, A_eq=torque / scale, b_eq=wanted / scale, bounds=[(0, one) for one in limit]
    )
    assert found.status == 0
    return found.fun


def programmes(rng, count, scale):
    """Torques, costs, limits, commands, and the part of each that can be made."""
    for torque, cost in layouts(rng, count):
        for trial, amount in enumerate(AMOUNTS):
            limit = limits(rng, count, trial)
            use = limit * rng.random(count)
            few = np.where(np.arange(count) == trial % count, use, 0.0)  # one alone would do
            wanted = (torque @ (few if trial % 4 == 3 else use)) * scale
            size = np.abs(wanted).max()
            if size == 0:
                wanted, size = torque[:, 0] * scale, np.abs(torque[:, 0]).max() * scale
            far = wanted / size * np.abs(torque).sum() * scale
            most = fraction(torque * scale, limit, far)
            if most > 1e-6:
                wanted = far * most * amount
            yield torque * scale, cost, limit, wanted, min(1.0, 1 / amount) * (most > 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 5, 8, 12, 16])
def test_duties_are_the_solution_of_the_bounded_programme(count):
    """The greatest part of the torque in its direction, at least cost, by both compilers."""
    rng = np.random.default_rng([30, count])
    found = [
        one for _ in range(7) for scale in (1e-6, 1.0, 1e6) for one in programmes(rng, count, scale)
    ]
    assert len(found) > 500
    tables = [LeastPropellant.of(torque, cost) for torque, cost, *_ in found]
    table = jax.tree.map(lambda *leaves: np.stack(leaves), *tables)
    cases = (table, *(np.stack([one[place] for one in found]) for place in (2, 3)))

    def duties(case, _):
        return case[0](case[2], case[1])[0]

    by_xla = np.asarray(jax.jit(jax.vmap(lambda *case: duties(case, None)))(*cases))
    by_ours = Mapped(duties, jax.tree.map(lambda x: x[0], cases))(cases)
    np.testing.assert_allclose(by_ours, by_xla, rtol=0, atol=1e-8)
    parts = set()
    for duty, ours, (torque, cost, limit, wanted, part) in zip(by_xla, by_ours, found, strict=True):
        size = np.abs(wanted).max()
        for one in (duty, ours):
            assert np.all((one >= 0) & (one <= limit))
            np.testing.assert_allclose(torque @ one, part * wanted, rtol=0, atol=2e-9 * size)
        made = least_cost(torque, cost, limit, torque @ duty)
        assert cost @ duty == pytest.approx(made, rel=1e-7, abs=1e-9)
        parts.add(part)
    assert {0.1, 1 / 1.5, 1.0} <= parts


@pytest.mark.slow
def test_what_comes_first_is_made_first_and_of_the_rest_the_greatest_part():
    """A valve stuck on is opposed as far as that goes, whatever is asked for beside."""
    rng = np.random.default_rng(32)
    duties = jax.jit(lambda table, limit, torque, first: table(torque, limit, first))
    kinds = np.zeros(3, int)
    for _ in range(100):
        torque = rng.normal(size=(3, 8))
        stuck = rng.integers(8)
        limit = np.where(np.arange(8) == stuck, 0.0, 1.0)
        first = -torque[:, stuck]
        asked = rng.normal(size=3) * rng.choice([0.1, 1.0, 3.0])
        table = LeastPropellant.of(torque, np.ones(8))
        duty, missed = duties(table, limit, asked, first)
        made = torque @ np.asarray(duty)
        np.testing.assert_allclose(made + missed, first + asked, atol=1e-8)
        opposed = fraction(torque, limit, first) * first
        rest = first + asked - opposed
        part = fraction(torque, limit, rest, opposed)
        np.testing.assert_allclose(made, opposed + part * rest, atol=1e-8)
        kinds += np.array([part == 1, part < 1, np.abs(opposed - first).max() > 1e-6])
    assert kinds.min() > 5


def test_no_torque_needs_no_duty():
    torque, cost = next(layouts(np.random.default_rng(31), 8))
    duty, missed = LeastPropellant.of(torque, cost)(jnp.zeros(3))
    assert not np.asarray(duty).any()
    assert not np.asarray(missed).any()


def test_other_numbers_are_not_compiled_again():
    traces = []

    @jax.jit
    def duties(table, limit, torque):
        traces.append(torque)
        return table(torque, limit)[0]

    for torque, cost in layouts(np.random.default_rng(33), 6):
        for limit in (1.0, 0.0):
            duties(LeastPropellant.of(torque, cost), jnp.full(6, limit), jnp.asarray(torque[:, 0]))
    assert len(traces) == 1


def test_derivatives_are_those_at_the_vertex_within_and_beyond_the_bounds():
    torque = canted()[0]
    table = LeastPropellant.of(torque, np.linalg.norm(torque, axis=0))
    duties = jax.jit(lambda wanted: table(wanted)[0])
    slopes = [jax.jit(way(duties)) for way in (jax.jacfwd, jax.jacrev)]
    for command in (np.array([1e-3, -2e-3, 5e-4]), np.array([0.3, -0.2, 0.1])):
        step = 1e-7
        sides = [np.asarray(duties(command + step * way)) for way in (*np.eye(3), *-np.eye(3))]
        expected = (np.stack(sides[:3], axis=1) - np.stack(sides[3:], axis=1)) / (2 * step)
        for slope in slopes:
            np.testing.assert_allclose(slope(command), expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("command", [np.zeros(3), np.array([1e-3, 0.0, 0.0])])
def test_where_a_command_needs_few_thrusters_the_torque_changes_as_it_does(command):
    for torque in (canted()[0], pairs()):
        table = LeastPropellant.of(torque, np.linalg.norm(torque, axis=0))
        slope = jax.jit(jax.jacrev(lambda wanted: torque @ table(wanted)[0]))  # noqa: B023
        np.testing.assert_allclose(slope(command), np.eye(3), atol=1e-12)


def test_thrusters_in_a_plane_make_two_torques_in_it():
    rng = np.random.default_rng(20260102)
    plane = np.linalg.qr(rng.normal(size=(3, 2)))[0]
    angles = np.arange(4) * np.pi / 2 + 0.2
    torque = plane @ np.stack([np.cos(angles), np.sin(angles)])
    made = plane_map(torque, 2)
    table = LeastPropellant.of(torque, np.ones(4), made)
    for command in rng.normal(size=(20, 2)) * 0.1:
        reached = torque @ np.asarray(table(jnp.asarray(command))[0])
        np.testing.assert_allclose(reached[:2], command, atol=1e-14)
        assert abs(np.cross(plane[:, 0], plane[:, 1]) @ reached) < 1e-14


def test_the_largest_torque_is_that_of_full_thrust():
    torque = np.kron(np.diag([1.0, 2.0, 3.0]), [[1, -1]])
    assert largest_torque(torque, 0.0, 1.0, np.eye(3)) == pytest.approx(1.0)
    assert largest_torque(torque, 0.0, 1.0, np.eye(3)[:, 1:]) == pytest.approx(2.0)
    assert largest_torque(torque[:, :2], 0.0, 1.0, np.eye(3)[:, :1]) == pytest.approx(1.0)


@pytest.mark.parametrize("way", [1, -1])
def test_the_largest_torque_is_that_of_linear_programmes(way):
    """Of thrusters that push and of wheels, about three axes and in a plane."""
    rng = np.random.default_rng(6)
    for axes in (np.eye(3), np.linalg.qr(rng.normal(size=(3, 2)))[0]):
        torque = axes @ rng.normal(size=(axes.shape[1], 4))
        torque = np.hstack([torque, -torque * rng.uniform(0.5, 2, 4)])
        high, low = rng.uniform(0.5, 2, 8), -rng.uniform(0.1, 1, 8) * (way < 0)
        parts = []
        for corner in itertools.product((1.0, -1.0), repeat=axes.shape[1]):
            found = linprog(
                np.append(np.zeros(8), -1.0),
                A_eq=np.column_stack([torque, -axes @ corner]),
                b_eq=np.zeros(3),
                bounds=[*zip(low, high, strict=True), (0, None)],
            )
            parts.append(found.x[-1])
        assert largest_torque(torque, low, high, axes) == pytest.approx(min(parts), rel=1e-9)


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


@pytest.mark.parametrize("count", [2, 3, 5])
def test_torques_in_one_plane_are_shared_exactly_and_with_least_squares(count):
    """Equation (5) for any number: the third torque follows, duties are orthogonal to the rest."""
    rng = np.random.default_rng(count)
    plane = np.array([[1.0, 0.0], [0.0, 1.0], [0.4, -0.7]])
    axes = plane @ rng.normal(size=(2, count))
    axes /= np.linalg.norm(axes, axis=0)
    shares = allocation_matrix(axes)
    np.testing.assert_allclose(axes @ shares, plane, atol=1e-12)
    np.testing.assert_allclose(null_space(axes[:2]).T @ shares, 0, atol=1e-12)
    with pytest.raises(ValueError, match="x and y"):
        allocation_matrix(axes[[0, 2, 1]] * [[1.0], [0.0], [1.0]])
