"""When the interior-point method calls a plan optimal."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from control.planning.spacecraft import PAPER, planner
from jaxsat.control.planning.interior_point import Settings, begun, iterated, solve
from jaxsat.control.planning.transcription import PlanObjective, Transcription, Unknowns

N, ANGLE, DURATION = 16, 0.02, 0.8


def slow_turn(program):
    """Rest to rest about x with the same torque all the way and back: it arrives, but is dear."""
    relative = PAPER[0, 0] / float(jnp.mean(program.model.spacecraft.moments))
    torque = 4 * relative * ANGLE / DURATION**2
    assert torque < 0.3
    t = np.linspace(0, DURATION, N + 1)
    early = t <= DURATION / 2
    left = np.where(early, t, DURATION - t)
    turned = ANGLE * 2 * (left / DURATION) ** 2
    angle = np.where(early, ANGLE - turned, turned)
    rate = -torque / relative * left
    zero = np.zeros_like(t)
    x = np.stack([np.cos(angle / 2), np.sin(angle / 2), zero, zero, rate, zero, zero], axis=1)
    u = np.zeros((N, 2))
    u[: N // 2, 0], u[N // 2 :, 0] = -torque, torque
    return Unknowns(*map(jnp.asarray, (x[:-1], x[-1], u, DURATION))), torque


@pytest.mark.slow
def test_a_plan_of_given_duration_is_optimal_only_where_its_effort_is():
    """Also where the weight of changes keeps each step, and so what it changes, small."""
    made = planner()
    effort = PlanObjective.EFFORT
    program = Transcription(made.model, made.torque_axes, made.limit, effort, N, 1)
    plan, torque = slow_turn(program)
    begin, barrier = jnp.array(0.0), 3e-5
    assert program.defects(begin, plan) < 1e-8
    held = Settings(barrier, barrier, 1e5, 1)
    first = begun(program, begin, plan, held)
    one = jax.jit(lambda: iterated(program, begin, first, held))()
    assert one.defects < 1e-7  # it arrives and has hardly moved
    np.testing.assert_allclose(one.unknowns.torque, plan.torque, atol=1e-3)
    assert not one.done
    found = jax.jit(lambda: solve(program, begin, plan, Settings(1e-3, barrier, 0.01, 200)))()
    assert found.done
    assert program.value(found.unknowns) < 0.8 * program.value(plan)
    # bangs of b each at both ends: relative θ = b (T - b)
    relative = torque * DURATION**2 / 4
    bang = (DURATION - np.sqrt(DURATION**2 - 4 * relative)) / 2
    assert program.value(found.unknowns) == pytest.approx(2 * bang, rel=0.1)
