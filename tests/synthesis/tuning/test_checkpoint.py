"""Folders of tuning runs: resumed to the same bits, or refused."""

import dataclasses
import functools
import os
import shutil

import equinox as eqx
import numpy as np
import pytest

from corruption import corrupt
from jaxsat.control.rate import RateLaw
from jaxsat.store.files import OutputError
from jaxsat.studies.changes import controller_of
from jaxsat.synthesis import execution
from jaxsat.synthesis.execution import resumable_folder
from jaxsat.synthesis.tuning.build import build_plan
from jaxsat.synthesis.tuning.checkpoint import (
    plan_identity,
    stored_state,
    tuning_folder,
    write_state,
)
from jaxsat.synthesis.tuning.descent import descend, descent_step, initial_state
from synthesis.tuning.plans import same_bits


def folder_of(path, identity, elsewhere=False):
    return resumable_folder(path, "tuning", identity, "run", elsewhere)


@pytest.mark.slow
def test_a_run_broken_off_goes_on_to_the_same_bits(plan, final, tmp_path):
    with tuning_folder(tmp_path / "run", plan) as folder:
        assert stored_state(folder, plan) is None
        state = initial_state(plan)
        for _ in range(3):
            state = descent_step(plan, state)
            write_state(folder, state)
    with tuning_folder(tmp_path / "run", plan) as folder:
        keep = functools.partial(write_state, folder)
        resumed = descend(plan, stored_state(folder, plan), keep=keep)
    assert resumed.step == final.step
    for name in ("points", "alive", "best_point", "best_loss", "trajectories"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(final, name))
    same_bits(resumed.optimiser, final.optimiser)
    same_bits(resumed.steps, final.steps)
    same_bits(resumed.validations, final.validations)


def test_a_folder_holds_one_run(plan, tmp_path):
    with folder_of(tmp_path / "run", {"steps": 4}) as folder:
        write_state(folder, initial_state(plan))
        with pytest.raises(OutputError, match="another process"):
            folder_of(tmp_path / "run", {"steps": 4})
    with pytest.raises(OutputError, match="another run \\(steps: 4 there, 5 here"):
        folder_of(tmp_path / "run", {"steps": 5})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(OutputError, match="did not write"):
        folder_of(tmp_path / "mine", {})
    (tmp_path / "run" / "checkpoint.npz").write_bytes(b"not a state")
    with pytest.raises(OutputError, match="was damaged, or changed, since jaxsat wrote it"):
        folder_of(tmp_path / "run", {"steps": 4})


def test_a_run_begun_on_another_machine_goes_on_only_if_allowed(tmp_path, monkeypatch):
    monkeypatch.setattr(execution, "machine", lambda: {"processor": "another"})
    with folder_of(tmp_path / "run", {"steps": 4}):
        pass
    monkeypatch.undo()
    with pytest.raises(OutputError, match=r"begun under other conditions .*processor") as caught:
        folder_of(tmp_path / "run", {"steps": 4})
    assert caught.value.elsewhere
    with folder_of(tmp_path / "run", {"steps": 4}, elsewhere=True) as folder:
        assert folder.about["machine"] == {"processor": "another"}


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
    with folder_of(tmp_path / "run", identity):
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
        folder_of(tmp_path / "run", plan_identity(other), elsewhere=True)


def outcome(folder, plan, final):
    """What becomes of a run whose folder was damaged."""
    try:
        with folder_of(folder, {"steps": 4}) as opened:
            state = stored_state(opened, plan)
            if state is None or not opened.is_complete("summary.md"):
                return "begun again"
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
    with folder_of(tmp_path / "run", {"steps": 4}) as folder:
        write_state(folder, final)
        folder.write("tuned.toml", "tuned")
        folder.write("summary.md", "a summary")
    found = set()
    for seed in seeds:
        shutil.copytree(tmp_path / "run", tmp_path / "damaged")
        corrupt(tmp_path / "damaged", seed)
        found.add(outcome(tmp_path / "damaged", plan, final))
        shutil.rmtree(tmp_path / "damaged")
    assert found == {"right", "told", "begun again"}
