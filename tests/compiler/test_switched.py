"""Located switches in the compiled engine: the scan engine's numbers, and exact derivatives."""

import jax
import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.studies.ensemble import Study
from simulation.engine.examples import same_bits

COUNT, DURATION = 6, 30.0
GAINS = {"k3": np.array(0.05), "mu": np.array(1.0), "a": np.array(0.1), "k4": np.array(0.01)}
STEP = 1e-3
"""Of a gain, in parts of it; differences over it and over twice as much cancel its square."""

DISPERSED = (
    "dispersion.tilt={distribution='uniform', low=0.5, high=1.2}",
    "dispersion.tilt_direction_rad={distribution='uniform', low=0.0, high=6.283}",
)


def study(name: str) -> Study:
    dispersed = DISPERSED if name == "free-third-rate" else ()
    scenario = load(name, [f"simulation.duration_s={DURATION}", *dispersed])
    return build_study(scenario, COUNT, seed=5, engine="scan")


def native(tolerance: float) -> NativeEngine:
    return NativeEngine(AdaptiveStepper(tolerance=Tolerance(tolerance, tolerance)), workers=1)


@pytest.mark.slow
def test_it_agrees_with_the_scan_engine_to_the_tolerance():
    """With a third rate that is held: native/test_engine.py."""
    work = study("free-third-rate")
    cases, engine = work.cases(np.arange(COUNT)), native(1e-9)
    scan = ScanEngine(engine.stepper, COUNT)
    found, expected = (one.evaluate(work.program, cases, GAINS) for one in (engine, scan))
    assert found.code.tolist() == [0] * COUNT
    for name in ("cost", "effort", "peak_rate", "w", "z", "quaternion", "omega"):
        x, y = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(x, y, rtol=1e-7, atol=1e-7, err_msg=name)
    replay = engine.replay(work.program, jax.tree.map(lambda x: x[2], cases), GAINS)
    same_bits(replay.outputs, jax.tree.map(lambda x: x[2], found))


@pytest.mark.slow
def test_gradients_of_the_exact_law_are_its_central_differences():
    work, engine = study("benchmark-three-axis"), native(1e-12)
    cases = work.cases(np.arange(COUNT))
    found = engine.gradient(work.program, cases, GAINS)
    same = engine.evaluate(work.program, cases, GAINS)
    np.testing.assert_allclose(found.outputs.cost, same.cost, rtol=1e-12)

    def slope(name: str, part: float) -> np.ndarray:
        step = part * GAINS[name]
        costs = [
            engine.evaluate(work.program, cases, {**GAINS, name: np.asarray(GAINS[name] + shift)})
            for shift in (step, -step)
        ]
        return (costs[0].cost - costs[1].cost) / (2 * step)

    for name, derivative in found.derivatives.items():
        exact = (4 * slope(name, STEP) - slope(name, 2 * STEP)) / 3
        np.testing.assert_allclose(derivative, exact, rtol=1e-6, err_msg=name)
