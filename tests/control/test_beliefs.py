"""What the settling laws believe of d3 and of the body: from the scenario, not from the paper."""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from control.cases import body, form, paper_fit, ripple_filter_of
from jaxsat.control.estimators import MIN_COUPLING, MIN_SHARE, ThirdAxisEstimator
from jaxsat.control.presets import ripple_filter, three_slew_settling
from jaxsat.core.declaration.settling import equivalent_limit
from jaxsat.scenario import ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build_loop
from jaxsat.scenario.build.study import build_study
from jaxsat.studies.changes import controller_of, follow_frequency

INERTIA = (449.5, 264.6, 312.5)


def frequency(third):
    return f"disturbance.frequency_rad_s=[0.7, 0.8, {third}]"


def settled(count, *overrides, level="nominal", law="oscillatory"):
    scenario = load(f"acceptance-{level}", [f"control.law={law}", *overrides])
    study = build_study(scenario, count, seed=5)
    return study.evaluate(np.arange(count)).settling_time


@pytest.mark.slow
@pytest.mark.parametrize("third", [0.03, 0.3])
def test_a_ripple_of_another_frequency_settles(third):
    assert np.all(np.isfinite(settled(4, frequency(third))))


@pytest.mark.slow
def test_a_wrong_belief_about_the_frequency_is_possible_and_costs_the_settling():
    wrong = settled(4, frequency(0.01), "control.ripple_frequency_rad_s=0.1")
    assert not np.any(np.isfinite(wrong))


@pytest.mark.slow
@pytest.mark.parametrize("law", ["oscillatory", "three-slew"])
@pytest.mark.parametrize(("level", "third"), [("hard", 0.03), ("hard", 0.3)])
def test_many_cases_settle_at_other_frequencies(law, level, third):
    times = settled(100, frequency(third), level=level, law=law)
    assert np.all(np.isfinite(times))
    assert np.median(times) < 250


@pytest.mark.slow
@pytest.mark.parametrize(("law", "least"), [("three-slew", 100), ("oscillatory", 75)])
def test_a_ripple_of_two_thirds_of_the_tolerance_leaves_little_room(law, least):
    """81 of 100 with the oscillatory law, whose small oscillation is slow to take the rest away."""
    times = settled(100, frequency(0.01), law=law)
    assert np.isfinite(times).sum() >= least
    assert np.median(times) < 250


@pytest.mark.parametrize("law", ["oscillatory", "three-slew"])
def test_of_the_papers_spacecraft_the_belief_is_the_papers_to_rounding(law):
    controller = controller_of(build_loop(load("acceptance-hard", [f"control.law={law}"])))
    for found, expected in zip(
        jax.tree.leaves(controller.estimator.observer),
        jax.tree.leaves(ripple_filter_of(0.1)),
        strict=True,
    ):
        assert float(found) == pytest.approx(float(expected), rel=1e-9)
    assert equivalent_limit(INERTIA, 5.0) == 5.0
    tuned = {"oscillatory": 0.193, "three-slew": 3.124 / 8.305100301}[law]
    assert float(controller.fine.oscillator.frequency) == pytest.approx(tuned, rel=1e-8)


def test_the_expected_ripple_is_that_of_the_disturbance_but_never_less_than_the_papers():
    slow = ripple_filter(form(), 5.0, 0.001, 0.01)
    assert (slow.frequency, float(slow.amplitude)) == (0.01, pytest.approx(3e-4))
    assert float(ripple_filter(form(), 5.0, 0.01, 0.1).amplitude) == pytest.approx(3e-4)
    for none in ((0.0, 0.3), (0.001, 30.0)):
        assert float(ripple_filter(form(), 5.0, *none).amplitude) == pytest.approx(3e-5)
    assert float(ripple_filter(form(), 5.0, 0.001, 0.0).frequency) == pytest.approx(0.1)
    given = load("acceptance-nominal", ["control.ripple_amplitude_N_m=0.1"])
    found = controller_of(build_loop(given)).estimator.observer
    assert float(found.amplitude) == pytest.approx(3e-3)


@pytest.mark.slow
def test_a_larger_body_under_larger_torques_flies_alike():
    """Ten times the inertia, the torques and the disturbance: the same motion."""
    larger = (
        "spacecraft.inertia_kg_m2=[4495, 2646, 3125]",
        "spacecraft.torque_limit_N_m=50",
        "disturbance.amplitude_N_m=[0.1, 0.2, 0.01]",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScenarioWarning)  # 50 N m count as 5 here
        found = settled(4, *larger)
    np.testing.assert_allclose(found, settled(4), atol=1e-6)
    with pytest.warns(ScenarioWarning, match="the orbit rate times τ"):
        load("acceptance-nominal", [*larger[:1], "spacecraft.torque_limit_N_m=5"])


def test_a_law_that_knows_the_frequencies_knows_the_third():
    loop = build_loop(load("acceptance-nominal", [frequency(0.07)]))
    believed = controller_of(loop).estimator.observer.frequency
    loop = build_loop(
        load("acceptance-nominal", [frequency(0.07), "control.ripple_frequency_rad_s=0.1"])
    )
    assert controller_of(loop).estimator.observer.frequency == 0.1
    assert controller_of(follow_frequency(loop)).estimator.observer.frequency == believed


@pytest.mark.parametrize(("j1", "error"), [(449.5, -0.5), (284.6, -0.06), (284.6, 0.02)])
def test_a_small_coupling_of_the_model_is_believed(j1, error):
    """The least that is believed was that of the paper's body; another body may have less."""
    model = form(np.array([j1, 264.6, 312.5]))
    c = (j1 - 264.6) / 312.5
    estimator = ThirdAxisEstimator(model, None, paper_fit())
    start = jnp.zeros(3)
    memory = estimator.init(start)
    memory = memory._replace(fit=memory.fit._replace(estimate=jnp.zeros(8).at[2].set(error)))
    memory = memory._replace(started=jnp.array(True))
    third, _ = eqx.filter_jit(estimator.update)(start, memory, jnp.array(0.1))
    expected = max(abs(c + error), min(MIN_COUPLING, MIN_SHARE * c))
    assert float(third.coupling) == pytest.approx(expected)


def test_without_a_filter_of_ones_own_the_papers_ripple_is_expected():
    observer = three_slew_settling(body(), 5.0).estimator.observer
    assert float(observer.frequency) == pytest.approx(0.1)
    assert float(observer.amplitude) == pytest.approx(3e-5)
