"""The three-axis law against independent programs; the numbers of the paper: test_library.py.

The oracle writes every derivative out by hand and shares no code with the package. Tolerances are
relative to the size of the state at the start, as a user would count.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.paper import (
    PAPER_THREE_AXIS,
    actuators,
    bodies,
    size,
    three_axis_law,
    three_axis_loop,
    three_axis_start,
)
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive
from jaxsat.simulation.trajectory import Outcome
from oracle import simulate_three_axis, simulate_three_axis_smooth


def state_error(run, exact, case):
    """Largest error of (w, z, ω) at each time, relative to the start."""
    parts = [
        np.abs(run.w - exact.w).max(1),
        np.abs(run.z - exact.z),
        np.abs(run.omega - exact.omega).max(1),
    ]
    return np.max(parts, axis=0) / size(case)


def test_the_torque_at_the_start_is_the_papers():
    loop = three_axis_loop(PAPER_THREE_AXIS)
    state = loop.start(three_axis_start(PAPER_THREE_AXIS))
    torque = jax.jit(lambda t: loop.motion(t, state).torque)(0.0)
    np.testing.assert_allclose(torque, [4.64475, -1.96820, 0.0], atol=6e-6)


SAVED = 101
"""Times that are saved of a run: of all as many, which are one compiled program for each law."""


def three_axis_cases():
    """The paper's case, its variants, and random starts with gains around the printed ones.

    Runs with the third rate free or the exact orbit relation end before w begins to slide on zero,
    where the printed law has no unique solution.
    """
    rng = np.random.default_rng(5)
    yield "paper", PAPER_THREE_AXIS, 500.0
    yield "exact orbit", {**PAPER_THREE_AXIS, "relation": "exact"}, 400.0
    detuned = {"internal_model_frequency": (0.5, 0.9), "k4": (0.02, 0.5)}
    yield "detuned internal model", {**PAPER_THREE_AXIS, **detuned}, 200.0
    free = {**PAPER_THREE_AXIS, "third_rate": "free"}
    yield "free third rate", free, 150.0
    yield (
        "free, exact orbit",
        {**free, "relation": "exact", "omega0": (0.05, 0.02, 0.003), "phase": (1.0, -2.0, 0.5)},
        100.0,
    )
    for number in range(8):
        yield (
            f"random {number}",
            {
                **PAPER_THREE_AXIS,
                "inertia": tuple(rng.uniform(200, 450, 3)),
                "w0": tuple(rng.uniform(-1, 1, 2)),
                "z0": rng.uniform(-1.5, 1.5),
                "omega0": (*rng.uniform(-0.1, 0.1, 2), 0.0),
                "k3": 0.05 * rng.uniform(0.8, 1.25),
                "k4": 0.01 * rng.uniform(0.5, 2.0),
                "mu": rng.uniform(0.8, 1.25),
                "a": 0.1 * rng.uniform(0.8, 1.25),
                "phase": tuple(rng.uniform(-3, 3, 3)),
            },
            500.0,
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "duration"),
    [pytest.param(case, end, id=name) for name, case, end in three_axis_cases()],
)
def test_three_axis_law_against_the_oracle(case, duration):
    """(36), (37), (40)-(43): states, torque, rate error and Lyapunov function."""
    times = np.linspace(0, duration, SAVED)
    exact = simulate_three_axis(times, **case)
    result = simulate(three_axis_loop(case), three_axis_start(case), jnp.array(times))
    run = result.signals
    assert result.outcome is Outcome.SUCCESS
    assert state_error(run, exact, case).max() < 1e-7
    np.testing.assert_allclose(run.rate_error, exact.eta, atol=1e-7 * size(case))
    if "internal_model_frequency" not in case:  # tuned elsewhere, V is not that of the proof
        assert np.abs(run.lyapunov - exact.lyapunov).max() < 1e-7 * exact.lyapunov[0]
    # The torque jumps where sat switches: compare where a whole neighbourhood agrees.
    assert np.median(np.abs(run.torque[:, :2] - exact.torque)) < 1e-7 * np.abs(exact.torque).max()


@pytest.mark.slow
@pytest.mark.parametrize("relation", ["exact", "small-angle"])
@pytest.mark.parametrize("limit", [np.inf, 3.0])
def test_smooth_three_axis_law_at_torque_level(relation, limit):
    """The derivative of the reference by jvp against the chain rule by hand, torques clipped."""
    case = {**PAPER_THREE_AXIS, "relation": relation, "third_rate": "free"}
    times = np.linspace(0, 40, 41)
    exact = simulate_three_axis_smooth(times, width=0.2, torque_limit=limit, **case)
    law = three_axis_law(case, saturation_width=1.0, tilt_width=0.2)
    assert law.is_smooth()
    loop = ContinuousLoop(bodies(case)[0].with_effectors((actuators(limit),)), law)
    run = simulate(loop, three_axis_start(case), jnp.array(times), method=adaptive()).signals
    assert state_error(run, exact, case).max() < 1e-7
    np.testing.assert_allclose(run.torque[:, :2], exact.torque, atol=1e-6)
    if limit == np.inf:
        default = simulate(loop, three_axis_start(case), jnp.array(times)).signals
        assert state_error(default, exact, case).max() < 1e-7


@pytest.mark.parametrize("gain", ["k3", "k4", "mu", "a"])
def test_impossible_three_axis_gains_are_refused(gain):
    with pytest.raises(ValueError, match=f"`{gain}` must be positive"):
        three_axis_law({**PAPER_THREE_AXIS, gain: -0.1})
