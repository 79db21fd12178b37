"""The verdict: the exact law, on cases that were not tuned on."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.report.tuning_document import tuning_document
from jaxsat.simulation.engine.progress import RunningCost
from jaxsat.synthesis.tuning.verdict import make_verdict


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

    def told(verdict):
        return tuning_document("a run", verdict.as_data(), receipt.as_data()).verdict.more

    assert told(verdict)[0].startswith("Gains are at their bounds: k1 at 3. ")
    dominated = "The cost is dominated by the singularity of (w, z): 87.6% of it"
    assert told(verdict)[1].startswith(dominated)
    assert "singularity" not in " ".join(told(dataclasses.replace(verdict, singular=0.3)))


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
