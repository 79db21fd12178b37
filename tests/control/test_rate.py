"""The rate law against an independent program; the numbers of the paper: test_library.py.

Tolerances are relative to the size of the state at the start, as a user would count.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from helpers.paper import PAPER_RATE, bodies, rate_loop, rate_start, size
from jaxsat.control.rate import RateLaw
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.methods import fixed
from jaxsat.simulation.trajectory import Outcome
from oracle import simulate_rate_law


def test_the_torque_at_the_start_is_the_papers():
    case = {**PAPER_RATE, "amplitude": (0.01, 0.02, 0.0)}
    loop = rate_loop(case)
    torque = loop.motion(jnp.array(0.0), loop.start(rate_start(case))).torque
    np.testing.assert_allclose(torque, [-1866.845, 4462.509, 0.0], atol=6e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    "measured", [(True, True, False), (True, True, True), (False, False, False)]
)
def test_rate_law_across_the_zero_crossings(measured):
    """(37)-(39) with d3: 1e-7 before ω3 first changes sign (31 s), 1e-5 after."""
    times = np.linspace(0, 100, 1001)
    exact = simulate_rate_law(times, measured=measured, **PAPER_RATE)
    result = simulate(rate_loop(PAPER_RATE, measured), rate_start(PAPER_RATE), jnp.array(times))
    error = np.abs(result.signals.omega - exact.omega).max(axis=1) / size(PAPER_RATE)
    assert result.outcome is Outcome.SUCCESS
    assert error[times <= 20].max() < 1e-7
    assert error[times <= 60].max() < 1e-5
    if measured == (True, True, False):
        assert abs(result.signals.omega[630, 1] - 8.398e-4) < 5e-8


@pytest.mark.slow
def test_rate_law_from_other_starts():
    rng = np.random.default_rng(8)
    times = np.linspace(0, 20, 201)
    for _ in range(5):
        case = {
            **PAPER_RATE,
            "inertia": tuple(rng.uniform(200, 400, 3)),
            "omega0": tuple(rng.uniform(0.02, 0.2, 3) * rng.choice([-1, 1], 3)),
            "k1": rng.uniform(1, 5),
            "k2": rng.uniform(1, 10),
            "amplitude": (0.01, 0.02, 0.0),
            "phase": tuple(rng.uniform(-3, 3, 3)),
        }
        exact = simulate_rate_law(times, **case)
        run = simulate(rate_loop(case), rate_start(case), jnp.array(times)).signals
        assert np.abs(run.omega - exact.omega).max() < 1e-7 * size(case)


@pytest.mark.slow
def test_smooth_rate_law_comes_near_the_printed_one():
    """Its bias shrinks with the width; fixed steps serve it."""
    times = jnp.linspace(0, 20, 201)
    exact = simulate(rate_loop(PAPER_RATE), rate_start(PAPER_RATE), times).signals.omega
    bias = []
    for width in (1e-3, 1e-4, 1e-5):
        loop = rate_loop(PAPER_RATE, width=width)
        assert loop.controller.is_smooth()
        run = simulate(loop, rate_start(PAPER_RATE), times, method=fixed(0.01)).signals.omega
        bias.append(float(jnp.abs(run - exact).max()))
    assert bias[0] > 2 * bias[1] > 4 * bias[2]
    assert bias[1] < 0.05


@pytest.mark.parametrize(("gain", "value"), [("k1", 0.0), ("k2", -1.0), ("width", -1e-9)])
def test_impossible_rate_gains_are_refused(gain, value):
    with pytest.raises(ValueError, match=f"`{gain}` must be"):
        rate_loop({**PAPER_RATE, gain: value}, width=value if gain == "width" else 0.0)


def test_a_width_of_zero_is_the_printed_law():
    assert RateLaw(bodies(PAPER_RATE)[1], 5.0, 10.0, 0.0).width is None
