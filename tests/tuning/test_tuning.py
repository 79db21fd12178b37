"""Tuning from a scenario: derivatives, descent, checkpoints, receipt, verdict, baselines."""

import dataclasses
import io
import os
import shutil
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control import RateLaw
from jaxsat.engine import AbstractCaseFactory, CannotLower, Program, RunningCost
from jaxsat.engine.native.ir import NativeBug
from jaxsat.montecarlo.changes import controller_of
from jaxsat.results import OutputError
from jaxsat.scenario import build, dump, load
from jaxsat.scenario.tuning import build_plan, tuned_scenario
from jaxsat.tuning import advance, begin, compare, descend, make_receipt, make_verdict
from jaxsat.tuning.baselines import METHODS, run_baselines
from jaxsat.tuning.checkpoint import TuningFolder, plan_identity
from jaxsat.tuning.history import history_dataset
from jaxsat.tuning.summary import summary_page
from tuning.scenarios import RATE

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from corruption import corrupt


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenario") / "rate.toml"
    file.write_text(RATE, encoding="utf-8")
    return load(file)


@pytest.fixture(scope="module")
def plan(scenario):
    return build_plan(scenario, width=4)


@pytest.fixture(scope="module")
def final(plan):
    return descend(plan, begin(plan))


@pytest.fixture(scope="module")
def receipt(plan, final):
    return make_receipt(plan, final)


def points(plan):
    return plan.space.to_search(np.array([[0.5, 0.3], [1.2, 0.1], [0.2, 1.0]]))


def with_settings(plan, **changes):
    return dataclasses.replace(plan, settings=dataclasses.replace(plan.settings, **changes))


def same_bits(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


@pytest.mark.parametrize("error", [NativeBug("a rule", "what"), RuntimeError("x"), ValueError("x")])
def test_only_what_has_no_rule_leads_to_another_engine(scenario, monkeypatch, error):
    def failing(error):
        def fail(*_):
            raise error

        monkeypatch.setattr("jaxsat.scenario.tuning._native", fail)

    failing(CannotLower("No rule"))
    assert build_plan(scenario, width=4).remark == "not the native engine: No rule"
    with pytest.raises(ValueError, match="The native engine cannot run this: No rule"):
        build_plan(scenario, width=4, engine="native")
    failing(error)
    with pytest.raises(type(error)):
        build_plan(scenario, width=4)


@pytest.mark.slow
def test_many_points_at_once_are_the_same_as_one_by_one(plan):
    numbers = np.array([3, 0, 7])
    together = plan.smooth.differentiate(points(plan), numbers)
    assert together.derivatives.shape == (3, 3, 2)
    for i in range(3):
        alone = plan.smooth.differentiate(points(plan)[i : i + 1], numbers)
        same_bits(alone, jax.tree.map(lambda x, i=i: x[i : i + 1], together))
    threads = dataclasses.replace(plan.smooth, workers=2)
    same_bits(threads.differentiate(points(plan), numbers), together)


def test_derivatives_along_the_search_are_those_of_the_cost(plan):
    numbers, step = np.arange(4), 1e-5
    found = plan.smooth.differentiate(points(plan), numbers)
    for i in range(2):
        shift = step * np.eye(2)[i]
        costs = [
            plan.smooth.evaluate(points(plan) + sign * shift, numbers).cost for sign in (1, -1)
        ]
        expected = (costs[0] - costs[1]) / (2 * step)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found.derivatives[..., i], expected, atol=1e-6 * scale)


def test_differences_agree_with_automatic_differentiation(plan):
    numbers = np.arange(3)
    trials = dataclasses.replace(plan.smooth, gradient="differences", half_width=1e-4)
    found, expected = (t.differentiate(points(plan), numbers) for t in (trials, plan.smooth))
    scale = np.abs(expected.derivatives).max()
    np.testing.assert_allclose(found.derivatives, expected.derivatives, atol=1e-6 * scale)
    np.testing.assert_allclose(found.outputs.cost, expected.outputs.cost, rtol=1e-12)


def test_trajectories_are_counted(plan):
    trials = dataclasses.replace(plan.smooth, counter=type(plan.smooth.counter)())
    trials.evaluate(points(plan), np.arange(5))
    assert trials.counter.trajectories == 15
    trials.evaluate(points(plan), np.arange(5), intervals=4)  # of 8
    assert trials.counter.trajectories == 15 + 15 / 2
    trials.differentiate(points(plan), np.arange(5))  # with two gains
    assert trials.counter.trajectories == 15 + 15 / 2 + 15 * 3


