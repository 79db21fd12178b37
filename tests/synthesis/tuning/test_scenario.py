"""From a scenario to a plan, and from a result back to a scenario."""

import numpy as np
import pytest

from jaxsat.compiler import CannotLower
from jaxsat.compiler.ir import NativeBug
from jaxsat.scenario import dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.synthesis.execution import Listener
from jaxsat.synthesis.tuning.build import build_plan, tuned_scenario
from jaxsat.synthesis.tuning.run import tune
from synthesis.tuning.plans import same_bits


@pytest.mark.parametrize("error", [NativeBug("a rule", "what"), RuntimeError("x"), ValueError("x")])
def test_only_what_has_no_rule_leads_to_another_engine(scenario, monkeypatch, error):
    def failing(error):
        def fail(*_):
            raise error

        monkeypatch.setattr("jaxsat.synthesis.tuning.build._native", fail)

    failing(CannotLower("No rule"))
    assert build_plan(scenario, batch_size=4).remark == "not the native engine: No rule"
    with pytest.raises(ValueError, match="The native engine cannot run this: No rule"):
        build_plan(scenario, batch_size=4, engine="native")
    failing(error)
    with pytest.raises(type(error)):
        build_plan(scenario, batch_size=4)


def test_the_tuned_scenario_flies_with_the_tuned_gains(scenario, plan, final, tmp_path):
    (tmp_path / "tuned.toml").write_text(dump(tuned_scenario(scenario, plan, final.best_point)))
    again = load(tmp_path / "tuned.toml")
    values = plan.space.to_values(final.best_point)
    law = build(again).loop.controller
    np.testing.assert_allclose([law.k1, law.k2], values, rtol=1e-12)
    assert again.control.omega3_width_rad_s == scenario.control.omega3_width_rad_s
    assert again.tuning == scenario.tuning


def test_one_call_tunes_a_scenario(scenario, plan, final, receipt, monkeypatch):
    monkeypatch.setattr("jaxsat.synthesis.tuning.run.build_plan", lambda *_, **__: plan)
    told = []
    listener = Listener(progress=lambda what, progress: told.append(progress))
    result = tune(scenario, listener=listener)
    same_bits(result.state.points, final.points)
    assert [progress.step for progress in told if progress] == list(
        range(1, plan.settings.steps + 1)
    )
    assert result.receipt.as_data() == receipt.as_data()
    assert result.scenario == tuned_scenario(scenario, plan, final.best_point)
    assert result.gains["k1"] == pytest.approx(result.scenario.control.k1)
    assert result.history.sizes["step"] == plan.settings.steps
    assert result.summary.startswith(f"# Tuning: {scenario.title}\n")
    assert "## Gains" in result.summary
