"""Duties within their bounds against SciPy's linear programmes, by XLA and the compiled engine."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.thruster_layouts import canted
from jaxsat.control.bounded_duties import BoundedDuties
from jaxsat.engine.native import Mapped

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
    tables = [BoundedDuties.of(torque, cost) for torque, cost, *_ in found]
    table = jax.tree.map(lambda *leaves: np.stack(leaves), *tables)
    cases = (table, *(np.stack([one[place] for one in found]) for place in (2, 3)))

    def duties(case, _):
        return case[0](case[1], case[2])

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
    duties = jax.jit(lambda table, limit, torque, first: table(limit, torque, first))
    kinds = np.zeros(3, int)
    for _ in range(100):
        torque = rng.normal(size=(3, 8))
        stuck = rng.integers(8)
        limit = np.where(np.arange(8) == stuck, 0.0, 1.0)
        first = -torque[:, stuck]
        asked = rng.normal(size=3) * rng.choice([0.1, 1.0, 3.0])
        table = BoundedDuties.of(torque, np.ones(8))
        made = torque @ np.asarray(duties(table, limit, asked, first))
        opposed = fraction(torque, limit, first) * first
        rest = first + asked - opposed
        part = fraction(torque, limit, rest, opposed)
        np.testing.assert_allclose(made, opposed + part * rest, atol=1e-8)
        kinds += np.array([part == 1, part < 1, np.abs(opposed - first).max() > 1e-6])
    assert kinds.min() > 5


def test_no_torque_needs_no_duty():
    torque, cost = next(layouts(np.random.default_rng(31), 8))
    duty = BoundedDuties.of(torque, cost)(jnp.ones(8), jnp.zeros(3))
    assert not np.asarray(duty).any()


def test_other_numbers_are_not_compiled_again():
    traces = []

    @jax.jit
    def duties(table, limit, torque):
        traces.append(torque)
        return table(limit, torque)

    for torque, cost in layouts(np.random.default_rng(33), 6):
        for limit in (1.0, 0.0):
            duties(BoundedDuties.of(torque, cost), jnp.full(6, limit), jnp.asarray(torque[:, 0]))
    assert len(traces) == 1


def test_derivatives_are_those_at_the_vertex_and_finite_beyond_it():
    torque = canted()[0]
    table = BoundedDuties.of(torque, np.linalg.norm(torque, axis=0))
    duties = jax.jit(lambda wanted: table(jnp.ones(8), wanted))
    slopes = [jax.jit(way(duties)) for way in (jax.jacfwd, jax.jacrev)]
    command, step = np.array([1e-3, -2e-3, 5e-4]), 1e-7
    sides = [np.asarray(duties(command + step * way)) for way in (*np.eye(3), *-np.eye(3))]
    expected = (np.stack(sides[:3], axis=1) - np.stack(sides[3:], axis=1)) / (2 * step)
    for slope in slopes:
        np.testing.assert_allclose(slope(command), expected, rtol=1e-6, atol=1e-6)
        for amount in (0.0, 1e3):
            assert np.all(np.isfinite(np.asarray(slope(amount * command))))
