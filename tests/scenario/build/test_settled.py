"""Within what and for how long a scenario says that a case counts as settled."""

import numpy as np
import pytest

from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study

LIMITS = {"tilt_rad": 0.3, "turn_rad": 0.2, "rate_rad_s": 0.02}
CHANGES = [
    *(f"settled.{key}={value}" for key, value in LIMITS.items()),
    "simulation.duration_s=120",
    "simulation.save_every_s=0.1",
    "dispersion.torque_gain={distribution='uniform', low=-1e-9, high=1e-9}",
]


def last_outside(signals, times):
    """The last saved time at which a limit is passed, from quaternion and rates."""
    w, x, y, z = np.asarray(signals.quaternion).T
    tilt = 2 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    turn = 2 * np.arctan2(z, w)
    turn = np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
    rate = np.linalg.norm(np.asarray(signals.relative_rate), axis=1)
    limits = np.array(list(LIMITS.values()))[:, None]
    return times[np.flatnonzero((np.stack([tilt, turn, rate]) > limits).any(axis=0))[-1]]


@pytest.mark.slow
@pytest.mark.parametrize(("dwell", "settles"), [(40.0, True), (60.0, False)])
def test_runs_and_cases_settle_within_the_keys(dwell, settles):
    scenario = load("two-torque-free", [*CHANGES, f"settled.dwell_s={dwell}"])
    run = build(scenario).simulate()
    right = last_outside(run.signals, np.asarray(run.times))
    assert 61 < right < 79
    right = pytest.approx(right, abs=0.1) if settles else np.inf
    assert float(run.assessment.settled_from) == right
    outputs = build_study(scenario, 1, engine="native").evaluate(np.arange(1))
    assert float(outputs.settling_time[0]) == right


def test_keys_are_those_of_tolerances():
    usual = Tolerances.of_keys()
    assert [float(usual.w), float(usual.z), float(usual.relative_rate)] == [0.05, 0.05, 1e-3]
    assert (
        usual.text() == "|w| < 0.05, |z| < 0.05 rad, relative rate |ω_r| < 0.001 rad/s to the end"
    )
    own = Tolerances.of_keys(tilt_rad=np.pi / 2, turn_rad=0.1, rate_rad_s=2e-3, dwell_s=5.0)
    assert float(own.w) == pytest.approx(1)  # the tangent of half the angle
    assert own.text(attitude=False) == "|ω| < 0.002 rad/s to the end, 5 s at least"
