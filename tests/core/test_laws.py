"""The paper's laws against independent programs, and against the paper's own numbers.

The oracle writes every derivative out by hand and shares no code with the package. Tolerances are
relative to the size of the state at the start, as a user would count.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from core.cases import (
    PAPER_RATE,
    PAPER_THREE_AXIS,
    actuators,
    bodies,
    rate_loop,
    rate_start,
    three_axis_law,
    three_axis_loop,
    three_axis_start,
)
from jaxsat.simulation import ContinuousLoop, Outcome, adaptive, fixed, simulate
from oracle import simulate_rate_law, simulate_three_axis, simulate_three_axis_smooth

REFERENCE = {  # w1 w2 z ω1 ω2 at these times, two integrators agreeing to 1e-10
    1: (-0.851881952, 0.854286967, 1.27668478, 0.108906382, -0.115762285),
    10: (-0.0771835613, 0.0996920062, 1.25752275, 0.119500366, -0.108519713),
    50: (-0.27100682, -0.426002561, 0.0201378003, 0.0380914367, 0.0669546727),
    100: (0.475167421, 0.425509462, -0.0211442977, -0.0167520541, -0.016106661),
    200: (0.00403253398, 0.0380743072, -1.2147126e-4, 0.00315826567, 0.0201422991),
    500: (6.53474535e-4, 0.00282377877, -6.56529e-7, 2.88946e-4, -3.18765e-5),
}


def size(case):
    return np.linalg.norm([*case.get("w0", ()), case.get("z0", 0.0), *case["omega0"]])


def state_error(run, exact, case):
    """Largest error of (w, z, ω) at each time, relative to the start."""
    parts = [
        np.abs(run.w - exact.w).max(1),
        np.abs(run.z - exact.z),
        np.abs(run.omega - exact.omega).max(1),
    ]
    return np.max(parts, axis=0) / size(case)


@pytest.mark.slow
def test_paper_three_axis_to_the_digits_given():
    run = simulate(
        three_axis_loop(PAPER_THREE_AXIS),
        three_axis_start(PAPER_THREE_AXIS),
        jnp.linspace(0, 500, 501),
    ).signals
    for time, expected in REFERENCE.items():
        found = [*run.w[time], run.z[time], *run.omega[time, :2]]
        np.testing.assert_allclose(found, expected, rtol=0, atol=6e-9)
    np.testing.assert_allclose(run.torque[0], [4.64475, -1.96820, 0.0], atol=5e-6)


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
    times = np.linspace(0, duration, int(duration) + 1)
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
@pytest.mark.parametrize("limit", [pytest.param(np.inf, marks=pytest.mark.slow), 3.0])
def test_smooth_three_axis_law_at_torque_level(relation, limit):
    """The derivative of the reference by jvp against the chain rule by hand, torques clipped."""
    case = {**PAPER_THREE_AXIS, "relation": relation, "third_rate": "free"}
    times = np.linspace(0, 40, 41)
    exact = simulate_three_axis_smooth(times, width=0.2, torque_limit=limit, **case)
    law = three_axis_law(case, saturation_width=1.0, tilt_width=0.2)
    assert law.is_smooth()
    loop = ContinuousLoop(bodies(case)[0], law, actuators(limit))
    run = simulate(loop, three_axis_start(case), jnp.array(times), method=adaptive()).signals
    assert state_error(run, exact, case).max() < 1e-7
    np.testing.assert_allclose(run.torque[:, :2], exact.torque, atol=1e-6)
    if limit == np.inf:
        default = simulate(loop, three_axis_start(case), jnp.array(times)).signals
        assert state_error(default, exact, case).max() < 1e-7


RATE_TABLE = {  # d3 = 0, ω1 ω2 ω3
    0.1: (-0.1585116283, 0.9360311234, 0.0971152926),
    0.5: (-0.1926189075, 0.9657223368, 0.0381903163),
    1.0: (-0.0936715593, 0.4683755027, 0.0087779016),
    5.0: (-2.523999840e-4, 1.261999920e-3, 6.370575e-8),
}


@pytest.mark.slow
def test_rate_law_without_third_disturbance_to_the_digits_given():
    case = {**PAPER_RATE, "amplitude": (0.01, 0.02, 0.0)}
    times = jnp.linspace(0, 20, 2001)
    run = simulate(rate_loop(case), rate_start(case), times).signals
    for time, expected in RATE_TABLE.items():
        np.testing.assert_allclose(run.omega[round(100 * time)], expected, rtol=1e-9, atol=6e-11)
    np.testing.assert_allclose(run.torque[0], [-1866.845, 4462.509, 0], atol=6e-4)
    early = simulate(rate_loop(case), rate_start(case), times / 40).signals
    assert abs(jnp.abs(early.omega[:, 1]).max() - 1.230869) < 6e-7


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


@pytest.mark.parametrize("gain", ["k3", "k4", "mu", "a"])
def test_impossible_three_axis_gains_are_refused(gain):
    with pytest.raises(ValueError, match=f"`{gain}` must be positive"):
        three_axis_law({**PAPER_THREE_AXIS, gain: -0.1})
