"""Descent: starts, what is given up, and what is kept."""

import numpy as np
import pytest

from jaxsat.synthesis.tuning.descent import initial_state
from synthesis.tuning.plans import with_settings


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
    few = initial_state(with_settings(plan, screening_cases=2))
    assert few.trajectories == 5 * 2 + 3 * 4  # five points screened, three starts validated
    assert initial_state(plan).trajectories == 5 * 4 + 3 * 4
    drawn = plan.space.to_search(plan.space.drawn(5, plan.settings.seed))
    costs = plan.smooth.evaluate(drawn, np.arange(2)).cost
    losses = [plan.settings.objective.value(row) for row in costs]
    np.testing.assert_array_equal(few.points[1:], drawn[np.argsort(losses)[:2]])


def test_the_worse_half_of_the_starts_is_given_up(final):
    assert final.alive.sum() == 2
    middle = next(check for check in final.validations if check.step == 2)
    assert not final.alive[np.argmax(middle.loss)]
    assert np.isnan(final.steps[-1].loss).sum() == 1
