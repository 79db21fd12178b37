"""From a scenario to a plan, and from a result back to a scenario."""

import numpy as np
import pytest

from jaxsat.engine import CannotLower
from jaxsat.engine.native.ir import NativeBug
from jaxsat.scenario import build, dump, load
from jaxsat.scenario.tuning import build_plan, tuned_scenario


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


def test_the_tuned_scenario_flies_with_the_tuned_gains(scenario, plan, final, tmp_path):
    (tmp_path / "tuned.toml").write_text(dump(tuned_scenario(scenario, plan, final.best_point)))
    again = load(tmp_path / "tuned.toml")
    values = plan.space.to_values(final.best_point)
    law = build(again).loop.controller
    np.testing.assert_allclose([law.k1, law.k2], values, rtol=1e-12)
    assert again.control.omega3_width_rad_s == scenario.control.omega3_width_rad_s
    assert again.tuning == scenario.tuning
