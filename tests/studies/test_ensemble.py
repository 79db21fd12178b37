"""Studies: the same bits however they are computed, interrupted or resumed."""

import dataclasses

import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.methods import adaptive
from jaxsat.simulation.trajectory import Outcome
from jaxsat.store.files import OutputError
from jaxsat.store.tables import open_study
from jaxsat.studies.designs import LatinHypercube, Sobol
from jaxsat.studies.distributions import Discrete, Uniform
from jaxsat.studies.ensemble import _by_column
from jaxsat.studies.executors import Serial, Threads
from jaxsat.studies.run import run_study
from jaxsat.studies.statistics import StopRule, wilson
from jaxsat.studies.summary import summarise
from studies.stores import contents, same, without_status
from studies.studies import tumbling


@pytest.fixture(scope="module")
def whole():
    return _by_column(tumbling().evaluate(np.arange(100)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chunk", "executor"), [(16, Serial()), (7, Threads(2)), (100, Serial()), (33, Threads(3))]
)
def test_the_store_has_the_same_bits_for_every_chunk_and_executor(tmp_path, whole, chunk, executor):
    seen = []
    run_study(tumbling(chunk=chunk), tmp_path / "s", executor=executor, report=seen.append)
    same(without_status(contents(tmp_path / "s")), whole)
    assert [p.done for p in seen][-1] == 100
    assert seen[-1].seconds_left == 0
    assert seen[-1].settled == np.isfinite(whole["settling_time"]).sum()
    assert 0 < seen[-1].fraction_settled < 1


@pytest.mark.slow
def test_a_study_goes_on_where_it_was_left(tmp_path, whole):
    class Broken(Exception):
        pass

    def stop(progress):
        if progress.done >= 32:
            raise Broken

    with pytest.raises(Broken):
        run_study(tumbling(), tmp_path / "s", report=stop)
    assert contents(tmp_path / "s")["status"].sum() == 32
    seen = []
    assert run_study(tumbling(), tmp_path / "s", report=seen.append) == 100
    assert seen[0].done == 48
    same(without_status(contents(tmp_path / "s")), whole)
    assert run_study(tumbling(), tmp_path / "s", report=seen.append) == 100
    assert len(seen) == 5


@pytest.mark.slow
def test_a_smaller_study_grows_into_a_larger(tmp_path, whole):
    run_study(tumbling(count=40), tmp_path / "s")
    run_study(tumbling(count=100), tmp_path / "s")
    same(without_status(contents(tmp_path / "s")), whole)


@pytest.mark.slow
def test_another_study_is_not_mixed_in(tmp_path):
    run_study(tumbling(count=8), tmp_path / "s")
    for other in ({"seed": 5}, {"batch_size": 4}, {"duration": 21.0}, {"design": Sobol(4)}):
        with pytest.raises(OutputError, match="another study"):
            run_study(tumbling(count=8, **other), tmp_path / "s")


@pytest.mark.slow
def test_a_stop_rule_stops_at_the_first_chunks_that_meet_it(tmp_path, whole):
    rule = StopRule(0.12, least=10)
    settled = np.isfinite(whole["settling_time"])
    expected = next(n for n in range(16, 100, 16) if rule.met(int(settled[:n].sum()), n))
    for name, executor in (("a", Serial()), ("b", Threads(3))):
        found = run_study(tumbling(), tmp_path / name, executor=executor, until=rule)
        assert found == expected < 100
        assert contents(tmp_path / name)["status"].sum() < 100
    with pytest.raises(ValueError, match="Latin hypercube"):
        run_study(tumbling(design=LatinHypercube(4, 100)), tmp_path / "c", until=rule)


def test_a_hypercube_of_another_size_is_refused():
    with pytest.raises(ValueError, match="size 100"):
        tumbling(design=LatinHypercube(4, 50))


def test_replay_gives_the_bits_of_the_store(whole):
    replay = tumbling().replay(57)
    for name, values in _by_column(replay.outputs).items():
        np.testing.assert_array_equal(values, whole[name][57], err_msg=name)
    np.testing.assert_array_equal(replay.signals.omega[-1], whole["omega"][57])


def test_summary(tmp_path, whole):
    run_study(tumbling(), tmp_path / "s")
    summary = summarise(open_study(tmp_path / "s"))
    settled = np.isfinite(whole["settling_time"])
    assert summary.cases == 100
    assert summary.settled == wilson(int(settled.sum()), 100)
    assert summary.outcomes == {"settled": settled.sum(), "unsettled": (~settled).sum()}
    expected = np.percentile(whole["settling_time"][settled], 90)
    np.testing.assert_allclose(summary.settling_time[90.0].value, expected)
    assert not np.any(settled[summary.worst])
    assert summary.cost_sensitivity[0].name == "omega[1]"
    assert summarise(open_study(tmp_path / "s"), 10).cases == 10


@pytest.mark.slow
def test_what_fails_is_kept_and_counted_and_changes_nothing_else(tmp_path):
    """Some spin beyond the limit of the state from the start; the rest is as if alone."""
    study = tumbling(omega=Discrete([0.01, 1e6], [3.0, 1.0]))
    run_study(study, tmp_path / "s")
    found = contents(tmp_path / "s")
    failed = found["code"] == int(Outcome.STATE_LIMIT)
    assert 20 < failed.sum() < 100
    assert found["status"].all()
    np.testing.assert_array_equal(failed, (found["drawn_omega"] > 1).any(axis=1))
    for name in ("omega", "effort", "peak_rate"):
        assert np.isnan(found[name][failed]).all()
    alone = _by_column(study.evaluate(np.flatnonzero(~failed)))
    same({name: found[name][~failed] for name in alone}, alone)
    summary = summarise(open_study(tmp_path / "s"))
    assert summary.outcomes["state_limit"] == failed.sum()
    assert sum(summary.outcomes.values()) == summary.cases == 100
    assert failed[summary.worst].all()


@pytest.mark.slow
@pytest.mark.parametrize("engine", [ScanEngine(batch_size=4), ReferenceEngine(batch_size=4)])
def test_an_impossible_body_is_coded(engine):
    """Moments that break the triangle inequality however often they are drawn."""
    flat = Uniform([-0.9, -0.9, 0.0], [-0.8, -0.8, 0.1])
    study = dataclasses.replace(tumbling(6, 3, inertia=flat), engine=engine)
    found = study.evaluate(np.arange(6))
    assert found.code.tolist() == [int(Outcome.IMPOSSIBLE_CASE)] * 6
    assert np.isnan(found.cost).all()
    assert np.isfinite(found.drawn["omega"]).all()


@pytest.fixture(scope="module")
def by_diffrax():
    return _by_column(adaptive_tumbling().evaluate(np.arange(40)))


def adaptive_tumbling(**options):
    """The same study under diffrax with adaptive steps, at the pace of each block's slowest."""
    study = tumbling(count=40, duration=10.0, **options)
    engine = ReferenceEngine(adaptive(1e-8, 1e-8), 8)
    return dataclasses.replace(study, engine=engine)


@pytest.mark.slow
def test_the_bits_of_diffrax_depend_on_the_case_alone(tmp_path, by_diffrax):
    """Order and companions, chunks that fill blocks in other ways, a resumed run, a replay."""
    order = np.random.default_rng(0).permutation(40)
    found = _by_column(adaptive_tumbling().evaluate(order))
    same(found, {name: values[order] for name, values in by_diffrax.items()})
    few = np.array([3, 17, 17, 39, 0])
    found = _by_column(adaptive_tumbling().evaluate(few))
    same(found, {name: values[few] for name, values in by_diffrax.items()})

    run_study(adaptive_tumbling(chunk=7), tmp_path / "s", until=StopRule(0.9, least=1))
    assert contents(tmp_path / "s")["status"].sum() == 7
    run_study(adaptive_tumbling(chunk=7), tmp_path / "s", executor=Threads(2))
    same(without_status(contents(tmp_path / "s")), by_diffrax)

    for name, value in _by_column(adaptive_tumbling().replay(23).outputs).items():
        np.testing.assert_array_equal(value, by_diffrax[name][23], err_msg=name)


@pytest.mark.slow
def test_the_place_in_a_block_changes_no_bit():
    """Every case once in every place, in a loop that decodes rates from error coordinates."""
    overrides = ["simulation.duration_s=2", "simulation.solver.step_s=0.1"]
    scenario = load("benchmark-three-axis", overrides)
    study = build_study(scenario, 16, seed=3, engine="scan", batch_size=16)
    expected = _by_column(study.evaluate(np.arange(16)))
    for turn in range(1, 16):
        order = np.roll(np.arange(16), turn)
        found = _by_column(study.evaluate(order))
        same(found, {name: values[order] for name, values in expected.items()})
