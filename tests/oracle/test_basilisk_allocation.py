"""Torques of wheels and thrusters, and momentum dumping, against Basilisk where it is installed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.basilisk import basilisk
from helpers.tools import needs
from jaxsat.core.declaration.three_torques import FULL
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.relief import Relief

pytestmark = [
    pytest.mark.slow,
    needs("Basilisk"),
]

LAYOUTS = 20


def balanced(chance):
    """Positions (m) and forces (N) of eight thrusters of any strength, whose torques add up to
    nothing, in pairs that push either way at one place."""
    positions, forces = chance.uniform(-1.0, 1.0, (4, 3)), 3.0 * chance.normal(size=(4, 3))
    return np.concatenate([positions] * 2), np.concatenate([forces, -forces])


def test_wheels_make_the_torques_of_least_squares():
    """Basilisk's motors turn the wheels, ours the body."""
    chance = np.random.default_rng(1)
    cases = [
        {"axes": chance.normal(size=(count, 3)).tolist(), "torque": chance.normal(size=3).tolist()}
        for count in chance.integers(3, 7, LAYOUTS)
    ]
    for case, motors in zip(
        cases, basilisk("basilisk_allocation.py", "wheels", cases), strict=True
    ):
        distribution = WheelsFirst.of(np.array(case["axes"]).T, 3)
        ours = distribution.wheels(jnp.array(case["torque"]))
        scale = np.abs(motors).max()
        np.testing.assert_allclose(ours, -np.array(motors), rtol=0, atol=1e-11 * scale)


def test_thrusters_make_the_same_torque_by_less_thrust():
    """Both make the torque that is asked for. Basilisk takes least squares and adds to every force
    until none pulls; ours is the least sum of forces, which a linear program has, too."""
    chance = np.random.default_rng(2)
    layouts = [balanced(chance) for _ in range(LAYOUTS)]
    cases = [
        {"positions": places.tolist(), "forces": forces.tolist(), "torque": torque.tolist()}
        for (places, forces), torque in zip(
            layouts, chance.normal(size=(LAYOUTS, 3)) * 0.02, strict=True
        )
    ]
    found = basilisk("basilisk_allocation.py", "thrusters", cases)
    share = jax.jit(allocate)
    ratios = []
    for (places, forces), case, theirs in zip(layouts, cases, found, strict=True):
        full, torque = np.linalg.norm(forces, axis=1), np.array(case["torque"])
        columns = (np.cross(places, forces) / full[:, None]).T  # N m for each N
        np.testing.assert_allclose(columns @ theirs, torque, rtol=0, atol=1e-12)
        ours = share(Reach(columns, jnp.zeros(8), full, jnp.ones(8)), torque).use
        np.testing.assert_allclose(columns @ ours, torque, rtol=0, atol=1e-9)
        bounds = list(zip(np.zeros(8), full, strict=True))
        best = linprog(np.ones(8), A_eq=columns, b_eq=torque, bounds=bounds)
        assert best.status == 0
        assert float(jnp.sum(ours)) == pytest.approx(best.fun, rel=1e-7)
        ratios.append(float(jnp.sum(ours)) / sum(theirs))
    assert max(ratios) < 1.0
    assert 0.3 < np.median(ratios) < 0.6


def test_the_same_momentum_is_dumped_from_one_wheel():
    """Down to the dead band of ours: Basilisk by one request, ours in proportion to the excess."""
    places, forces = balanced(np.random.default_rng(3))
    limit, torque_limit, period = 10.0, 0.2, 1.0
    momenta = -9.5 * np.eye(3)
    layout = {"positions": places.tolist(), "forces": forces.tolist(), "axes": np.eye(3).tolist()}
    layout |= {"rotor": 0.05, "least": FULL * limit, "periods": 300}
    cases = [layout | {"momenta": one} for one in momenta.tolist()]
    columns, full = np.cross(places, forces).T, np.linalg.norm(forces, axis=1)
    relief = Relief(
        Reach(columns, jnp.zeros(8), jnp.ones(8), full),
        *(np.eye(3), np.eye(3), np.full(3, torque_limit), np.full(3, limit), np.eye(3), period),
    )

    @jax.jit
    def a_period(stored, _):
        unloading = relief.unloading(jnp.zeros(3), stored)
        wheels, thrusters, unmade = relief.allocate(jnp.zeros(3), unloading, stored)
        return stored - period * wheels, (period * thrusters, unmade)

    found = basilisk("basilisk_allocation.py", "dumping", cases)
    for momentum, seconds in zip(momenta, found, strict=True):
        dumped = columns @ seconds
        np.testing.assert_allclose(dumped, momentum * (FULL * limit / 9.5 - 1), atol=1e-11)
        left, (impulses, unmade) = jax.lax.scan(a_period, jnp.asarray(momentum), None, length=800)
        np.testing.assert_allclose(jnp.sum(impulses, axis=0), dumped, atol=1e-9)
        np.testing.assert_allclose(left, momentum + dumped, atol=1e-9)
        np.testing.assert_allclose(unmade, 0.0, atol=1e-12)
