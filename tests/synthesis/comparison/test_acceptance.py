"""The acceptance set: the same cases for all laws, and the dispersions that it says."""

import jax
import numpy as np
import pytest

from jaxsat.control.switching import SwitchingLaw, SwitchingMode
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.synthesis.comparison.acceptance import (
    LAWS,
    LEVELS,
    PERIOD,
    ComparisonSetting,
    Start,
    comparison_scenario,
    comparison_study,
    horizon,
)


def drawn(setting, start, numbers):
    study = comparison_study(setting, start, 100, 7, engine="scan")
    cases = study.cases(np.asarray(numbers))
    return jax.vmap(lambda case: study.case_factory(case).drawn)(cases)


def test_horizons():
    assert [horizon(limit) for limit in (1.0, 5.0, 20.0)] == [2000.0, 1200.0, 1000.0]
    assert 1200 < horizon(2.0) < 2000
    assert horizon(0.25) == 4000.0
    assert horizon(100.0) == 1000.0


def test_the_law_that_plans_goes_by_its_name():
    control = comparison_scenario(ComparisonSetting("hard", 5.0, "planned")).control
    assert (control.law, control.model_dump()["period_s"]) == ("planned", PERIOD)
    assert "planned" not in LAWS  # "all" does not mean it


@pytest.mark.slow
def test_cases_are_the_same_for_every_law():
    numbers = [0, 3, 99]
    first = drawn(ComparisonSetting("hard", 5.0, "three-slew"), Start.RANDOM, numbers)
    for law, limit in (("oscillatory", 5.0), ("rate", 20.0)):
        other = drawn(ComparisonSetting("hard", limit, law), Start.RANDOM, numbers)
        jax.tree.map(np.testing.assert_array_equal, other, first)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("level", "widths"),
    [
        ("mc", {"inertia": 0.05, "torque_gain": 0.05, "misalignment": np.radians(0.2)}),
        ("hard", {"inertia": 0.1, "disturbance_frequency": 0.2, "misalignment": np.radians(1)}),
    ],
)
def test_dispersions_fill_their_bounds(level, widths):
    found = drawn(ComparisonSetting(level, 5.0, "rate"), Start.RANDOM, np.arange(100))
    widths = widths | {"omega": 0.1, "disturbance_phase": np.pi}
    for name, half in widths.items():
        size = np.abs(np.asarray(found[name]))
        assert size.max() <= half
        assert size.max() > 0.95 * half
    assert ("disturbance_frequency" in found) == (level == "hard")


def test_nothing_but_the_start_is_drawn_in_the_nominal_level():
    assert set(drawn(ComparisonSetting("nominal", 5.0, "rate"), Start.RANDOM, [0])) == {
        "attitude",
        "omega",
    }
    assert drawn(ComparisonSetting("nominal", 5.0, "rate"), Start.PAPER, [0]) == {}


@pytest.mark.slow
def test_the_papers_start_is_the_papers():
    study = comparison_study(
        ComparisonSetting("hard", 5.0, "rate"), Start.PAPER, 1, 7, engine="scan"
    )
    case = jax.tree.map(lambda x: x[0], study.cases(np.array([0])))
    start: PlantState = study.case_factory(case).start
    wz = start.attitude.as_wz()
    np.testing.assert_allclose([*wz.w, wz.z], [-1.0, 1.0, 1.27], atol=1e-12)
    np.testing.assert_array_equal(start.omega, [0.1, -0.11, 0.0])


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("law", LAWS)
def test_every_law_has_a_scenario_of_its_own(level, law):
    scenario = comparison_scenario(ComparisonSetting(level, 20.0, law))
    assert scenario.spacecraft.torque_limit_N_m == 20
    assert scenario.simulation.duration_s == 1000
    assert law in scenario.title


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "mode", "source"),
    [
        ("three-axis", SwitchingMode.THREE_AXIS_LAW, "free-third-rate"),
        ("rate", SwitchingMode.RATE_LAW, "paper-rate"),
    ],
)
def test_the_papers_laws_alone_never_switch(law, mode, source):
    """The torque is that of the printed law, but for dω_d/dt, which the first sample lacks."""
    run = build(comparison_scenario(ComparisonSetting("nominal", 5.0, law)))
    controller = run.loop.controller
    assert isinstance(controller, SwitchingLaw)
    memory = controller.init(run.start)
    printed = build(load(source)).loop
    printed = printed.law if hasattr(printed, "law") else printed.controller
    for omega3 in (1e-9, 0.3):
        omega = run.start.omega.at[2].set(omega3)
        state = PlantState(run.start.attitude, omega)
        t = np.zeros(()) + 0.0
        command, after = controller.step(jax.numpy.asarray(t), state, memory)
        assert int(controller.mode(after)) == mode
        held = jax.tree.map(lambda x: x, printed.init(state))
        zero = jax.numpy.zeros(2)
        gains = {"k1", "k2"} if law == "rate" else {"k3", "k4", "mu", "a"}
        own = controller.rate_law if law == "rate" else controller.three_axis_law
        for gain in gains:
            np.testing.assert_array_equal(getattr(own, gain), getattr(printed, gain))
        expected = own.torque(jax.numpy.asarray(t), state, held, zero)
        np.testing.assert_allclose(command, expected, rtol=1e-12)


@pytest.mark.parametrize("setting", [("soft", 5.0, "rate"), ("hard", 5.0, "coast")])
def test_unknown_levels_and_laws_are_told(setting):
    with pytest.raises(ValueError, match="must be one of"):
        comparison_scenario(ComparisonSetting(*setting))
