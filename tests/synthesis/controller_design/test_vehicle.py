"""What is left of a vehicle, what a file may leave out, and what is filled in without dimension."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jaxsat
from jaxsat.control.oscillatory import Slow
from jaxsat.core.allocation import torque_directions
from jaxsat.core.inertia import normal_axes
from jaxsat.scenario.build.run import build_loop
from jaxsat.scenario.control import known_law
from jaxsat.scenario.derived import believed_axes
from jaxsat.scenario.holding import missing_torque
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.studies.changes import controller_of
from jaxsat.studies.dispersions import number_at
from jaxsat.synthesis.controller_design.candidates import (
    GAINS,
    Candidate,
    fitting_candidates,
    usual_control,
    with_larger_end_game,
    written_out,
)
from jaxsat.synthesis.controller_design.completion import completed
from jaxsat.synthesis.controller_design.lost_holds import design_cautions
from jaxsat.synthesis.controller_design.request import ALL, QUICK, read_vehicle
from jaxsat.synthesis.controller_design.tuning import tuning_table
from jaxsat.synthesis.controller_design.variants import stronger, turned, with_scaled_gains
from jaxsat.synthesis.controller_design.vehicle import (
    Scale,
    control_period,
    scale_of,
    vehicle_verdict,
)

BARE = """
[spacecraft]
inertia_kg_m2 = [0.45, 0.26, 0.31]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
failed_thrusters = [3]
torque_limit_N_m = 0.002
"""


@pytest.fixture
def bare(tmp_path):
    file = tmp_path / "bare.toml"
    file.write_text(BARE)
    return file


def complete(vehicle):
    verdict = vehicle_verdict(vehicle.scenario)

    def fill(scenario, scale):
        return completed(scenario, verdict, scale, vehicle.timed).scenario

    return fitting_candidates(vehicle.scenario, verdict, vehicle.law, fill)


def test_a_file_may_have_the_spacecraft_alone(bare):
    vehicle = read_vehicle(bare)
    assert (vehicle.law, vehicle.timed) == (QUICK, False)
    assert vehicle.scenario.title == "bare"
    assert vehicle.scenario.orbit.rate_rad_s == 0
    fitting = complete(vehicle)
    assert [one.name for one in fitting.candidates] == ["three-slew", "oscillatory"]
    assert [text.partition(":")[0] for text in fitting.left_out] == ["planned"]
    solver = fitting.candidates[0].scenario.simulation.solver
    assert (solver.name, solver.substeps) == ("bosh3", 1)
    given = [f"simulation.solver.{one}" for one in ("substeps=2", "rate_error_rad_s=1e-3")]
    for keys, expected in ((given, (None, 2)), (given[1:], ("bosh3", 1))):
        own = complete(read_vehicle(bare, keys)).candidates[0].scenario.simulation.solver
        assert (own.name, own.substeps, own.rate_error_rad_s) == (*expected, 1e-3)
    every = complete(vehicle._replace(law=ALL))
    assert [one.name for one in every.candidates] == ["three-slew", "oscillatory", "planned"]
    assert not every.left_out


def test_what_a_file_says_is_kept(bare):
    bare.write_text(
        'title = "T"\n' + BARE + "[orbit]\naltitude_km = 500\n[initial]\nw = [0.1, 0.0]\n"
        "z_deg = 10\nomega_deg_s = [0, 0, 1]\n[control]\nperiod_s = 0.2\n"
    )
    vehicle = read_vehicle(bare, ["simulation.duration_s=700"])
    assert (vehicle.law, vehicle.timed) == (QUICK, True)
    assert (vehicle.scenario.title, vehicle.scenario.orbit.altitude_km) == ("T", 500)
    assert vehicle.scenario.initial.omega_rad_s[2] == pytest.approx(np.radians(1))
    (found,) = complete(vehicle._replace(law="oscillatory")).candidates
    assert found.scenario.control.model_dump()["period_s"] == 0.2


@pytest.mark.parametrize(
    ("tables", "acts"),
    [
        ("[orbit]\naltitude_km = 500\n", True),
        ("", False),
        ("[orbit]\naltitude_km = 500\n[disturbance]\namplitude_N_m = [1e-6, 0, 0]\n", False),
    ],
)
def test_gravity_gradient_is_filled_in_where_a_file_in_orbit_is_silent(bare, tables, acts):
    bare.write_text(BARE + tables)
    scenario = read_vehicle(bare).scenario
    assert scenario.disturbance.gravity_gradient is acts
    told = [line for line in vehicle_verdict(scenario).lines() if "ravity gradient" in line]
    assert len(told) == ("orbit" in tables)
    assert all(("acts in every case" in line) is acts for line in told)


@pytest.mark.parametrize(("given", "law"), [("oscillatory", "oscillatory"), ("coast", QUICK)])
def test_a_law_that_is_named_is_the_one_designed(bare, given, law):
    assert read_vehicle(bare, [f"control.law={given}"]).law == law


def test_mistakes_of_a_file_are_told_as_ever(bare):
    bare.write_text(BARE.replace("0.26", "-0.26"))
    with pytest.raises(jaxsat.ScenarioError, match=r"bare\.toml:3.*positive definite"):
        read_vehicle(bare)


def test_what_is_filled_in_has_no_dimension(bare):
    """Dividing J and T by one number changes nothing; T alone stretches all times alike."""

    def filled(*overrides):
        vehicle = read_vehicle(bare, overrides)._replace(law="oscillatory")
        scenario = complete(vehicle).candidates[0].scenario
        return scenario, scale_of(scenario).time

    one, time = filled()
    heavy, same = filled(
        "spacecraft.inertia_kg_m2=[450.0, 260.0, 310.0]", "spacecraft.torque_limit_N_m=2.0"
    )
    assert same == pytest.approx(time)
    for table in ("dispersion", "sampling", "simulation"):
        assert getattr(heavy, table) == getattr(one, table)
    strong, quicker = filled("spacecraft.torque_limit_N_m=0.008")
    assert quicker == pytest.approx(time / 2)
    assert strong.dispersion.omega_rad_s.high == pytest.approx(
        2 * one.dispersion.omega_rad_s.high, rel=2e-3
    )
    assert strong.sampling.rate_noise_rad_s == pytest.approx(
        2 * one.sampling.rate_noise_rad_s, rel=0.05
    )


@pytest.mark.slow
def test_a_small_coupling_takes_longer_as_physics_does(bare):
    """Twice the time for half the c and the same moments about the axes with torques; in a low
    orbit, where more time does not help, none more, but the reason is told.

    Drifts in orbit grow as the square of its rate: those of a hundredth of it need no attitude.
    """

    def filled(third, *more, second=0.26):
        inertia = f"spacecraft.inertia_kg_m2=[0.27, {second}, {third}]"
        vehicle = read_vehicle(bare, [inertia, *more])
        candidates = complete(vehicle).candidates
        verdict = vehicle_verdict(vehicle.scenario)
        cautions = design_cautions(vehicle.scenario, verdict, candidates)
        return candidates[0].scenario.simulation.duration_s, cautions

    usual = complete(read_vehicle(bare)).candidates[0].scenario.simulation.duration_s
    small, told = filled(0.2)
    smaller, _ = filled(0.4)
    assert smaller == pytest.approx(2 * small, rel=1e-3)
    assert small == pytest.approx(usual * 0.4 / 0.05, rel=0.2)
    assert not any("In orbit with c" in line for line in told)
    assert filled(0.2, "orbit.rate_rad_s=1e-5")[0] == small
    in_orbit, told = filled(0.2, "orbit.rate_rad_s=1.2e-3")
    assert in_orbit == pytest.approx(usual, rel=0.2)
    assert "In orbit with c = 0.05, " in told[0]
    assert "of 1000 bodies drawn from [dispersion] drift" in told[0]
    _, told = filled(0.2, "orbit.rate_rad_s=1e-5")
    assert not any("In orbit with c" in line for line in told)


def test_dispersions_that_are_given_are_kept_with_their_duration():
    scenario = jaxsat.load("oscillatory-dispersed")
    verdict = vehicle_verdict(scenario)
    found = completed(scenario, verdict, scale_of(scenario))
    assert found.assumed == ()
    assert found.scenario == scenario


def test_the_law_that_plans_is_tuned_without_derivatives(bare):
    vehicle = read_vehicle(bare)._replace(law="planned")
    (found,) = complete(vehicle).candidates
    table = tuning_table(found.scenario, scale_of(found.scenario), 4, 100)
    assert table.optimiser == "cma-es"
    assert table.parameters.keys() == {"planning_margin", "replan_s"}
    tuned = found.scenario.model_copy(update={"tuning": table})
    assert jaxsat.Scenario.model_validate(tuned.model_dump(exclude_none=True)) == tuned


def test_the_law_that_plans_is_for_thrusters():
    """It knows nothing of the momentum that wheels can take."""
    candidates = complete(read_vehicle("two-wheel-telescope")._replace(law=ALL)).candidates
    assert "planned" not in [one.name for one in candidates]


def test_two_wheels_start_without_momentum_and_without_thrusters_to_disperse():
    found = complete(read_vehicle("two-wheel-telescope")).candidates[0].scenario
    given = set(found.dispersion.distributions)
    assert "attitude_error" in given
    assert not given & {"omega", "torque_gain", "misalignment", "attitude"}


@pytest.mark.parametrize(
    "name", [pytest.param("cubesat-12u", marks=pytest.mark.slow), "two-wheel-telescope"]
)
def test_gains_of_a_stronger_vehicle_are_those_scaled(name):
    """What is made for four times the torque is what was made, with every time halved."""
    vehicle = read_vehicle(name)
    (law,) = {one.scenario.control.law for one in complete(vehicle).candidates}
    stronger_vehicle = vehicle._replace(scenario=stronger(vehicle.scenario, 4.0))
    for variant in GAINS[law]:
        one, other = (
            next(one.scenario for one in complete(each).candidates if one.name == law + variant)
            for each in (vehicle, stronger_vehicle)
        )
        expected = with_scaled_gains(one, 4.0)
        found = other.control.model_dump(exclude_none=True)
        assert found.keys() == expected.keys()
        rates, _ = GAINS[law][variant]
        for key, value in expected.items():
            assert found[key] == (pytest.approx(value, rel=1e-3) if key in rates else value)


def test_the_wanted_attitude_and_the_nearest_that_can_be_held():
    """Turned to it the vehicle is the same body with the same torques, and needs no torque."""
    rng = np.random.default_rng(5)
    base = jaxsat.load("two-torque-free", purpose="text")
    tried = 0
    while tried < 3:
        axes = Rotation.from_rotvec(rng.normal(size=3) * 0.15).as_matrix()
        inertia = axes @ np.diag([449.5, 264.6, 312.5]) @ axes.T
        table = {"inertia_kg_m2": tuple(map(tuple, inertia.tolist()))}
        scenario = base.model_copy(update={"spacecraft": base.spacecraft.model_copy(update=table)})
        verdict = vehicle_verdict(scenario)
        if verdict.turn is None or verdict.holds:
            continue
        tried += 1
        made = turned(scenario, verdict.turn)
        assert _missing(scenario) > 1e-3
        assert _missing(made) < 1e-4 * _missing(scenario)
        assert vehicle_verdict(made).holds
        np.testing.assert_allclose(_form(made), _form(scenario), rtol=1e-9)
        before, after = (jaxsat.build(one).start for one in (scenario, made))
        np.testing.assert_allclose(
            np.linalg.norm(after.omega), np.linalg.norm(before.omega), rtol=1e-9
        )
        rotation = Rotation.from_rotvec(verdict.turn).as_matrix()
        np.testing.assert_allclose(
            after.attitude.as_dcm().matrix, rotation @ before.attitude.as_dcm().matrix, atol=1e-9
        )


def _frame(scenario):
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    return inertia, *normal_axes(inertia, torque_directions(believed_axes(scenario)))


def _missing(scenario):
    inertia, axes, _ = _frame(scenario)
    return abs(missing_torque(inertia, axes[2], np.zeros(3), False)) / inertia.max()


def _form(scenario):
    return _frame(scenario)[2]


def test_every_gain_that_can_be_tuned_is_written_out_and_changes_nothing():
    scenario = jaxsat.load("two-torque-free", ["control.law=oscillatory"])
    made = written_out(scenario)
    gains = [getattr(made.control, key) for key in Candidate("", made).tunable]
    assert all(isinstance(gain, float) for gain in gains)
    assert written_out(made) == made
    one, other = (jaxsat.build(each).loop.controller for each in (scenario, made))
    for place in Candidate("", made).tunable.values():
        assert number_at(other, place) == number_at(one, place)


def test_a_larger_end_game_is_as_large_as_the_tolerances_of_settling_allow():
    """The rates asked for over a period, and the tilt that they make: 0.85e-3 rad/s at most."""
    candidate = Candidate("any", jaxsat.load("acceptance-hard", ["control.law=oscillatory"]))
    larger = with_larger_end_game(candidate)
    assert larger is not None
    law, before = (controller_of(build_loop(one.scenario)) for one in (larger, candidate))
    game = law.fine.end_game
    omega = jnp.zeros(3)
    third, _ = law.estimator.update(omega, law.estimator.init(omega), law.period)
    alpha, beta, rho, *_ = game.oscillation(Slow(jnp.array(0.0), jnp.array(1.0)), third)
    phase = np.linspace(0, 2 * np.pi, 100)
    second = (alpha * np.sin(phase) + beta * np.cos(phase)) / rho
    rate = np.hypot(rho * np.sin(phase), second).max()
    assert rate == pytest.approx(0.85e-3, rel=5e-3)
    assert rate / game.frequency / 2 < 0.025  # |w|
    assert game.largest_amplitude > before.fine.end_game.largest_amplitude
    assert with_larger_end_game(larger) is None


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        pytest.param(
            *("acceptance-hard", ["spacecraft.torque_limit_N_m=20", "control.period_s=0.05"]),
            id="large already",
            marks=pytest.mark.filterwarnings("ignore:.*settled.rate_rad_s"),
        ),
        pytest.param("cubesat-12u", [], id="another law"),
    ],
)
def test_there_is_no_larger_end_game(name, changes):
    assert with_larger_end_game(Candidate("any", jaxsat.load(name, changes))) is None


@pytest.mark.parametrize("name", ["0", "true", "2024-01-01", "[a]", "nan", "'x'"])
def test_the_name_of_a_file_is_a_title_whatever_it_reads_as(bare, name):
    odd = bare.rename(bare.with_name(f"{name}.toml"))
    assert read_vehicle(odd).scenario.title == name


RODS = """
[spacecraft]
inertia_kg_m2 = [2.4, 2.2, 1.6]

