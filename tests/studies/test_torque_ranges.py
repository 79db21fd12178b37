"""What a history tells of the torque between its instants: the same as a single run does."""

import numpy as np
import pytest

from helpers.every_law import KEYS, library, scenario_of
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine

LAW = "quaternion-feedback"
SPREAD = {"constant_torque_N_m": {"distribution": "uniform", "low": -1e-18, "high": 1e-18}}
CHANGES = {"simulation": {"duration_s": 6, "save_every_s": 1}, "dispersion": SPREAD}


def pulsed():
    data = library("cubesat-12u") | {"failure": []}
    data["simulation"] |= CHANGES["simulation"]
    return Scenario.model_validate(data | {"dispersion": SPREAD}, context={"law": True})


def held():
    """Of a law that is quick to compile."""
    return scenario_of(LAW, control={"law": LAW, **KEYS[LAW], "period_s": 0.1}, **CHANGES)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "engines"),
    [
        (pulsed, [NativeEngine()]),
        (held, [NativeEngine(), ScanEngine(batch_size=2), ReferenceEngine(batch_size=2)]),
    ],
)
def test_ranges_are_those_of_a_single_run_in_every_engine(scenario, engines):
    """Of cases that do not differ, at the times that the run saves."""
    scenario = scenario()
    expected = build(scenario).simulate().torque_range
    assert expected is not None
    study = build_study(scenario, count=2, history=7)
    for engine in engines:
        one = type(study)(**{**vars(study), "engine": engine})
        found = one.values(np.arange(2))
        for key, part in (("min", "least"), ("max", "largest"), ("mean", "mean")):
            values = found[f"history_torque_{key}"]
            assert values.shape == (2, 7, 3)
            np.testing.assert_allclose(
                values, np.asarray(getattr(expected, part))[None].repeat(2, 0), atol=1e-9
            )
    spread = np.asarray(expected.largest - expected.least)
    assert spread.max() > 0
