"""Steps that resolve what is fast in a scenario, and what is told of those that do not."""

import warnings

import numpy as np
import pytest
from scipy.linalg import eigvals

from helpers.gyros import document
from jaxsat.scenario import Scenario, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.resolution import fastest, substeps_of

SAMPLED = "two-torque-free"


def told(name, *changes):
    """What is told of a scenario's steps with these changes, and the scenario."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScenarioWarning)
        scenario = load(name, changes)
    return [str(one.message) for one in caught if "to resolve" in str(one.message)], scenario


def test_library_scenarios_resolve_what_is_fast_in_their_own_steps():
    for name, substeps in (("two-torque-free", 4), ("cubesat-12u", 1), ("switching-rounded", 1)):
        messages, scenario = told(name)
        assert not messages
        assert substeps_of(scenario) == substeps


def test_substeps_resolve_a_fast_torque():
    messages, scenario = told(SAMPLED, "disturbance.frequency_rad_s=[0.7,300,0.1]")
    fast = fastest(scenario)
    assert (fast.what, fast.rate) == ("periodic torque", 300)
    assert not messages
    assert build(scenario).loop.substeps == substeps_of(scenario) == 256  # 0.15 rad each at most


def test_a_torque_without_amplitude_is_not_fast():
    changes = ("disturbance.frequency_rad_s=[0,300,0]", "disturbance.amplitude_N_m=[0.1,0,0.1]")
    _, scenario = told(SAMPLED, *changes)
    assert fastest(scenario).what != "periodic torque"


def test_substeps_that_do_not_resolve_it_are_told_with_the_number_needed():
    changes = ("disturbance.frequency_rad_s=[0.7,300,0.1]", "simulation.solver.substeps={}")
    messages, _ = told(SAMPLED, changes[0], changes[1].format(4))
    (text,) = messages
    assert "key simulation.solver.substeps: should be at least 21 to resolve" in text
    assert "300 rad/s (disturbance.frequency_rad_s), got 4 steps of 0.025 s" in text
    assert not told(SAMPLED, changes[0], changes[1].format(21))[0]


def test_work_limits_the_substeps_and_then_it_is_told():
    changes = ("disturbance.frequency_rad_s=[0.7,300,0.1]", "simulation.duration_s=500000")
    messages, scenario = told(SAMPLED, *changes)
    assert substeps_of(scenario) == 4  # as without a fast torque
    assert "at least 21" in messages[0]


def test_a_solver_of_low_order_needs_shorter_steps():
    fine = told(SAMPLED, "initial.omega_rad_s=[0.1,0.2,0.1]", "simulation.solver.name='heun'")[1]
    coarse = told(SAMPLED, "initial.omega_rad_s=[0.1,0.2,0.1]")[1]
    assert substeps_of(fine) > substeps_of(coarse)


def test_fixed_steps_of_a_continuous_law_are_told_too():
    changes = ("disturbance.frequency_rad_s=[50,0.8,0.1]", "simulation.solver.step_s=0.1")
    messages, _ = told("rate-limited", *changes)
    assert "simulation.solver.step_s: should be at most" in messages[0]
    assert not told("rate-limited", changes[0])[0]


def test_spin_nutation_and_dispersed_starts_count():
    disc = ["spacecraft.inertia_kg_m2=[100,110,190]", "disturbance.amplitude_N_m=[0,0,0]"]
    _, scenario = told(SAMPLED, *disc, "initial.omega_rad_s=[0,0,2]")
    assert fastest(scenario).rate == pytest.approx(380 / np.sqrt(100 * 110))
    assert fastest(scenario).what == "nutation"
    dispersed = "dispersion.omega_rad_s={distribution='uniform',low=-5,high=1}"
    _, scenario = told("oscillatory-dispersed", dispersed)
    assert fastest(scenario).rate > np.sqrt(3) * 5


def test_friction_is_the_fastest_eigenvalue_of_body_and_rotors():
    """J ω' = A u, h' = -u - J_w Aᵀω' with u = b h / J_w, as a generalised eigenvalue problem."""
    inertia = np.diag([2.0, 3.0, 4.0])
    axes, rotor, friction = np.eye(3)[:, :2], 0.5, 10.0
    tables = ",".join(
        f"{{axis={axis.tolist()},torque_limit_N_m=1,rotor_inertia_kg_m2={rotor},"
        f"viscous_friction_N_m_s={friction}}}"
        for axis in axes.T
    )
    changes = [
        "spacecraft.inertia_kg_m2=[2,3,4]",
        "initial.omega_rad_s=[0.01,0.01,0]",
        f"wheel=[{tables}]",
    ]
    _, scenario = told("two-wheel-telescope", *changes)
    mass = np.block([[inertia, axes], [rotor * axes.T, np.eye(2)]])
    force = np.zeros((5, 5))
    force[3:, 3:] = -friction / rotor * np.eye(2)
    # J ω' + A h' = 0 and h' + J_w Aᵀω' = -b h / J_w
    fast = np.abs(eigvals(force, mass)).max()
    found = fastest(scenario)
    assert found.what == "viscous friction"
    assert found.rate == pytest.approx(fast, rel=1e-9)
    assert found.location[0] == "wheel"


def test_nutation_with_gyros_is_the_fastest_eigenvalue_that_their_momenta_can_make():
    """J ω' = -h × ω at rest, with the momentum h of all rotors along one axis."""
    scenario = Scenario.model_validate(document())
    inertia = np.array(scenario.spacecraft.inertia_kg_m2)
    axes = np.random.default_rng(1).normal(size=(1000, 3))
    momenta = 4 * 0.8 * axes / np.linalg.norm(axes, axis=1)[:, None]
    crosses = np.cross(np.eye(3)[None], momenta[:, None])  # rows (h ×)ᵀ
    rates = np.abs(np.linalg.eigvals(np.linalg.solve(inertia, crosses))).max()
    found = fastest(scenario)
    assert found.what == "nutation"
    spin = np.linalg.norm(scenario.initial.omega_rad_s)
    assert rates < found.rate < 1.02 * rates + 2 * spin


def test_the_run_down_of_a_rotor_is_fast():
    stops = {"of": "gimbal 2", "at_s": 4.3, "kind": "run-down", "time_constant_s": 1e-3}
    found = fastest(Scenario.model_validate(document([stops])))
    assert (found.what, found.rate) == ("run-down of a rotor", pytest.approx(1000))