[orbit]
altitude_km = 500
inclination_rad = 1.7

[[magnetorquer]]
axis = [1, 0, 0]
dipole_limit_A_m2 = 5

[[magnetorquer]]
axis = [0, 1, 0]
dipole_limit_A_m2 = 5
"""


@pytest.mark.slow
def test_magnetorquers_get_their_law_in_the_time_of_an_orbit(tmp_path):
    (tmp_path / "rods.toml").write_text(RODS)
    scenario, law, timed = read_vehicle(tmp_path / "rods.toml")
    verdict = vehicle_verdict(scenario)
    assert (verdict.judgement.verdict, verdict.judgement.laws) == ("controllable", "magnetic")

    def complete(under_law, scale):
        return completed(under_law, verdict, scale, timed).scenario

    fitting = fitting_candidates(scenario, verdict, law, complete)
    laws = ("magnetic", "fault-tolerant")
    assert [one.name for one in fitting.candidates] == [
        name for law in laws for name in (law, f"{law}, quick")
    ]
    durations = {one.scenario.simulation.duration_s for one in fitting.candidates}
    assert len(durations) == 1
    alone = fitting_candidates(scenario, verdict, "fault-tolerant", complete).candidates
    for one in (*fitting.candidates, *alone):
        rate = one.scenario.orbit.rate()
        assert scale_of(one.scenario).time == pytest.approx(1 / rate)
        assert one.scenario.simulation.duration_s > 3 * 2 * np.pi / rate
        assert one.scenario.control.period_s == 1.0
        assert one.scenario.dispersion is not None


@pytest.mark.parametrize(
    ("torque", "control", "period"),
    [
        (None, "", 1.0),
        (5e-3, "", 1.0),
        (0.2, "", 0.3),  # a tenth of the 3.4 s in which it turns the body by half a radian
        (1.0, "", 0.1),
        (1.0, "law = 'magnetic'\nperiod_s = 1.0", 1.0),
        (None, "law = 'magnetic'\nperiod_s = 4.0", 4.0),
    ],
    ids=["no wheel", "slow wheel", "quick wheel", "quickest wheel", "usual given", "given"],
)
def test_beside_magnetorquers_the_period_is_that_of_their_law_or_less(
    tmp_path, torque, control, period
):
    wheel = f"\n[[wheel]]\naxis = [0, 1, 0]\ntorque_limit_N_m = {torque}\n" if torque else ""
    table = f"\n[control]\n{control}\n" if control else ""
    (tmp_path / "rods.toml").write_text(RODS + wheel + table)
    scenario = read_vehicle(tmp_path / "rods.toml").scenario
    assert usual_control(scenario, "fault-tolerant")["period_s"] == period


def test_a_vehicle_with_gyros_is_refused_by_name(tmp_path):
    gimbal = "[[gimbal]]\naxis = [1, 0, 0]\nspin_axis = [0, 1, 0]\nrotor_momentum_N_m_s = 1.0\n"
    (tmp_path / "gyros.toml").write_text(f"{RODS}\n{gimbal}rate_limit_rad_s = 1.0\n")
    with pytest.raises(ValueError, match="gimbal"):
        vehicle_verdict(read_vehicle(tmp_path / "gyros.toml").scenario)


@pytest.mark.parametrize(
    ("text", "period"),
    [
        ("", 0.7),  # 0.0054 of the 138 s in which 0.1 N m turns the body by half a radian
        ("[control]\nlaw = 'oscillatory'\n", 0.7),
        ("[control]\nlaw = 'oscillatory'\nperiod_s = 0.1\n", 0.1),
        ("[control]\nlaw = 'oscillatory'\nfrequency_rad_s = 0.02\n", 0.1),
        ("[sampling]\nrate_noise_rad_s = 1e-5\n", 0.1),
        ("[disturbance]\namplitude_N_m = [1e-3, 0, 0]\nfrequency_rad_s = [0.39, 0, 0]\n", 0.2),
    ],
    ids=["bare", "named", "given", "own gains", "sensors", "quick torque"],
)
def test_a_slow_body_gets_a_long_period(tmp_path, text, period):
    path = tmp_path / "slow.toml"
    body = "[spacecraft]\ninertia_kg_m2 = [2000, 1800, 1200]\ntorque_limit_N_m = 0.1\n"
    path.write_text(body + "thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\n" + text)
    scenario, scale = read_vehicle(path).scenario, Scale((2000.0, 1800.0), 0.1)
    assert control_period(scenario, known_law("magnetic"), scale) == 1.0
    verdict = vehicle_verdict(scenario)
    candidate = fitting_candidates(scenario, verdict, "oscillatory", lambda one, _: one)[0][0]
    assert candidate.scenario.control.model_dump()["period_s"] == period
