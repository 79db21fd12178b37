"""The receipt: whether the gradient is sound, and that it is told where it is not."""

import dataclasses

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxsat.report.tuning_document import tuning_document
from jaxsat.simulation.engine.program import AbstractCaseFactory, Program
from jaxsat.synthesis.tuning.receipt import check_gradients
from jaxsat.synthesis.tuning.verdict import make_verdict


@pytest.mark.slow
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
    comparison = check_gradients(blind, final.best_point, np.arange(3))
    assert not comparison.trusted
    assert comparison.error[0] < 1e-6
    assert comparison.error[1] == pytest.approx(1.0)
    monkeypatch.undo()
    receipt = dataclasses.replace(receipt, end=comparison)
    assert receipt.problems == [
        "at the end the derivative with respect to k2 differs by 100.0% from the best central "
        "difference"
    ]
    verdict = make_verdict(plan, final.best_point)
    told = tuning_document("a run", verdict.as_data(), receipt.as_data()).verdict
    assert not told.good
    assert told.more[0].startswith("The gradient of this run is not trustworthy: at the end")
