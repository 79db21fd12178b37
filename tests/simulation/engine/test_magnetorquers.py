"""Magnetorquers beside wheels, dispersed and failing: the same in every engine."""

import numpy as np
import pytest

from helpers.magnetic import document
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import build_study
from simulation.engine.examples import agreed

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
    agreed(study.program, study.cases(np.arange(4)), 0.5, apart=1e-7)
