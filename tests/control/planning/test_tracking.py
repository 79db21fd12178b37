"""Feedback along a plan against dense least squares by NumPy, and the plan between its nodes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from control.planning.spacecraft import planner
from jaxsat.control.planning.tracking import mean_torque, tracking_gains
from jaxsat.control.planning.transcription import PlanObjective, Transcription, Unknowns

RANDOM = np.random.default_rng(21)
N, M = 4, 2


def program_and_plan():
    made = planner(orbit_rate=0.01)
    program = Transcription(made.model, made.torque_axes, made.limit, PlanObjective.TIME, N, 1)
    x = RANDOM.normal(size=(N + 1, 7)) * 0.3 + np.eye(7)[0]
    torque = jnp.asarray(RANDOM.uniform(-0.5, 0.5, (N, M)))
    return program, Unknowns(jnp.asarray(x[:-1]), jnp.asarray(x[-1]), torque, jnp.array(2.3))


@pytest.mark.slow
def test_gains_are_those_of_the_dense_problem():
    """K dx is the first of the torques that make the sum least, in every interval."""
    program, plan = program_and_plan()
    begin, weights, last = jnp.array(0.3), RANDOM.uniform(1, 9, 7), RANDOM.uniform(10, 90, 7)
    gains = jax.jit(
        lambda: tracking_gains(program, begin, plan, jnp.asarray(weights), jnp.asarray(last))
    )()
    interval = jax.jit(lambda *given: program.interval(*given))
    length, step = float(plan.duration) / N, 1e-6

    def by(k, v):
        def after(v):
            return np.asarray(
                interval(begin, jnp.array(float(k)), jnp.asarray(v[:7]), plan.duration, v[7:])
            )

        columns = [(after(v + step * e) - after(v - step * e)) / (2 * step) for e in np.eye(7 + M)]
        return np.stack(columns, axis=1)

    at = [np.concatenate([plan.states[k], plan.torque[k]]) for k in range(N)]
    slopes = [by(k, v) for k, v in enumerate(at)]
    for k in range(N):
        count = N - k
        rows, free, forced = [], np.eye(7), np.zeros((7, M * count))
        for j in range(k, N):
            weight = np.sqrt(length * weights)[:, None]
            rows.append((weight * free, weight * forced))
            a, b = slopes[j][:, :7], slopes[j][:, 7:]
            free, forced = a @ free, a @ forced
            forced[:, M * (j - k) : M * (j - k + 1)] += b
        weight = np.sqrt(last)[:, None]
        rows.append((weight * free, weight * forced))
        rows.append((np.zeros((M * count, 7)), np.sqrt(length) * np.eye(M * count)))
        of_state, of_torque = (np.concatenate(parts) for parts in zip(*rows, strict=True))
        found = np.linalg.lstsq(of_torque, -of_state, rcond=None)[0][:M]
        np.testing.assert_allclose(gains[k], found, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("passed", "period"), [(0.1, 0.2), (0.5, 0.3), (2.2, 0.4), (3.0, 0.1)])
def test_mean_torque(passed, period):
    program, plan = program_and_plan()
    torque = np.asarray(plan.torque)
    found = mean_torque(program, plan, jnp.array(passed), jnp.array(period))
    for thruster in range(M):

        def held(t, thruster=thruster):
            return torque[int(t / 2.3 * N), thruster] if t < 2.3 else 0.0

        ends = [end for end in 2.3 / N * np.arange(1, N + 1) if passed < end < passed + period]
        whole = quad(held, passed, passed + period, points=ends or None)[0]
        np.testing.assert_allclose(found[thruster], whole / period, atol=1e-9)
