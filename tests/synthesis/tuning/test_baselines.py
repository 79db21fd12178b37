"""Other optimisers with the same budget, and runs with a target."""

import numpy as np
import pytest

from jaxsat.synthesis.tuning.baselines import METHODS, run_baselines
from jaxsat.synthesis.tuning.descent import descend, initial_state
from synthesis.tuning.plans import with_settings


@pytest.fixture(scope="module")
def others(plan, final):
    settings = with_settings(plan, baseline_trajectories=120, baseline_cases=3)
    return {entry.method: entry for entry in run_baselines(settings, final)}


@pytest.mark.slow
def test_baselines_spend_no_more_than_their_budget(final, others):
    assert set(others) == {"gradient descent", *METHODS}
    assert others["gradient descent"].trajectories == final.trajectories
    for entry in list(others.values())[1:]:
        assert 0 < entry.trajectories <= 120
        assert entry.trace[-1, 0] == entry.trajectories
        assert np.all(np.diff(entry.trace[:, 0]) >= 0)
    assert others["BFGS"].evaluation.loss < others["gradient descent"].trace[0, 1]


@pytest.mark.slow
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


@pytest.mark.slow
def test_runs_end_at_the_target(plan, final, others):
    target = 0.5 * (final.validations[0].best_loss + final.best_loss)
    aimed = with_settings(plan, target_loss=target, baseline_trajectories=120, baseline_cases=3)
    state = descend(aimed, initial_state(aimed))
    assert state.step < final.step
    assert state.best_loss <= target < state.validations[-2].best_loss
    assert descend(aimed, state).step == state.step
    for entry in run_baselines(aimed, state):
        assert entry.reached == (entry.loss <= target)
        if entry.reached and entry.method in METHODS:
            assert np.all(entry.trace[:-2, 1] > target)
            assert entry.trajectories <= others[entry.method].trajectories
