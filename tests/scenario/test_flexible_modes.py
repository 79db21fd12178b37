"""Tables `[[flexible_mode]]`: mistakes, frequencies, cautions, flights and studies."""

import numpy as np
import pytest
import scipy.linalg
from pydantic import ValidationError

from helpers.effectors import effector_of
from helpers.gyros import document as of_gyros
from jaxsat.report.controllability_study import controllability_study
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.flexibility import flexibility_cautions, oscillations
from jaxsat.scenario.resolution import fastest
from jaxsat.simulation.loops import parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.flexible_modes import FlexibleModes, ModeStates
from jaxsat.synthesis.optima.run import UnsuitableScenario, require_ideal_thrusters
from simulation.engine.examples import agreed

INERTIA = np.array([[50.0, 2.0, -1.0], [2.0, 60.0, 3.0], [-1.0, 3.0, 40.0]])
COUPLINGS = np.array([[3.0, -1.0, 0.5], [0.5, 2.0, 3.5]])
FREQUENCIES = np.array([0.9, 1.7])


def document(**changes):
    """A body with two modes that three wheels turn."""
    tables = zip(COUPLINGS.tolist(), FREQUENCIES.tolist(), strict=True)
    found = of_gyros()
    del found["gimbal"]
    found["spacecraft"] = {"inertia_kg_m2": INERTIA.tolist()}
    found["wheel"] = [{"axis": list(axis), "torque_limit_N_m": 1.0} for axis in np.eye(3)]
    found["flexible_mode"] = [
        {"frequency_rad_s": frequency, "damping": 0.01, "coupling_sqrt_kg_m": coupling}
        for coupling, frequency in tables
    ]
    return found | changes


def test_modes_of_a_scenario_are_parts_of_the_plant_that_the_law_does_not_know():
    data = document()
    data["flexible_mode"][1]["angle_rad"] = 0.03
    run = build(Scenario.model_validate(data))
    modes = effector_of(run.loop.plant, FlexibleModes)
    assert modes is not None
    np.testing.assert_allclose(modes.axes * modes.coupling[None], COUPLINGS.T, rtol=1e-14)
    np.testing.assert_array_equal(modes.frequency, FREQUENCIES)
    np.testing.assert_array_equal(modes.damping, [0.01, 0.01])
    state = run.start.find(ModeStates)
    assert state is not None
    np.testing.assert_array_equal(state.angle, [0.0, 0.03])
    assert isinstance(run.loop, SampledLoop)
    assert not parts_of(RigidBody, run.loop.controller)[0].effectors


def _uncoupled(data):
    data["flexible_mode"][0]["coupling_sqrt_kg_m"] = [0, 0, 0]


def _more_than_the_body(data):
    data["flexible_mode"][1]["coupling_sqrt_kg_m"] = [0.0, 0.0, 6.5]


def _failed(data):
    data["flexible_mode"][1]["failed"] = True


def _fails(data):
    data["failure"] = [{"of": "flexible_mode 1", "at_s": 1.0, "kind": "dead"}]


def _held(data):
    data["spacecraft"]["third_rate"] = "held"


def _error_coordinates(data):
    data["simulation"]["coordinates"] = "error"
    data["control"] = {"law": "three-axis", "k3": 0.05, "k4": 0.01, "mu": 1.0, "a": 0.1}
    del data["wheel"]
    data["spacecraft"]["thruster_torque_axes"] = [[1, 0, 0], [0, 1, 0]]


def _alone(data):
    del data["wheel"]


@pytest.mark.parametrize(
    ("mistake", "said"),
    [
        (_uncoupled, "must have an entry other than 0"),
        (_more_than_the_body, "must be of a part of spacecraft.inertia_kg_m2"),
        (_failed, "failed"),
        (_fails, "flexible_mode 1"),
        (_held, 'must be "free" with .*flexible_mode'),
        (_error_coordinates, "because the spacecraft has parts that move by themselves"),
        (_alone, "thruster_torque_axes"),
    ],
)
def test_mistakes_are_told(mistake, said):
    data = document()
    mistake(data)
    with pytest.raises(ValidationError, match=said):
        Scenario.model_validate(data)


