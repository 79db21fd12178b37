"""Thrusters that had failed before the start, under the law that diagnoses its actuators."""

from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.compiling import by_machine_code
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.tolerant_actuators import TolerantMode
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.dynamics import PlantState

DEAD = 5


def laws():
    """Of a spacecraft whose last thruster had failed before the start, and of the whole one."""
    scenario = load("thruster-dies", ["failure=[]"])
    tables = [
        one.model_copy(update={"failed": place == DEAD})
        for place, one in enumerate(scenario.thruster)
    ]
    damaged = scenario.model_copy(update={"thruster": tuple(tables)})
    return build(damaged).loop.controller, build(scenario).loop.controller


def isolated(memory):
    """The memory after the last thruster was isolated as dead."""

    def at(path, value):
        return eqx.tree_at(path, memory, path(memory).at[DEAD].set(value))

    memory = at(lambda all: all.actuators[0].diagnosis.kind, int(DiagnosedKind.DEAD))
    memory = at(lambda all: all.actuators[0].diagnosis.condition.failed, True)
    return at(lambda all: all.actuators[0].diagnosis.condition.part, 0.0)


@pytest.mark.slow
def test_the_law_flies_as_if_it_had_isolated_them_at_the_start():
    """Duties and modes of the first seconds from a tumble, with the rates that they cause: equal at
    first, then nearly, as the fit of leaks has one more thruster in the whole spacecraft."""
    known, whole = laws()
    both = [(known, known.init), (whole, lambda start: isolated(whole.init(start)))]
    flights = []
    for law, init in both:
        step, torque = by_machine_code(law.step), law.actuators[0].reconfiguration.torque
        inverse = law.healthy.model.spacecraft.inverse_inertia
        state = PlantState(Quaternion(jnp.array([0.8, 0.36, -0.48, 0.0])), jnp.full(3, 0.01))
        memory, told = init(state), []
        for sample in range(60):
            duty, memory = step(law.period * jnp.asarray(float(sample)), state, memory)
            rate = state.omega + law.period * (inverse @ (torque @ duty))
            state = PlantState(state.attitude, rate)
            told.append([*np.asarray(duty)[:DEAD], float(law.mode(memory))])
        flights.append(np.array(told))
    np.testing.assert_allclose(*(one[:40] for one in flights), atol=1e-9)
    np.testing.assert_allclose(*flights, atol=5e-3)
    assert np.all(flights[0][:40, -1] == TolerantMode.STOPPING)
    assert len(np.unique(flights[0][:, :DEAD])) > 10


@pytest.mark.slow
def test_one_sided_thrusters_in_a_skew_plane_settle():
    """From any attitude, thrusters mounted half a degree off: the laws of two torques settle one in
    eight."""
    scenario = load(Path(__file__).with_name("skew-plane.toml"))
    found = build_study(scenario, 16, seed=5).values(np.arange(16))
    assert np.count_nonzero(np.isfinite(found["settling_time"])) >= 12


@pytest.mark.slow
def test_nothing_spins_up_where_mountings_are_off_by_too_much_to_settle():
    """By a degree, thrusts wrong by a tenth, from up to 0.16 rad/s: a quarter settles, all others
    turn slowly at the end. Pushes that took the torque in the plane, and thrust against a flow that
    was not there, spun some up to 3 rad/s."""
    wide = 'distribution="uniform", low=-{0}, high={0}'
    drawn = {"misalignment_rad": 0.0175, "torque_gain": 0.1, "omega_rad_s": 0.0926}
    changes = [f"dispersion.{key}={{{wide.format(size)}}}" for key, size in drawn.items()]
    changes += ['modulation={kind="pwm"}', "simulation.duration_s=1260"]
    scenario = load(Path(__file__).with_name("skew-plane.toml"), changes)
    found = build_study(scenario, 64, seed=11, history=11).values(np.arange(64))
    rates = np.linalg.norm(found["history_relative_rate"], axis=2)
    assert rates[:, -1].max() < 0.12
    assert np.count_nonzero(np.isfinite(found["settling_time"])) >= 12
