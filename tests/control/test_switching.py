"""The sampled switching loop against an independent program, and its own rules."""

import jax.numpy as jnp
import numpy as np
import pytest

from helpers.switching import CASE, GAINS, START, J, start, switching_loop
from jaxsat.core.attitude import WZ
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.trajectory import Outcome
from jaxsat.spacecraft.dynamics import PlantState
from oracle import simulate_switched_sampled


@pytest.mark.slow
@pytest.mark.parametrize(
    ("relation", "attitude"), [("exact", "as_quaternion"), ("small-angle", "as_wz")]
)
def test_sampled_switching_against_the_oracle(relation, attitude):
    """States and modes over the first minute; later, errors grow tenfold in some 15 s."""
    case = {**CASE, "relation": relation}
    exact = simulate_switched_sampled(
        period=0.1,
        steps=600,
        substeps=4,
        **GAINS,
        k4=0.363 * J,
        enter=7.9e-3,
        leave=1.4e-3,
        **START,
        slope_limit_three_axis=25 / J,
        slope_limit_rate=5 / J,
        attitude_weight=0.914,
        torque_limit=5.0,
        **case,
    )
    result = simulate(switching_loop(case), start(attitude), jnp.linspace(0, 60, 601))
    run = result.signals
    assert result.outcome is Outcome.SUCCESS
    np.testing.assert_allclose(run.omega, exact.omega[:601], atol=1e-7)
    np.testing.assert_allclose(run.w, exact.w[:601], atol=1e-7)
    np.testing.assert_array_equal(run.mode[:600], exact.mode[:600])
    np.testing.assert_allclose(run.torque[:600, :2], exact.torque[:600], atol=1e-5)
    assert 0 < run.mode.mean() < 1


def test_hysteresis():
    """Between the thresholds the active law stays; beyond them it changes."""
    law = switching_loop(CASE).controller
    for begin, omega3, expected in [
        (0.02, 0.005, True),
        (0.02, 0.0013, False),
        (0.0, 0.005, False),
        (0.0, 0.008, True),
        (0.02, -0.005, True),
    ]:
        memory = law.init(PlantState(WZ([0.1, 0.1], 0.1), [0.0, 0.0, begin]))
        state = PlantState(WZ([0.1, 0.1], 0.1), [0.01, 0.02, omega3])
        assert bool(law.step(jnp.array(0.0), state, memory)[1].rate_law_active) is expected


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"upper": 1e-3}, "must not exceed"),
        ({"period": 0.0}, "`period` must be positive"),
        ({"lower": -1e-3}, "`lower_threshold` must be positive"),
    ],
)
def test_impossible_switching_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        switching_loop(CASE, **options)


def test_times_between_samples_are_refused():
    with pytest.raises(ValueError, match="multiples of the period"):
        simulate(switching_loop(CASE), start(), jnp.array([0.0, 0.25]))