def test_frequencies_with_the_body_free_are_those_of_its_equations():
    """Of M q'' + K q = 0 for the rotation of the body and both amplitudes, by SciPy."""
    mass = np.block([[INERTIA, COUPLINGS.T], [COUPLINGS, np.eye(2)]])
    stiffness = np.diag([0.0, 0.0, 0.0, *FREQUENCIES**2])
    squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    scenario = Scenario.model_validate(document())
    found = oscillations(scenario)
    np.testing.assert_allclose([one.frequency for one in found], np.sqrt(squares[3:]), rtol=1e-12)
    assert [one.of for one in found] == ["flexible mode 1", "flexible mode 2"]
    fast = fastest(scenario)
    assert fast is not None
    assert (fast.what, fast.rate) == ("flexible mode 2", pytest.approx(np.sqrt(squares[-1])))


def test_a_law_that_is_fast_and_pulses_in_step_are_cautioned_against():
    data = document()
    scenario = Scenario.model_validate(data)
    assert not list(flexibility_cautions(scenario))
    data["control"]["natural_frequency_rad_s"] = 0.4
    (caution,) = flexibility_cautions(Scenario.model_validate(data))
    slowest = oscillations(scenario)[0].frequency
    assert caution.location == ("control", "natural_frequency_rad_s")
    assert f"{slowest / 0.4:.3g} times as fast as the law" in caution.message
    del data["wheel"]
    data["thruster"] = [
        {"torque_axis": list(axis), "torque_N_m": 1.0, "two_sided": True} for axis in np.eye(3)
    ]
    data["control"] |= {"natural_frequency_rad_s": 0.05, "period_s": 2 * np.pi / slowest * 2.02}
    data["simulation"]["save_every_s"] = data["control"]["period_s"]
    data["simulation"]["duration_s"] = 10 * data["control"]["period_s"]
    (caution,) = flexibility_cautions(Scenario.model_validate(data))
    assert caution.location == ("control", "period_s")
    assert "a period has 2.02 cycles" in caution.message


def test_the_verdict_says_that_modes_are_left_out():
    study = controllability_study(Scenario.model_validate(document()))
    assert "Not included, as if locked to the body: flexible modes." in study.lines
    rigid = document()
    del rigid["flexible_mode"]
    same = controllability_study(Scenario.model_validate(rigid))
    assert [line for line in study.lines if "Not included" not in line] == same.lines


@pytest.mark.slow
def test_engines_agree_on_modes_that_are_dispersed():
    names = ("mode_coupling", "mode_frequency", "mode_damping")
    uniform = {"distribution": "uniform", "low": -0.2, "high": 0.2}
    data = document(dispersion=dict.fromkeys(names, uniform))
    data["simulation"]["duration_s"] = 3.0
    study = build_study(Scenario.model_validate(data), count=4)
    found = agreed(study.program, study.cases(np.arange(4)), 0.25, apart=1e-7)
    values = study.values(np.arange(4))
    for name in names:
        assert len(np.unique(values[f"drawn_{name}"])) == 8
    assert values["peak_mode_angle"].shape == (4, 2)
    assert values["peak_mode_angle"].min() > 1e-4
    assert np.all(found.effort > 0)


def test_bounds_of_a_flexible_body_are_refused():
    data = document()
    del data["wheel"]
    data["spacecraft"] |= {"thruster_torque_axes": np.eye(3).tolist(), "torque_limit_N_m": 1.0}
    with pytest.raises(UnsuitableScenario, match="flexible_mode: must be left out for a bound"):
        require_ideal_thrusters(Scenario.model_validate(data), "a bound")
