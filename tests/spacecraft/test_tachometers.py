"""Noise on the momenta of wheels that a sampled law is told."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.sensors import Tachometers
from jaxsat.spacecraft.wheels import WheelMomenta, wheel_momentum

CHANGES = ["wheel=[{axis=[1,0,0],torque_limit_N_m=0.4,tachometer_noise_N_m_s=0.1},"
           "{axis=[0,1,0],torque_limit_N_m=0.4},{axis=[0,0,1],torque_limit_N_m=0.4}]",
           "failure=[{of='wheel 1',at_s=5,kind='dead'}]"]  # fmt: skip
OF_THREE = ["dispersion.failed_wheel={distribution='uniform', low=-0.5, high=2.4}"]


def test_noise_is_white_normal_and_that_of_each_wheel():
    tachometers = Tachometers(np.array([0.1, 0.0, 2.0]), key=(3, 4))
    momentum = jnp.array([1.0, 2.0, 3.0])
    measured = jax.jit(jax.vmap(lambda k: tachometers(k, (None, WheelMomenta(momentum)))))
    states = measured(jnp.arange(4000))
    told = np.asarray(states[1].momentum)
    off = told - np.asarray(momentum)
    np.testing.assert_array_equal(off[:, 1], 0.0)
    np.testing.assert_allclose(off.std(axis=0)[[0, 2]], [0.1, 2.0], rtol=0.04)
    assert np.abs(off.mean(axis=0))[[0, 2]] @ [10, 0.5] < 0.1
    assert abs(np.corrcoef(off[:, 0], off[:, 2])[0, 1]) < 0.05
    assert abs(np.corrcoef(off[1:, 0], off[:-1, 0])[0, 1]) < 0.05


def test_negative_noise_is_refused():
    with pytest.raises(ValueError, match="noise"):
        Tachometers(np.array([-1.0]))


def test_momenta_are_invalid_while_any_tachometer_has_an_outage():
    tachometers = Tachometers(np.zeros(3), outage_start=[3.0, np.inf, 5.0], outage=[1.0, 0.0, 2.0])
    valid = [bool(tachometers.is_valid(jnp.array(k), jnp.array(0.5))) for k in range(20)]
    invalid = [6, 7, *range(10, 14)]  # from 3 s to 4 s and from 5 s to 7 s, ends excluded
    assert [k for k in range(20) if not valid[k]] == invalid
    assert Tachometers(np.zeros(3)).is_valid(jnp.array(7), jnp.array(0.5)) is None
    with pytest.raises(ValueError, match="together"):
        Tachometers(np.zeros(3), outage=np.ones(3))
    with pytest.raises(ValueError, match="outage"):
        Tachometers(np.zeros(3), outage_start=np.ones(3), outage=-np.ones(3))


def test_an_outage_of_a_tachometer_has_begin_and_length_and_needs_a_sampled_law():
    outage = "tachometer_outage_start_s=5,tachometer_outage_s=2"
    with_outage = [CHANGES[0].replace("tachometer_noise_N_m_s=0.1", outage), CHANGES[1]]
    loop = build(load("wheels-fail", with_outage)).loop
    assert isinstance(loop, SampledLoop)
    assert loop.guard is not None
    without_end = [with_outage[0].replace(",tachometer_outage_s=2", ""), CHANGES[1]]
    with pytest.raises(ScenarioError, match=r"tachometer_outage_s.*must be given with"):
        load("wheels-fail", without_end)
    assert loop.tachometers.outage_every is None
    again = [with_outage[0].replace("age_s=2", "age_s=2,tachometer_outage_every_s=5"), CHANGES[1]]
    every = build(load("wheels-fail", again)).loop.tachometers.outage_every
    assert sorted(np.asarray(every)) == [5.0, np.inf, np.inf]
    short = [again[0].replace("every_s=5", "every_s=2"), CHANGES[1]]
    with pytest.raises(ScenarioError, match=r"tachometer_outage_every_s.*above tach.* got 2"):
        load("wheels-fail", short)
    with pytest.raises(ScenarioError, match=r"tachometer_outage_start_s.*not sampled"):
        load("two-wheel-telescope", with_outage[:1])
    late = [with_outage[0].replace("start_s=5", "start_s=1e5"), CHANGES[1]]
    with pytest.warns(match=r"wheel.*\.tachometer_outage_start_s.*never strikes"):
        load("wheels-fail", late)


@pytest.mark.parametrize("name", ["wheels-fail", "failures-telescope"])
def test_the_law_is_told_noisy_momenta_behind_either_kind_of_sensors(name):
    changes = [*CHANGES, *(OF_THREE if name == "failures-telescope" else [])]
    run = build(load(name, changes))

    @jax.jit
    def momenta(number):
        return wheel_momentum(run.loop.law_input(number, run.loop.start(run.start)).state)

    told = momenta(jnp.array(7))
    np.testing.assert_array_equal(told[1:], [0.0, 0.0])
    assert 0 < abs(float(told[0])) < 0.6
    exact = build(load(name, [CHANGES[0].replace("0.1}", "0.0}"), *changes[1:]])).loop
    assert exact.tachometers is None


@pytest.mark.slow
def test_every_case_of_a_study_has_its_own_noise():
    scenario = load("failures-telescope", ["simulation.duration_s=60"])
    study = build_study(scenario, 2, engine="scan")
    cases = study.cases(np.arange(2))
    loops = [study.case_factory(jax.tree.map(lambda x, k=k: x[k], cases)).loop for k in range(2)]
    first, second = (np.asarray(loop.tachometers.key) for loop in loops)
    assert np.any(first != second)
    np.testing.assert_array_equal(first, loops[0].sensors.key)


def test_noise_needs_a_sampled_law():
    with pytest.raises(ScenarioError) as caught:
        load("two-wheel-telescope", CHANGES[:1])
    assert "tachometer_noise_N_m_s" in str(caught.value)
