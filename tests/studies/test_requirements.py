"""Requirements of the cases of a study: margins in every engine, the summary, the document."""

import dataclasses

import numpy as np
import pytest

from jaxsat.report.requirements import study_requirements
from jaxsat.scenario.formulas import parse
from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.requirements import Requirements, saved_margin
from jaxsat.spacecraft.environment.orbit import CircularOrbit
from jaxsat.spacecraft.environment.orbital_torques import Sunlight
from jaxsat.store.ledger import study_columns
from jaxsat.store.tables import open_study
from jaxsat.studies.run import run_study
from jaxsat.studies.statistics import wilson
from jaxsat.studies.summary import summarise
from studies.studies import tumbling

FORMULAS = {
    "SLOW": "always[5.5 s, end - 3.2 s] rate < 1 deg/s",
    "POINT": "eventually[2 s, 9 s] (pointing_error < 3 deg and not tilt > 2 deg)",
    "SUN": "rate_x > -0.05 rad/s until[0 s, 12 s] sun_angle(1, 0, 0) > 60 deg",
    "LATER": "always[failure + 1 s, end] relative_rate < 1 rpm",
}
LIGHT = Sunlight(np.array([1.0, 0.2, -0.4]), CircularOrbit(1e-3, 0.9, 0.4, 0.2, 0.0))


def study(engine=None, count=6):
    made = tumbling(count, 5)
    formulas = tuple(map(parse, FORMULAS.values()))
    requirements = Requirements(tuple(FORMULAS), formulas, 20.0, LIGHT)
    program = dataclasses.replace(made.program, requirements=requirements)
    return dataclasses.replace(made, program=program, engine=engine or made.engine)


ENGINES = {
    "scan": ScanEngine(stepper=FixedStepper(substeps=2), batch_size=4),
    "native": NativeEngine(stepper=FixedStepper(substeps=2), batch_size=4),
    "adaptive-native": NativeEngine(stepper=AdaptiveStepper(), batch_size=4),
    "diffrax": ReferenceEngine(batch_size=4),
}


NAMES = [one if "native" in one else pytest.param(one, marks=pytest.mark.slow) for one in ENGINES]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_margins_are_those_of_the_history(name):
    made = study(ENGINES[name])
    columns = made.values(np.arange(6))
    assert len(np.unique(columns["requirement_margin"][:, 0])) == 6
    for case in (0, 5):
        replay = made.replay(case)
        signals = {"quaternion": replay.signals.quaternion, "omega": replay.signals.omega}
        signals["relative_rate"] = replay.signals.relative_rate
        for place, text in enumerate(FORMULAS.values()):
            found = saved_margin(parse(text), replay.times, signals, np.zeros(0), LIGHT)
            margin = float(found.value)
            assert columns["requirement_margin"][case, place] == pytest.approx(margin, abs=1e-9)
            if np.isfinite(margin):
                assert columns["requirement_comparison"][case, place] == int(found.comparison)
                time = columns["requirement_time"][case, place]
                assert time == pytest.approx(float(found.time), abs=1e-9)
        assert columns["requirement_margin"][case, 3] == np.inf  # nothing fails


@pytest.mark.slow
def test_a_store_tells_the_worst_case_of_each(tmp_path):
    run_study(study(ENGINES["native"]), tmp_path / "s.zarr")
    dataset, columns = open_study(tmp_path / "s.zarr"), study_columns(tmp_path / "s.zarr")
    assert list(dataset["requirement"].values) == list(FORMULAS)
    found = summarise(columns).requirements
    assert str(found) == str(summarise(dataset).requirements)  # some times are NaN
    margins = dataset["requirement_margin"].values
    assert [one.name for one in found] == list(FORMULAS)
    for place, one in enumerate(found):
        assert one.margin == margins[:, place].min() == margins[one.worst, place]
        assert one.met == wilson(int((margins[:, place] >= 0).sum()), 6)
    tables = [
        {"id": "SLOW", "text": "It is slow.", "formula": FORMULAS["SLOW"]},
        {"id": "TORQUE", "formula": "always torque < 1 N m"},
    ]
    (table,) = study_requirements(found, {"requirement": tables})
    (_, text, *shown, case, _), other = table.rows
    assert (text, case) == ("It is slow.", found[0].worst)
    met, margin = (getattr(cell, "value", None) for cell in shown)
    assert met == found[0].met.value
    assert margin == pytest.approx(np.degrees(found[0].margin))
    assert other[2] == "not judged in studies"
    assert study_requirements(found, {}) == []
