"""Torques of wheels within their limits, against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear

from jaxsat.compiler import Mapped
from jaxsat.spacecraft import ActuatorsWithWheels, nearest_within


def layouts(rng, count):
    """Random, in a plane, skew and symmetric ones; some wheels have failed, some are weak."""
    around = 2 * np.pi * np.arange(count) / count
    skew = rng.normal(size=(3, count)) * [[1.0], [1.0], [1e-3]]
    plane = rng.normal(size=(3, 2)) @ rng.normal(size=(2, count))
    ring = np.stack([np.cos(around), np.sin(around), np.ones(count)])
    for axes in (rng.normal(size=(3, count)), plane, skew, ring):
        failed = rng.random(count) < 0.15
        limit = np.where(failed, 0.0, rng.choice([1.0, 1.0, 0.3], size=count))
        yield axes / np.linalg.norm(axes, axis=0), limit


def cases(rng, count, number):
    """Axes, weights, limits, the unbounded torques, and the part that can be made."""
    while number:
        for axes, limit in layouts(rng, count):
            scale = 10.0 ** rng.integers(-6, 7)
            weight = np.where(limit > 0, limit if rng.random() < 0.5 else 1.0, 0.0)
            root = np.sqrt(weight)
            torque = axes @ (limit * rng.uniform(-1, 1, count))
            if np.linalg.norm(torque) < 1e-2 or not number:
                continue
            found = linprog(
                np.append(np.zeros(count), -1.0),
                A_eq=np.column_stack([axes, -torque]),
                b_eq=np.zeros(3),
                bounds=[*((-one, one) for one in limit), (0, None)],
            )
            amount = rng.choice([0.5, 0.9, 0.99, 2.0])
            wanted = root * (np.linalg.pinv(axes * root) @ torque) * found.x[-1] * amount
            number -= 1
            yield axes, weight, limit * scale, wanted * scale, min(1.0, 1 / amount)


@pytest.mark.parametrize("count", [3, 4, 6, 8])
def test_torques_are_those_of_bounded_least_squares_by_both_compilers(count):
    rng = np.random.default_rng([41, count])
    given = list(zip(*cases(rng, count, 24), strict=True))
    axes, weight, limit, wanted, part = map(np.stack, given)
    arrays = (axes, weight, limit, wanted)
    by_xla = jax.jit(jax.vmap(nearest_within))(*arrays)
    first = jax.tree.map(lambda x: x[0], arrays)
    by_ours = Mapped(lambda case, _: nearest_within(*case)[0], first)(arrays)
    size = limit.max(axis=1)[:, None]
    np.testing.assert_allclose(by_ours / size, by_xla[0] / size, rtol=0, atol=1e-8)
    made, share = map(np.asarray, by_xla)
    np.testing.assert_allclose(share, part, rtol=0, atol=1e-7)
    exceeded = 0
    for k, torque in enumerate(np.einsum("kij,kj->ki", axes, wanted) / size):
        used, found = weight[k] > 0, made[k] / size[k]
        bound = limit[k] / size[k]
        assert np.all(np.abs(made[k]) <= limit[k])
        np.testing.assert_allclose(axes[k] @ found, share[k] * torque, rtol=0, atol=1e-9)
        exceeded += np.any(np.abs(wanted[k]) > limit[k]) and share[k] == 1
        if share[k] == 1:
            # The torque is a condition: in least squares it weighs 10,000 times as much.
            each = np.sqrt(weight[k][used])
            left, sizes, _ = np.linalg.svd(axes[k][:, used] * each)
            rank = np.sum(sizes > 1e-9)
            ways = 1e4 * (left[:, :rank] / sizes[:rank]).T
            best = lsq_linear(
                np.vstack([np.diag(1 / each), ways @ axes[k][:, used]]),
                np.concatenate([np.zeros(used.sum()), ways @ torque]),
                (-bound[used], bound[used]),
                method="bvls",
                tol=1e-14,
            )
            np.testing.assert_allclose(found[used], best.x, rtol=0, atol=1e-5)
    assert exceeded > 0 or count == 3


def test_derivatives_are_those_of_differences_within_at_and_beyond_the_limits():
    rng = np.random.default_rng(44)
    axes = rng.normal(size=(3, 6))
    axes /= np.linalg.norm(axes, axis=0)
    weight = limit = np.array([1.0, 0.5, 1.0, 0.2, 1.0, 0.0])
    root = np.sqrt(weight)
    spread = root[:, None] * np.linalg.pinv(axes * root)
    given = [jnp.asarray(one) for one in (axes, weight, limit)]
    torques = jax.jit(lambda way: nearest_within(*given, spread @ way)[0])
    slopes = [jax.jit(way(torques)) for way in (jax.jacfwd, jax.jacrev)]
    for amount in (0.0, 0.1, 0.9, 1.1, 5.0):
        command, step = amount * np.array([0.5, -0.6, 0.4]), 1e-7
        sides = [np.asarray(torques(command + step * way)) for way in (*np.eye(3), *-np.eye(3))]
        expected = (np.stack(sides[:3], axis=1) - np.stack(sides[3:], axis=1)) / (2 * step)
        for slope in slopes:
            np.testing.assert_allclose(slope(command), expected, rtol=1e-6, atol=1e-6)


def test_a_command_that_fits_is_shared_to_the_bit_as_without_limits():
    axes = np.array([[1, -1, -1, 1], [1, 1, -1, -1], [1, 1, 1, 1]]) / np.sqrt(3)
    command = jnp.array([0.03, -0.02, 0.01])
    free = ActuatorsWithWheels.of(axes, 3).commands(command)["wheel"]
    bound = ActuatorsWithWheels.of(axes, 3, 0.1).commands(command)["wheel"]
    np.testing.assert_array_equal(free, bound)
