"""The third axis by what the mounting of thrusters leaks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from jaxsat.control.fine import wanted_push
from jaxsat.control.leaks import LeakMemory, Leaks
from jaxsat.control.least_squares import Fit
from jaxsat.control.oscillatory import Slow
from jaxsat.core.trees import Symmetric

PLANE = np.array([[5.0, -5.0, 0, 0, 0, 0], [0, 0, 5.0, -5.0, 0, 0]]) * 1e-3


def leaks() -> Leaks:
    """Two opposite pairs in a plane, one thruster along the normal, and a dead one."""
    basis = np.zeros((4, 6))
    basis[0, :2] = basis[1, 2:4] = basis[2, 4] = basis[3, 5] = 5e-3 / 0.6
    flat = jnp.array([True] * 4 + [False] * 2)
    return Leaks(basis, PLANE, flat, 0.6, 4e-7, 10.0, jnp.full(6, 0.02))


def fitted(*values: float) -> Fit:
    """A fit that is sure of the leaks."""
    estimate = jnp.concatenate([jnp.zeros(8), jnp.array(values)])
    covariance = Symmetric(1e-12 * jnp.eye(12))
    return Fit(estimate, covariance, jnp.zeros(3), jnp.zeros(10), jnp.array(0))


LIMIT = jnp.array([1.0, 1, 1, 1, 1, 0])


@jax.jit
def found_with(fit: Fit) -> LeakMemory:
    return leaks().found(fit, LIMIT, LeakMemory.none(6))


def test_most_push_is_that_of_a_linear_programme_and_makes_no_torque_in_the_plane():
    found = found_with(fitted(4e-3, -3e-3, 1.0, 0.0))
    about = np.array([4e-3, -3e-3]) @ np.asarray(leaks().basis)[:2]
    np.testing.assert_allclose(PLANE @ np.asarray(found.duty).T, 0, atol=1e-12)
    for way, side in enumerate((1, -1)):
        best = linprog(side * about[:4], A_eq=PLANE[:, :4], b_eq=[0, 0], bounds=(0, 1))
        assert float(found.push[way]) == pytest.approx(-best.fun, rel=1e-6)


def test_leaks_of_one_sign_alone_are_not_paired_with_the_thruster_of_that_sign():
    found = found_with(fitted(4e-3, 3e-3, 1.0, 0.0))
    assert float(found.push[0]) == 0
    np.testing.assert_allclose(found.push[1], 2 * 7e-3 * 5e-3 / 0.6, rtol=1e-6)
    found = found_with(fitted(-4e-3, -3e-3, 1.0, 0.0))
    np.testing.assert_allclose(found.push[1], 5e-3 / 0.6, rtol=1e-6)


def test_a_leak_in_the_noise_is_not_used():
    found = found_with(fitted(5e-4, -5e-4, 1.0, 0.0))
    np.testing.assert_array_equal(found.push, 0)


def test_pulses_of_a_combination_make_the_push_that_was_asked_for():
    one, fit = leaks(), fitted(4e-3, -3e-3, 1.0, 0.0)

    def cycle(memory, _):
        duty, memory = one.push(fit, jnp.array(1e-6), jnp.zeros(6), LIMIT, jnp.array(0.1), memory)
        return memory, (duty, 0.1 * fit.estimate[8:10] @ (one.basis @ duty)[:2])

    memory = found_with(fit)
    _, (duty, change) = jax.lax.scan(cycle, memory, length=1000)
    assert np.all((np.asarray(duty) == 0) | (np.asarray(duty) >= 0.2 - 1e-9))
    assert float(change.sum()) == pytest.approx(1e-4, rel=0.2)


def test_a_push_has_what_the_torques_in_the_plane_leave_and_takes_none_of_them():
    """Beside a torque that fills a thruster of the combination nothing is pushed, beside half of
    that the rest, and what the demand still lacks is owed."""
    one, fit, period = leaks(), fitted(4e-3, -3e-3, 1.0, 0.0), jnp.array(0.1)
    memory = found_with(fit)
    most, push = float(memory.push[1]), jax.jit(lambda *given: one.push(*given))
    place = int(jnp.argmax(memory.duty[1]))
    for own, part in ((1.0, 0.0), (0.5, 0.5), (0.0, 1.0)):
        duty = jnp.zeros(6).at[place].set(own)
        pushed, after = push(fit, memory.push[1], duty, LIMIT, period, memory)
        np.testing.assert_allclose(pushed - duty, part * memory.duty[1], atol=1e-12)
        np.testing.assert_allclose(PLANE @ (pushed - duty), 0, atol=1e-12)
        assert float(after.owed) == pytest.approx((1 - part) * most * 0.1, abs=1e-15)


def test_the_push_is_critically_damped_and_one_sign_alone_only_opposes_a_drift():
    both = jnp.array([1e-5, 2e-5])
    turn = wanted_push(Slow(jnp.array(0.0), jnp.array(0.01)), jnp.array(0.0), both)
    rate = wanted_push(Slow(jnp.array(1e-5), jnp.array(0.0)), jnp.array(0.0), both)
    square = -float(turn) / 0.01
    assert -float(rate) / 1e-5 == pytest.approx(2 * square**0.5)
    alone = jnp.array([0.0, 2e-5])
    slow = Slow(jnp.array(1e-3), jnp.array(0.1))
    assert float(wanted_push(slow, jnp.array(-1e-6), alone)) == pytest.approx(1e-6)
    assert float(wanted_push(slow, jnp.array(1e-6), alone)) == 0
