"""The coast ahead against SciPy's integration, and where a search begins."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from control.planning.spacecraft import PAPER, ZERO, planner, state
from jaxsat.control.planning.guesses import LEAST_REST, resampled, slew_duration
from jaxsat.control.planning.transcription import PlanObjective, Transcription, Unknowns


def program(objective=PlanObjective.TIME) -> Transcription:
    made = planner()
    return Transcription(made.model, made.torque_axes, made.limit, objective, 4, 1)


def coasted_by_scipy(quaternion, omega, duration):
    def rates(t, y):
        w, v, omega = y[0], y[1:4], y[4:]
        turning = np.concatenate([[-v @ omega], w * omega + np.cross(v, omega)]) / 2
        spin = np.linalg.solve(PAPER, -np.cross(omega, PAPER @ omega))
        return np.concatenate([turning, spin])

    start = np.concatenate([quaternion, omega])
    return solve_ivp(rates, (0, duration), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@pytest.mark.parametrize("steps", [0, 1, 11])
def test_a_fast_spin_coasts_as_by_scipy(steps):
    """1.5 rad/s over up to 1.1 s, of which one Runge-Kutta step would miss 0.004."""
    made, q = program(), np.array([0.5, -0.5, 0.1, 0.7])
    q, omega, step = q / np.linalg.norm(q), np.array([0.9, -0.8, 0.9]), 0.1
    x, h = made.scaled(state(q, omega)), jnp.array(step) / made.time_unit
    # one more is allowed than there are
    found = jax.jit(lambda n: made.coasted(jnp.array(0.0), x, h, n, 12))(jnp.array(steps))
    known = coasted_by_scipy(q, omega, steps * step)
    np.testing.assert_allclose(found[:4], known[:4], atol=2e-6)
    np.testing.assert_allclose(found[4:] / made.time_unit, known[4:], atol=2e-6)
    assert np.linalg.norm(found[:4]) == pytest.approx(1.0, abs=1e-15)
    if steps == 11:
        once = made.coasted(jnp.array(0.0), x, h * steps, jnp.array(1), 1)
        assert np.abs(once[:4] - known[:4]).max() > 1e-3


def test_no_more_steps_than_are_allowed():
    made = program()
    x, h = made.scaled(state([1.0, 0, 0, 0], [0.1, 0, 0])), jnp.array(0.1)
    known = made.coasted(jnp.array(0.0), x, h, jnp.array(3), 3)
    np.testing.assert_array_equal(made.coasted(jnp.array(0.0), x, h, jnp.array(9), 3), known)


@pytest.mark.parametrize(
    ("objective", "rest"), [(PlanObjective.TIME, LEAST_REST), (PlanObjective.EFFORT, 0.01)]
)
def test_only_a_duration_that_is_sought_is_lengthened(objective, rest):
    """What is left of a plan of least time lasts a while; a duration that is given stays."""
    made = program(objective)
    at = jnp.tile(made.target, (4, 1))
    known = Unknowns(at, made.target, jnp.zeros((4, 2)), jnp.array(0.03))
    found = resampled(made, made.target, known, jnp.array(0.02))
    assert found.duration == pytest.approx(rest)


def test_the_duration_of_a_guess_has_no_derivative():
    """At the target the root in it has none; NaN would go through the whole search."""
    made = program()
    slope = jax.grad(lambda x: slew_duration(made, x))(made.scaled(state([1.0, 0, 0, 0], ZERO)))
    np.testing.assert_array_equal(slope, np.zeros(7))
