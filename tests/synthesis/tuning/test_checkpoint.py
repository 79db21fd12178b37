"""Folders of tuning runs: resumed to the same bits, or refused."""

import dataclasses
import io
import os
import shutil

import equinox as eqx
import numpy as np
import pytest

from corruption import corrupt
from jaxsat.control.rate import RateLaw
from jaxsat.store.files import OutputError
from jaxsat.studies.changes import controller_of
from jaxsat.synthesis.tuning.build import build_plan
from jaxsat.synthesis.tuning.checkpoint import TuningFolder, plan_identity
from jaxsat.synthesis.tuning.descent import descend, descent_step, initial_state
from synthesis.tuning.plans import same_bits


@pytest.mark.slow
def test_a_run_broken_off_goes_on_to_the_same_bits(plan, final, tmp_path):
    identity = plan_identity(plan)
    with TuningFolder(tmp_path / "run", identity) as folder:
        state = folder.state(plan)
        for _ in range(3):
            state = descent_step(plan, state)
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
        folder.keep(initial_state(plan))
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


@pytest.fixture(scope="module")
def by_scan(scenario):
    plan = build_plan(scenario, batch_size=4, engine="scan")
    return plan, plan_identity(plan)


@pytest.mark.slow
@pytest.mark.parametrize("changed", ["smooth", "exact"])
def test_a_run_of_another_law_is_refused(by_scan, tmp_path, changed):
    plan, identity = by_scan
    with TuningFolder(tmp_path / "run", identity):
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
            if opened.lost_state or not opened.files.is_complete("summary.md"):
                return "begun again"
            state = opened.state(plan)
            assert opened.files.read("summary.md") == b"a summary"
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
        folder.files.write("tuned.toml", "tuned")
        folder.files.write("summary.md", "a summary")
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
        folder.files.write("checkpoint.npz", buffer.getvalue())
    with (
        pytest.raises(OutputError, match="is no state of this tuning run"),
        TuningFolder(tmp_path / "run", {"steps": 4}) as folder,
    ):
        folder.state(plan)
