"""The family of random spacecraft: what it may hold, and that its dispersions scale."""

import jax
import numpy as np
import pytest
from scipy.stats import beta

import small_coupling
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import study_program
from jaxsat.scenario.holding import missing_torque
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.studies.designs import Independent
from jaxsat.studies.ensemble import Study
from random_family import LEAST_COUPLING, family_member, family_scenario


@pytest.fixture(scope="module")
def members():
    return [family_member(number) for number in range(12)]


def test_members_are_as_said(members):
    for member in members:
        low, middle, high = np.linalg.eigvalsh(member.inertia)
        one, other = member.torque_axes
        assert low + middle >= high > 0
        assert abs(one @ other) <= np.cos(np.radians(30)) + 1e-12
        assert member.coupling >= LEAST_COUPLING
        assert member.limit > 0


def test_a_member_is_a_function_of_seed_and_number_alone(members):
    again = family_member(5)
    np.testing.assert_array_equal(again.inertia, members[5].inertia)
    assert again[3:] == members[5][3:]
    assert family_member(5, 1).limit != members[5].limit
    with jax.enable_x64(False):
        np.testing.assert_array_equal(family_member(5).inertia, members[5].inertia)


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_gravity_gradient_acts_in_low_orbit_alone(members):
    acts = [family_scenario(one, "three-slew").disturbance.gravity_gradient for one in members]
    assert acts == [one.orbit_rate > 0 for one in members]
    assert {True, False} == {*acts}


def test_the_orbit_frame_can_be_held(members):
    for member in members:
        if member.orbit_rate:
            normal = np.cross(*member.torque_axes)
            normal /= np.linalg.norm(normal)
            missing = missing_torque(member.inertia, normal, np.zeros(3), True)
            assert abs(missing) < 1e-6 * np.abs(member.inertia).max()


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_dispersions_are_those_of_the_acceptance_set_in_its_own_units(members):
    """Rates times τ, and torques over the torque that τ is made of, are the paper's at 5 N m."""
    for member in members[:3]:
        scenario = family_scenario(member, "three-slew")
        rates = scenario.dispersion.omega_rad_s
        assert rates.high * member.unit == pytest.approx(0.1 * 8.3050, rel=1e-4)
        torque = np.sqrt(member.moments[0] * member.moments[1]) / member.unit**2
        amplitude = np.array(scenario.disturbance.amplitude_N_m)
        np.testing.assert_allclose(amplitude / torque, np.array([0.01, 0.02, 0.001]) / 5)
        assert torque <= member.limit


def test_the_summary_counts_spacecraft_of_every_coupling():
    """Both ends of 3 of 4 are those of Clopper and Pearson, by the beta distribution."""
    numbers = {"orbit_rate_tau": 0.0, "reached": 1.0}
    rows = [{"c": c, "settled": part, **numbers} for c, part in ((0.03, 0.9), (0.3, 1), (0.6, 1))]
    told = small_coupling.summary([*rows, rows[-1]]).splitlines()
    assert [line.split(",")[1].split(":")[0] for line in told[:3]] == [
        " c 0.02 to 0.05",
        " c 0.2 to 0.45",
        " c 0.45 to inf",
    ]
    low, high = beta.ppf([0.025, 0.975], (3, 4), (2, 1))
    assert told[3] == f"3 of 4 spacecraft ({low:.1%} to {high:.1%}) reach 99% of all cases"
    assert told[4].startswith("4 of 4 spacecraft")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_a_small_coupling_settles_after_a_lost_attitude():
    """c = 0.089: three of these cases turned about the third axis for ever, each with an
    oscillation beyond what the torque makes."""
    scenario = small_coupling.vehicle(family_member(13, 2, (0.05, 0.1)), "three-slew")
    _, program = study_program(scenario, build(scenario), 7)
    study = Study(program, Independent(7), NativeEngine(batch_size=256), 256)
    assert np.isfinite(study.values(np.arange(256))["settling_time"]).sum() >= 255
