"""The allocation inside the law that diagnoses its thrusters, against SciPy's linear programmes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from jaxsat.control.cheapest_duties import VIOLATION, CheapestDuties


def layouts(rng, count):
    """Random ones, opposite pairs, and columns of few directions that depend on each other."""
    halves = rng.normal(size=(3, count // 2))
    few = rng.integers(-1, 2, size=(3, count)) + 0.0
    few[:, :3] = np.eye(3)
    few[:, ~few.any(axis=0)] = 1.0
    for torque in (rng.normal(size=(3, count)), np.hstack([halves, -halves]), few):
        sizes = 10 ** (rng.uniform(-4, 1) + rng.uniform(-0.5, 0.5, count))
        yield torque * sizes, rng.choice([1.0, 2.0], size=count)


def by_scipy(torque, cost, failed, wanted):
    """Cost of the cheapest thrusts: pulling and failed thrusters cost `VIOLATION` more."""
    size = np.linalg.norm(torque, axis=0)
    price = cost / size
    missed = VIOLATION * price.max()
    prices = np.append(np.where(failed, price + missed, price), np.full(len(cost), missed))
    units = torque / size
    scale = np.abs(wanted).sum()
    found = linprog(prices, A_eq=np.hstack([units, -units]), b_eq=wanted / scale, bounds=(0, None))
    assert found.status == 0
    return scale * found.fun


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 12, 16])
def test_duties_cost_as_little_as_those_of_a_linear_programme(count):
    rng = np.random.default_rng([30, count])
    reached = 0
    cheapest = jax.jit(lambda table, failed, wanted: table(failed, wanted))
    for torque, cost in layouts(rng, count):
        table = CheapestDuties.of(torque, cost)
        for trial in range(20):
            failed = rng.random(count) < trial % 4 * 0.1
            wanted = rng.normal(size=3) * 10 ** rng.uniform(-3, 0) * np.abs(torque).max()
            wanted = np.where(np.arange(3) == trial % 5, 0.0, wanted)  # degenerate programmes
            duty = np.asarray(cheapest(table, jnp.asarray(failed), jnp.asarray(wanted)))
            assert duty.min() >= 0
            assert not duty[failed].any()
            least, scale = by_scipy(torque, cost, failed, wanted), np.abs(wanted).max()
            missed = wanted - torque @ duty
            left = 0.0
            if np.abs(missed).max() > 1e-9 * scale:
                left = by_scipy(torque, cost, failed, missed)
            reached += left == 0
            assert cost @ duty + left == pytest.approx(least, rel=1e-6)
    assert reached > 30


def test_no_torque_needs_no_duty():
    torque, cost = next(layouts(np.random.default_rng(31), 8))
    duty = CheapestDuties.of(torque, cost)(jnp.zeros(8, bool), jnp.zeros(3))
    assert not np.asarray(duty).any()
