"""What is built of a scenario: plant, law, start and method."""

import math
import subprocess
import sys

import jax
import numpy as np
import pytest

from jaxsat.core.errors import PrecisionError
from jaxsat.core.solvers import class_name
from jaxsat.scenario.build import run as module
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.methods import adaptive
from jaxsat.spacecraft.actuators import Actuators


def test_plant_and_law_hold_the_numbers_of_the_file():
    run = build(load("switching", ["control.model.inertia_kg_m2=[450, 260, 310]",
                                   "control.measured_disturbance=[false,false,true]",
                                   "disturbance.constant_N_m=[0,0,1e-6]",
                                   "disturbance.gravity_gradient=true",
                                   "orbit.altitude_km=400", "simulation.solver.substeps=7",
                                   "simulation.solver.name=tsit5"]))  # fmt: skip
    plant, law = run.loop.plant, run.loop.controller
    np.testing.assert_array_equal(plant.spacecraft.moments, [449.5, 264.6, 312.5])
    np.testing.assert_array_equal(law.rate_law.model.spacecraft.moments, [450, 260, 310])
    assert float(plant.orbit.rate) == pytest.approx(math.sqrt(3.986004418e14 / 6778137.0**3))
    assert float(law.three_axis_law.model.orbit.rate) == float(plant.orbit.rate)
    assert len(plant.disturbance.terms) == 3
    assert law.three_axis_law.internal_model is None
    known = law.rate_law.model.disturbance
    np.testing.assert_array_equal(known.amplitude, [0, 0, 0.001])
    np.testing.assert_allclose(law.rate_slope_limit, [5 / 450, 5 / 260])
    np.testing.assert_allclose(law.three_axis_slope_limit, [25 / 450, 25 / 260])
    assert run.loop.substeps == 7
    assert class_name(run.method.solver) == "Tsit5"
    assert float(run.loop.plant.effectors[0].limit) == 5


def test_a_scenario_is_built_once_by_all_that_use_it(monkeypatch):
    """By its trial when it is loaded; another one, though it be equal, is built of its own."""
    built = []
    plainly = module._build
    monkeypatch.setattr(module, "_build", lambda one: built.append(one) or plainly(one))
    scenario = load("paper-rate")
    assert built == [scenario]
    run = build(scenario)
    assert build(scenario) is run
    assert len(built) == 1
    equal = scenario.model_copy()
    assert build(equal) is not run
    assert len(built) == 2
    assert built[1] is equal


def test_attitude_is_integrated_in_the_parameters_asked_for():
    wz = build(load("paper-three-axis")).start.attitude
    quaternion = build(load("paper-three-axis", ["simulation.attitude=quaternion"])).start.attitude
    assert type(wz).__name__ == "WZ"
    assert type(quaternion).__name__ == "Quaternion"
    np.testing.assert_allclose(wz.as_dcm().matrix, quaternion.as_dcm().matrix, atol=1e-15)


@pytest.mark.slow
def test_coasting_needs_no_thrusters():
    changes = ["spacecraft.failed_thrusters=[1,2,3]", "control.law=coast",
               "simulation.duration_s=10"]  # fmt: skip
    run = build(load("paper-rate", changes))
    assert isinstance(run.loop.plant.effectors[0], Actuators)
    trajectory = run.simulate()
    assert trajectory.outcome == 0
    assert not np.any(np.asarray(trajectory.signals.torque))


def test_method_of_the_file():
    def method(*changes):
        return build(load("paper-three-axis", changes)).method

    free = build(load("free-third-rate")).method
    assert float(free.step_size.rtol) == 1e-8
    assert float(free.step_size.min_step) == 2e-3
    usual = adaptive()
    assert float(method().step_size.rtol) == float(usual.step_size.rtol)
    assert class_name(method("simulation.solver.name=tsit5").solver) == "Tsit5"
    loose = method("simulation.solver.rtol=1e-6")
    assert float(loose.step_size.rtol) == 1e-6
    assert float(loose.step_size.atol) == float(usual.step_size.atol)
    assert loose.max_steps == usual.max_steps
    fixed = method("simulation.solver.step_s=0.25")
    assert float(fixed.first_step) == 0.25


def test_long_runs_with_fixed_steps_have_steps_enough():
    changes = ["simulation.duration_s=50000", "control.law=coast", "simulation.solver.name=heun"]
    run = build(load("paper-rate", changes))
    assert run.method.max_steps >= 50000 / float(run.method.first_step)


@pytest.mark.slow
def test_other_numbers_compile_nothing_anew():
    traces = []

    @jax.jit
    def final(loop, start, times):
        traces.append(1)
        return simulate(loop, start, times, method=method).signals.omega[-1]

    short = ["simulation.duration_s=2", "control.saturation_width=1", "control.tilt_width=0.1",
             "simulation.solver.step_s=0.1"]  # fmt: skip
    first = build(load("paper-three-axis", short))
    method = first.method
    final(first.loop, first.start, first.times)
    second = build(load("paper-three-axis", [*short, "control.k3=0.06", "control.mu=0.9",
                                             "disturbance.amplitude_N_m=[0,0,0]"]))  # fmt: skip
    final(second.loop, second.start, second.times)
    assert len(traces) == 1


COMPILATIONS = """
import sys
import jax
jax.config.update("jax_enable_x64", True)
happened = []
jax.monitoring.register_event_duration_secs_listener(lambda name, *_, **__: happened.append(name))
from jaxsat.scenario.build.load import load
for name in sys.argv[1:]:
    load(name)
print(sum("backend_compile" in name for name in happened))
jax.numpy.arange(3.0) + 1
print(sum("backend_compile" in name for name in happened) > 0)
"""


@pytest.mark.slow
def test_xla_compiles_nothing_for_loops_laws_sunlight_and_panels():
    """A sum of squares compiled by XLA takes as long as building the rest of the scenario."""
    names = ["thruster-dies", "hybrid-wheels", "k2", "paper-rate"]
    command = [sys.executable, "-c", COMPILATIONS, *names]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "True"]


def test_32_bit_floats_are_refused_with_what_to_call():
    """In them the control period is no divisor of the duration, which is no fault of the file."""
    scenario = load("two-torque-free")
    with jax.enable_x64(False):
        for building in (lambda: build(scenario), lambda: load("two-torque-free")):
            with pytest.raises(PrecisionError, match=r'config.update\("jax_enable_x64", True\)'):
                building()
        assert load("two-torque-free", purpose="text") == scenario
