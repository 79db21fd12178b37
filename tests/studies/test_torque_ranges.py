"""What a history tells of the torque between its instants: the same as a single run does."""

import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine

SCENARIO = [
    "simulation.duration_s=6",
    "simulation.save_every_s=1",
    "dispersion={constant_torque_N_m={distribution='uniform',low=-1e-18,high=1e-18}}",
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "engines"),
    [
        ("cubesat-12u", "failure=[]", [NativeEngine()]),
        (
            "two-torque-free",
            "control.law=oscillatory",
            [NativeEngine(), ScanEngine(batch_size=2), ReferenceEngine(batch_size=2)],
        ),
    ],
)
def test_ranges_are_those_of_a_single_run_in_every_engine(name, change, engines):
    """Of cases that do not differ, at the times that the run saves."""
    scenario = load(name, [*SCENARIO, change])
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