@pytest.mark.slow
def test_the_loss_falls_and_the_best_iterate_is_kept(plan, final):
    losses = [check.best_loss for check in final.validations]
    assert losses[-1] < losses[0]
    assert losses == sorted(losses, reverse=True)
    every = np.stack([check.loss for check in final.validations])
    assert final.best_loss == np.nanmin(every)
    costs = plan.exact.evaluate(final.best_point[None], plan.settings.validation()).cost[0]
    assert plan.settings.objective.value(costs) == final.best_loss


def test_starts_are_tried_on_as_few_cases_as_are_asked_for(plan):
    few = begin(with_settings(plan, screening_cases=2))
    assert few.trajectories == 5 * 2 + 3 * 4  # five points screened, three starts validated
    assert begin(plan).trajectories == 5 * 4 + 3 * 4
    drawn = plan.space.to_search(plan.space.drawn(5, plan.settings.seed))
    costs = plan.smooth.evaluate(drawn, np.arange(2)).cost
    losses = [plan.settings.objective.value(row) for row in costs]
    np.testing.assert_array_equal(few.points[1:], drawn[np.argsort(losses)[:2]])


def test_the_worse_half_of_the_starts_is_given_up(final):
    assert final.alive.sum() == 2
    middle = next(check for check in final.validations if check.step == 2)
    assert not final.alive[np.argmax(middle.loss)]
    assert np.isnan(final.steps[-1].loss).sum() == 1


def test_a_run_broken_off_goes_on_to_the_same_bits(plan, final, tmp_path):
    identity = plan_identity(plan)
    with TuningFolder(tmp_path / "run", identity) as folder:
        state = folder.state(plan)
        for _ in range(3):
            state = advance(plan, state)
            folder.keep(state)
    with TuningFolder(tmp_path / "run", identity) as folder:
        resumed = descend(plan, folder.state(plan), keep=folder.keep)
    assert resumed.step == final.step
    for name in ("points", "alive", "best_point", "best_loss", "trajectories"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(final, name))
    same_bits(resumed.optimiser, final.optimiser)
    same_bits(resumed.steps, final.steps)
    same_bits(resumed.validations, final.validations)


def test_a_folder_holds_one_run(plan, tmp_path):
    with TuningFolder(tmp_path / "run", {"steps": 4}) as folder:
        folder.keep(begin(plan))
        with pytest.raises(OutputError, match="another process"):
            TuningFolder(tmp_path / "run", {"steps": 4})
    with pytest.raises(OutputError, match="another run \\(steps: 4 there, 5 here"):
        TuningFolder(tmp_path / "run", {"steps": 5})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(OutputError, match="did not write"):
        TuningFolder(tmp_path / "mine", {})
    (tmp_path / "run" / "checkpoint.npz").write_bytes(b"not a state")
    with pytest.raises(OutputError, match="was damaged, or changed, since jaxsat wrote it"):
        TuningFolder(tmp_path / "run", {"steps": 4})


class Flipped(RateLaw):
    """With a sign that is another."""

    def feedback(self, state, rate_error, memory):
        return -RateLaw.feedback(self, state, rate_error, memory)


@pytest.mark.parametrize("changed", ["smooth", "exact"])
def test_a_run_of_another_law_is_refused(scenario, tmp_path, changed):
    plan = build_plan(scenario, width=4, engine="scan")
    with TuningFolder(tmp_path / "run", plan_identity(plan)):
        pass
    trials = getattr(plan, changed)
    law = controller_of(trials.program.case_factory.loop)
    flipped = Flipped(**{field.name: getattr(law, field.name) for field in dataclasses.fields(law)})
    program = eqx.tree_at(
        lambda program: controller_of(program.case_factory.loop),
        trials.program,
        flipped,
        is_leaf=lambda x: x is law,
    )
    other = dataclasses.replace(plan, **{changed: dataclasses.replace(trials, program=program)})
    with pytest.raises(OutputError, match=r"another run \(the program differs, as after a change"):
        TuningFolder(tmp_path / "run", plan_identity(other), elsewhere=True)


