"""Magnetorquers beside wheels, dispersed and failing: the same in every engine."""

import diffrax
import numpy as np
import pytest

from helpers.magnetic import document
from jaxsat.assembly.study import build_study
from jaxsat.engine import NativeEngine, ReferenceEngine, SampledStepper, ScanEngine
from jaxsat.scenario import Scenario
from jaxsat.simulation import fixed

DISPERSED = {
    "dipole_limit": {"distribution": "uniform", "low": -0.5, "high": 0.5},
    "magnetorquer_misalignment_rad": {"distribution": "normal", "mean": 0.0, "sigma": 0.05},
    "failed_magnetorquer": {"distribution": "uniform", "low": -0.5, "high": 2.5},
    "failure_time_s": {"distribution": "uniform", "low": 0.0, "high": 20.0},
    "failure_kind": {"distribution": "uniform", "low": -0.5, "high": 3.5},
}


@pytest.mark.slow
def test_engines_agree_and_cases_keep_their_bits():
    data = document(2, failing=True)
    data["simulation"]["duration_s"] = 20.0
    data["dispersion"] = DISPERSED
    study = build_study(Scenario.model_validate(data), count=4)
    program, cases = study.program, study.cases(np.arange(4))
    engine = NativeEngine(SampledStepper(diffrax.Dopri8()))
    found = engine.evaluate(program, cases)
    scanned = ScanEngine(SampledStepper(diffrax.Dopri8()), 4).evaluate(program, cases)
    reference = ReferenceEngine(fixed(0.5, diffrax.Dopri8()), batch_size=4).evaluate(program, cases)
    for other in (scanned, reference):
        np.testing.assert_allclose(found.omega, other.omega, atol=1e-13)
        np.testing.assert_allclose(found.quaternion, other.quaternion, atol=1e-12)
        np.testing.assert_allclose(found.effort, other.effort, rtol=1e-9)
    apart = np.abs(found.omega[:, None] - found.omega[None]).max(axis=2) + np.eye(4)
    assert apart.min() > 1e-7
    alone = engine.evaluate(program, study.cases(np.arange(2, 3)))
    assert alone.omega.tobytes() == found.omega[2:3].tobytes()
