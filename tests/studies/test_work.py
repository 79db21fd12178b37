"""What a study will take, known before it starts."""

import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.store.store import StudyStore
from jaxsat.studies.executors import Devices, Serial, Threads
from jaxsat.studies.processes import Processes
from jaxsat.studies.statistics import StopRule
from jaxsat.studies.work import most_cases, study_work
from jaxsat.synthesis.execution import Execution


@pytest.mark.parametrize("half_width", [0.2, 0.03, 0.01])
def test_no_sample_needs_more_cases_than_the_most(half_width):
    rule = StopRule(half_width)
    most = most_cases(rule, 10**9)
    for count in (most, most + 1, 2 * most):
        settled = np.unique(np.linspace(0, count, 30).astype(int))
        assert all(rule.met(int(one), count) for one in settled)
    assert most == rule.least or not rule.met((most - 1) // 2, most - 1)
    assert most_cases(rule, 7) == 7


def test_work_of_a_study():
    scenario = load("acceptance-mc", ["simulation.duration_s=5"])
    study = build_study(scenario, 10**8, engine="scan", chunk=100, batch_size=8)
    work = study_work(study)
    assert work.trajectories == 10**8
    assert work.steps == 10**8 * study.program.intervals * study.case_factory.loop.substeps
    assert work.disk > 10**8 * 100
    assert work.memory > 10**9
    some = study_work(study, StopRule(0.2), workers=2)
    assert some.trajectories == (1 + 2) * 100
    assert some.memory < 10**7


def test_memory_grows_with_the_chunks_that_an_executor_computes_at_once():
    study = build_study(load("acceptance-mc", ["simulation.duration_s=5"]), 1000, chunk=100)
    sizes = [
        Execution(executor=executor).work(study).memory
        for executor in (None, Serial(), Threads(3), Devices(1), Processes(2, 3))
    ]
    share = sizes[2] - sizes[1]
    assert sizes[0] == sizes[1] == sizes[3] == sizes[2] - share
    assert share > 0
    assert sizes[4] - sizes[1] == share / 2 * 5  # beside the first


@pytest.mark.slow
def test_small_chunks_take_whole_blocks(tmp_path):
    """As a store of such chunks does on a disk whose blocks have 4 kB."""
    scenario = load("acceptance-mc", ["simulation.duration_s=5"])
    study = build_study(scenario, 20, engine="scan", chunk=1, batch_size=1)
    columns, sizes = study.columns(), []
    values = {name: np.zeros((1, *one.shape), one.dtype) for name, one in columns.items()}
    for count in (10, 20):
        with StudyStore(tmp_path / f"{count}", {}, columns, count, 1) as store:
            for chunk in range(count):
                store.write(chunk, values)
        every = list((tmp_path / f"{count}").rglob("*"))
        blocks = sum(max(1, -(-one.stat().st_size // 4096)) for one in every)
        sizes.append((len(every), 4096 * blocks))
    work = study_work(study)
    assert work.files / 2 == pytest.approx(sizes[1][0] - sizes[0][0], abs=1)
    assert work.disk / 2 == pytest.approx(sizes[1][1] - sizes[0][1], rel=0.1)