def outcome(folder, plan, final):
    """What becomes of a run whose folder was damaged."""
    try:
        with TuningFolder(folder, {"steps": 4}) as opened:
            if opened.lost_state or not opened.is_whole("summary.md"):
                return "begun again"
            state = opened.state(plan)
            assert opened.read("summary.md") == b"a summary"
    except OutputError:
        return "told"
    assert state.step == final.step
    same_bits([state.points, state.best_point], [final.points, final.best_point])
    same_bits([state.optimiser, state.steps], [final.optimiser, final.steps])
    return "right"


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(2000), marks=pytest.mark.slow)])
def test_no_damage_of_a_run_is_silent_or_a_traceback(plan, final, tmp_path, seeds, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # what is tested needs no disk
    with TuningFolder(tmp_path / "run", {"steps": 4}) as folder:
        folder.keep(final)
        folder.write("tuned.toml", "tuned")
        folder.write("summary.md", "a summary")
    found = set()
    for seed in seeds:
        shutil.copytree(tmp_path / "run", tmp_path / "damaged")
        corrupt(tmp_path / "damaged", seed)
        found.add(outcome(tmp_path / "damaged", plan, final))
        shutil.rmtree(tmp_path / "damaged")
    assert found == {"right", "told", "begun again"}


@pytest.mark.parametrize(
    "change",
    [
        {"points": np.full((3, 2), np.nan)},
        {"points": np.zeros((3, 1))},
        {"points": np.zeros(3)},
        {"alive": np.zeros(3, bool)},
        {"alive": np.ones(3)},
        {"step": np.array(10**6)},
        {"step": np.array(-1)},
        {"step": np.array("first")},
        {"best_loss": np.array(np.nan)},
        {"best_point": np.array([np.inf, 0.0])},
        {"optimiser_0": np.zeros((7, 7))},
        {"step_loss": np.zeros((2, 3))},
        {"validation_loss": np.zeros((1, 1))},
        {"points": None},
        {"optimiser_1": None},
        {"about": None},
        {"about": np.array("{")},
        {"about": np.array("[]")},
    ],
)
def test_a_state_that_the_run_cannot_have_come_to_is_refused(plan, final, tmp_path, change):
    """Written as jaxsat writes, so that the hash is right."""
    with TuningFolder(tmp_path / "run", {"steps": 4}) as folder:
        folder.keep(final)
        with np.load(tmp_path / "run" / "checkpoint.npz") as stored:
            arrays = {**stored, **change}
        buffer = io.BytesIO()
        np.savez(buffer, **{name: value for name, value in arrays.items() if value is not None})
        folder.write("checkpoint.npz", buffer.getvalue())
    with (
        pytest.raises(OutputError, match="is no state of this tuning run"),
        TuningFolder(tmp_path / "run", {"steps": 4}) as folder,
    ):
        folder.state(plan)


def test_the_tuned_scenario_flies_with_the_tuned_gains(scenario, plan, final, tmp_path):
    (tmp_path / "tuned.toml").write_text(dump(tuned_scenario(scenario, plan, final.best_point)))
    again = load(tmp_path / "tuned.toml")
    values = plan.space.to_values(final.best_point)
    law = build(again).loop.controller
    np.testing.assert_allclose([law.k1, law.k2], values, rtol=1e-12)
    assert again.control.omega3_width_rad_s == scenario.control.omega3_width_rad_s
    assert again.tuning == scenario.tuning


def test_a_sound_gradient_has_a_clean_receipt(receipt):
    assert receipt.problems == []
    assert receipt.start.trusted
    assert receipt.end.error.max() < 1e-6
    assert 1e-3 < receipt.smoothing_bias < 0.1
    assert 1e-7 < receipt.step_sensitivity < 1e-2
    assert receipt.gradient_samples == 4 * (3 + 3 + 2 + 2)
    assert receipt.failed == receipt.masked == 0


class Blind(AbstractCaseFactory):
    """Copies that hide one gain from automatic differentiation, as a switch would."""

    inner: AbstractCaseFactory

    def __call__(self, case, gains=None):
        return self.inner(case, {**gains, "k2": jax.lax.stop_gradient(gains["k2"])})


@pytest.mark.slow
def test_a_wrong_gradient_is_told_at_the_top(plan, final, receipt, monkeypatch):
    program = plan.smooth.program
    copies = eqx.tree_at(lambda p: p.case_factory, program, program.case_factory)
    blind = dataclasses.replace(plan.smooth, program=copies)
    inner = type(plan.smooth)._program

    def hidden(trials, intervals):
        whole: Program = inner(trials, intervals)
        return eqx.tree_at(lambda p: p.case_factory.inner, whole, Blind(whole.case_factory.inner))

    monkeypatch.setattr(type(plan.smooth), "_program", hidden)
    comparison = compare(blind, final.best_point, np.arange(3))
    assert not comparison.trusted
    assert comparison.error[0] < 1e-6
    assert comparison.error[1] == pytest.approx(1.0)
    monkeypatch.undo()
    receipt = dataclasses.replace(receipt, end=comparison)
    assert receipt.problems == [
        "at the end the derivative by k2 is 100.0% off the best central difference"
    ]
    page = summary_page("a run", receipt, make_verdict(plan, final.best_point))
    assert page.splitlines()[2].startswith("**The gradient of this run is not trustworthy:**")


def test_the_verdict_is_about_the_exact_law_on_other_cases(plan, final):
    verdict = make_verdict(plan, final.best_point)
    np.testing.assert_allclose(verdict.gains_before, [0.5, 0.3])
    numbers = np.arange(8)
    both = plan.space.to_search(np.stack([verdict.gains_before, verdict.gains_after]))
    costs = plan.held_out.evaluate(both, numbers).cost
    np.testing.assert_allclose(verdict.after.columns["cost"], costs[1], rtol=1e-12)
    assert not np.isin(costs, plan.trained_on.evaluate(both, numbers).cost).any()
    expected = costs[0].mean() - costs[1].mean()
    np.testing.assert_allclose(verdict.better.value, expected)
    assert verdict.better.low < expected < verdict.better.high
    data = verdict.as_data()
    assert data["gains"]["k1"]["before"] == pytest.approx(0.5)
    assert data["after"]["cases"] == 8
    assert data["at_bounds"] == {}
    assert data["singular"] is None


def test_gains_at_bounds_and_a_singular_cost_are_told_at_the_top(plan, final, receipt):
    verdict = make_verdict(plan, final.best_point)
    verdict = dataclasses.replace(verdict, at_bounds={"k1": 3.0}, singular=0.876)
    page = summary_page("a run", receipt, verdict)
    top = page[: page.index("## Gains")]
    assert "**Gains are at their bounds:** k1 at 3. " in top
    assert "**The cost is dominated by the singularity of (w, z):** 87.6% of it" in top
    page = summary_page("a run", receipt, dataclasses.replace(verdict, singular=0.3))
    assert "singularity" not in page


@pytest.mark.slow
def test_the_part_of_a_singular_cost_is_known(plan):
    """Upside down |w|² is about 400, where the rotation costs at most 1."""
    held = plan.held_out
    cost = RunningCost(z=0.0, relative_rate=0.0, torque=0.0, limit=np.inf, attitude="wz")
    program = dataclasses.replace(held.program, cost=cost)
    program = eqx.tree_at(
        lambda p: p.case_factory.start.attitude.w, program, jnp.array([20.0, 0.0])
    )
    turned = dataclasses.replace(held, program=program)
    settings = dataclasses.replace(plan.settings, held_out_cases=2)
    plan = dataclasses.replace(plan, held_out=turned, settings=settings)
    verdict = make_verdict(plan, plan.space.to_search(np.array([3.0, 0.3])))
    assert 0.98 < verdict.singular < 1
    assert verdict.at_bounds == {"k1": 3.0}


@pytest.fixture(scope="module")
def others(plan, final):
    settings = with_settings(plan, baseline_trajectories=120, baseline_cases=3)
    return {entry.method: entry for entry in run_baselines(settings, final)}


def test_baselines_spend_no_more_than_their_budget(final, others):
    assert set(others) == {"gradient descent", *METHODS}
    assert others["gradient descent"].trajectories == final.trajectories
    for entry in list(others.values())[1:]:
        assert 0 < entry.trajectories <= 120
        assert entry.trace[-1, 0] == entry.trajectories
        assert np.all(np.diff(entry.trace[:, 0]) >= 0)
    assert others["BFGS"].judgement.loss < others["gradient descent"].trace[0, 1]


def test_baselines_keep_what_is_best_on_validation(plan, others):
    own = plan.space.to_search(plan.start[None])
    points = np.concatenate([own, [others[name].point for name in METHODS]])
    costs = plan.exact.evaluate(points, plan.settings.validation()).cost
    first, *losses = [plan.settings.objective.value(row) for row in costs]
    for name, loss in zip(METHODS, losses, strict=True):
        assert others[name].loss == others[name].trace[-1, 1] == loss <= first
        assert others[name].trace[0].tolist() == [plan.settings.validation_cases, first]
        assert np.all(np.diff(others[name].trace[:, 1]) <= 0)
    assert any(others[name].loss < first for name in METHODS)


def test_runs_end_at_the_target(plan, final, others):
    target = 0.5 * (final.validations[0].best_loss + final.best_loss)
    aimed = with_settings(plan, target=target, baseline_trajectories=120, baseline_cases=3)
    state = descend(aimed, begin(aimed))
    assert state.step < final.step
    assert state.best_loss <= target < state.validations[-2].best_loss
    assert descend(aimed, state).step == state.step
    for entry in run_baselines(aimed, state):
        assert entry.reached == (entry.loss <= target)
        if entry.reached and entry.method in METHODS:
            assert np.all(entry.trace[:-2, 1] > target)
            assert entry.trajectories <= others[entry.method].trajectories


def test_the_history_has_gains_and_losses(scenario, plan, final):
    dataset = history_dataset(plan, final, scenario.title, dump(scenario))
    assert dataset["gain"].dims == ("step", "start", "parameter")
    assert dataset.sizes["step"] == 4
    np.testing.assert_allclose(dataset["gain"][0, 0], [0.5, 0.3])
    best = dataset["best_gain"][-1].values
    np.testing.assert_allclose(best, plan.space.to_values(final.best_point))
    assert dataset["loss"].attrs["units"] == "1"
