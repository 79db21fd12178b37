"""What the analysis calls flyable is built, and what `check` passes is told apart by command."""

import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.compiling import by_machine_code, interpreted
from jaxsat.cli.scenarios import check
from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.core.allocation import least_propellant, plane_map, pushed_directions
from jaxsat.report.controllability_study import controllability_study
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.actuator_set import judge_scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.derived import torque_limit
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.synthesis.controller_design.request import read_vehicle
from jaxsat.synthesis.controller_design.vehicle import vehicle_verdict

INERTIA = "[spacecraft]\ninertia_kg_m2 = [1.0, 0.7, 0.5]\n"
REST = """title = "x"
[orbit]
rate_rad_s = 0.0
[initial]
quaternion = [1, 0, 0, 0]
omega_rad_s = [0, 0, 0]
[control]
law = "three-slew"
period_s = 0.1
[simulation]
duration_s = 1.0
save_every_s = 0.5
"""
MODULATION = '[modulation]\nkind = "pwm"\n'
SKEW = np.array([[1, 0, 0.3], [-1, 0, -0.3], [0, 1, 0], [0, -1, 0], [0, 0, 1]]).T * 0.01


def _file(tmp_path, *parts):
    path = tmp_path / "vehicle.toml"
    path.write_text("".join(parts))
    return path


def test_a_skew_plane_is_flown_beside_a_thruster_out_of_it(tmp_path):
    """Both ways along each direction, by a linear programme of SciPy."""
    directions = pushed_directions(SKEW)
    np.testing.assert_allclose(np.array([-0.3, 0, 1]) @ directions, 0, atol=1e-12)
    bases = least_propellant(SKEW, np.ones(5), plane_map(SKEW, 2, any_plane=True))
    for command in (*np.eye(2), *-np.eye(2), np.array([1.0, -2.0])):
        wanted = directions @ command
        programme = linprog(np.ones(5), A_eq=SKEW, b_eq=wanted)
        duties = [basis @ command for basis in bases]
        made = [one for one in duties if one.min() > -1e-9]
        np.testing.assert_allclose(SKEW @ made[0], wanted, atol=1e-12)
        assert min(map(np.sum, made)) == pytest.approx(programme.fun, rel=1e-9)
    table = "[[thruster]]\ntorque_N_m = 0.01\ntorque_axis = "
    rows = "".join(f"{table}{column.tolist()}\n" for column in SKEW.T)
    scenario = load(_file(tmp_path, REST, INERTIA, rows, MODULATION), caution=print)
    assert build(scenario).loop is not None


def test_a_thruster_beside_wheels_that_make_all_does_not_forbid_a_law(tmp_path):
    wheel = "[[wheel]]\ntorque_limit_N_m = 0.02\naxis = "
    jet = "[[thruster]]\ntorque_axis = [0, 0, 1]\ntorque_N_m = 0.01\n"
    tables = (f"{wheel}[1, 0, 0]\n", f"{wheel}[0, 1, 0]\n", jet, MODULATION)
    scenario = load(_file(tmp_path, REST, INERTIA, *tables), caution=print)
    assert torque_limit(scenario) == pytest.approx(0.02)


BOTH = REST.replace('"three-slew"', '"quaternion-feedback"\nnatural_frequency_rad_s = 0.1')
SKEW_JET = (
    "[[thruster]]\ntorque_axis = [0.3, 0.1, 1]\ntorque_N_m = 0.1\ntwo_sided = true\n" + MODULATION
)


def test_wheels_and_thrusters_fly_axes_that_only_both_make(tmp_path):
    """The largest torque, and that of one command, by linear programmes of SciPy."""
    wheel = "[[wheel]]\ntorque_limit_N_m = 0.02\naxis = "
    tables = (f"{wheel}[1, 0, 0]\n", f"{wheel}[0, 1, 0]\n", SKEW_JET)
    scenario = load(_file(tmp_path, BOTH, INERTIA, *tables), caution=print)
    jet = 0.1 * np.array([0.3, 0.1, 1]) / np.sqrt(1.1)
    columns = np.stack([[1, 0, 0], [0, 1, 0], jet, -jet], axis=1)
    bounds = [(-0.02, 0.02)] * 2 + [(0, 1)] * 2

    def most(way):
        equal = np.column_stack([columns, -np.array(way)])
        found = linprog([0, 0, 0, 0, -1], A_eq=equal, b_eq=np.zeros(3), bounds=[*bounds, (0, None)])
        return -found.fun

    limit = torque_limit(scenario)
    assert limit is not None
    assert limit == pytest.approx(min(map(most, itertools.product((1, -1), repeat=3))), rel=1e-6)
    run = build(scenario)
    command = 0.9 * limit * np.array([1.0, -1.0, 1.0])
    assert isinstance(run.loop, SampledLoop)
    effectors = run.loop.plant.effectors
    zero = jnp.zeros(())
    shares = run.loop.distribution(zero, run.start, jnp.asarray(command), effectors)
    uses = dict(zip((one.kind for one in effectors), shares.uses, strict=True))
    np.testing.assert_allclose(np.cross(uses["thruster"], jet), 0, atol=1e-9)
    np.testing.assert_allclose(uses["wheel"] @ np.eye(2, 3) + uses["thruster"], command, atol=1e-9)
    assert shares.remainder is not None
    np.testing.assert_allclose(shares.remainder, 0, atol=1e-9)
    alone = "thrusters that the law can use with the wheels.* a torque along \\[0.0, 1.0, 0.0\\]"
    with pytest.raises(ScenarioError, match=alone):
        load(_file(tmp_path, BOTH, INERTIA, tables[0], SKEW_JET))


def test_rows_that_are_no_unit_vectors_are_refused_with_both_readings(tmp_path):
    rows = "thruster_torque_axes = [[0, 1, 0], [2, 0, 0]]\ntorque_limit_N_m = 0.01\n"
    both = "got length 2: .*write \\[1.*2 times torque_limit_N_m is a \\[\\[thruster"
    with pytest.raises(ScenarioError, match=both):
        load(_file(tmp_path, REST, INERTIA, rows), purpose="motion")


def test_check_names_the_commands_that_take_a_vehicle(tmp_path, capsys):
    rows = "thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\n"
    assert check(str(_file(tmp_path, INERTIA, rows))) == 0
    unlimited = "not for design: no law fits: three-slew: spacecraft.torque_limit_N_m must be given"
    assert unlimited in capsys.readouterr().out
    rows += "torque_limit_N_m = 0.01\n"
    assert check(str(_file(tmp_path, INERTIA, rows))) == 0
    assert "others: orbit, initial, control, simulation must" in capsys.readouterr().out
    assert check(str(_file(tmp_path, INERTIA, rows, "[orbit]\naltitude_km = 550\n"))) == 0
    printed = capsys.readouterr().out
    assert "valid for controllability and design" in printed
    assert "others: initial, control, simulation must" in printed
    start = "[initial]\nquaternion = [1, 0, 0, 0]\nomega_rad_s = [0, 0, 0]\n"
    assert check(str(_file(tmp_path, INERTIA, rows, "[orbit]\naltitude_km = 550\n", start))) == 0
    assert "others: control, simulation must" in capsys.readouterr().out
    assert check("two-wheel-telescope") == 0
    told = capsys.readouterr().out
    assert "not for montecarlo and tune: [dispersion] must be given, got nothing" in told
    assert "not for export" in told
    assert check("one-torque-damping") == 0
    assert "not for design: --law: must be given, as one-torque" in capsys.readouterr().out
    assert check(str(_file(tmp_path, REST.replace("period_s", "perid_s"), INERTIA, rows))) == 2


JETS = "".join(
    f"[[thruster]]\ntorque_axis = {axis}\ntorque_N_m = 0.01\nmin_on_time_s = 0.02\n"
    for axis in ("[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]")
)
GYROS = "".join(
    f"[[gimbal]]\naxis = [0, 0, 1]\nspin_axis = {axis}\nrotor_momentum_N_m_s = 1\n"
    "rate_limit_rad_s = 0.5\n"
    for axis in ("[1, 0, 0]", "[0, 1, 0]")
)


WHEEL = "[[wheel]]\naxis = [1, 0, 0]\ntorque_limit_N_m = 0.01\n"
ONE_ROW = "thruster_torque_axes = [[0, 1, 0]]\n"


@pytest.mark.parametrize(
    "tables",
    [("", JETS), ("", JETS, WHEEL), ("", GYROS), (REST, ONE_ROW, WHEEL)],
    ids=["one-sided", "one-sided with a wheel", "gyros", "a wheel and a thruster"],
)
def test_check_says_where_no_law_applies_as_controllability_and_design_do(tmp_path, tables, capsys):
    file = _file(tmp_path, tables[0], INERTIA, *tables[1:])
    assert check(str(file)) == 0
    printed = capsys.readouterr().out
    scenario = read_vehicle(file, caution=lambda text: None).scenario
    study = controllability_study(scenario)
    assert f"no law of jaxsat applies to the actuators left. {study.verdict[:60]}" in printed
    if scenario.gimbal:
        assert "valid for controllability (" in printed
        assert "not for design: gimbal must be omitted" in printed
        return
    lines = vehicle_verdict(scenario).lines()
    assert "Laws: no law of jaxsat applies." in lines
    assert not any("can be held" in line or "failures" in line for line in lines)


DIRECTIONS = ("[1,0,0.3]", "[-1,0,-0.3]", "[0,1,0]", "[0,-1,0]", "[0,0,1]", "[0,0,-1]")
AXES = ("[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]")
TOLERANT = REST.replace('"three-slew"', '"fault-tolerant"\nnatural_frequency_rad_s = 0.05')

TOLERANT_IN_ORBIT = TOLERANT.replace("rate_rad_s = 0.0", "altitude_km = 600")


def _some(table, keys, axes, working):
    failed = (f"failed = {str(number not in working).lower()}" for number in range(len(axes)))
    rows = (f"{keys}{axis}\n{gone}\n" for axis, gone in zip(axes, failed, strict=True))
    return "".join(f"[[{table}]]\n{row}" for row in rows)


def jets(*working):
    return _some("thruster", "torque_N_m = 0.01\ntorque_axis = ", DIRECTIONS, working)


def wheels(*working):
    return _some("wheel", "torque_limit_N_m = 0.005\naxis = ", AXES, working)


def rods(*working):
    return _some("magnetorquer", "dipole_limit_A_m2 = 1\naxis = ", AXES, working)


LEVEL = _some(
    "thruster",
    "torque_N_m = 0.01\ntorque_axis = ",
    ("[1,0,0]", "[-1,0,0]", "[0,1,0]", "[0,-1,0]"),
    range(4),
)
TURNING = "[[wheel]]\ntorque_limit_N_m = 0.005\nmomentum_N_m_s = 0.01\naxis = [1, 0, 0]\n"
BARE = {
    "a plane": jets(0, 1, 2, 3, 4),
    "a plane and no more": jets(0, 1, 2, 3),
    "a wedge": jets(0, 2, 4),
    "nothing": jets(),
    "a wedge, rods": jets(1, 3, 4) + rods(0, 1, 2),
    "one thruster, rods": jets(4) + rods(0, 1, 2),
    "one thruster, a rod": jets(4) + rods(2),
    "no thruster, rods": jets() + rods(0, 1, 2),
    "no thruster, two wheels": jets() + wheels(0, 1),
    "no thruster, a wheel": jets() + wheels(0),
    "no thruster, a wheel, rods": jets() + wheels(1) + rods(0, 1, 2),
    "a plane, a wheel": jets(0, 1, 2, 3) + wheels(2),
    "a plane, failed rods": jets(0, 1, 2, 3, 4) + rods(),
    "two wheels, a thruster": jets(4) + wheels(0, 1),
    "a level plane": LEVEL,
    "a level plane, failed wheels": LEVEL + wheels(),
    "a level plane, a wheel in it": LEVEL + wheels(0),
    "a level plane, a wheel in it, rods": LEVEL + wheels(0) + rods(0, 1, 2),
    "a level plane, a turning wheel in it": LEVEL + TURNING + "failed = false\n",
    "a level plane, a turning wheel in it, rods": LEVEL
    + TURNING
    + "failed = false\n"
    + rods(0, 1, 2),
    "a level plane, a failed turning wheel": LEVEL + TURNING + "failed = true\n",
}
"""Actuators, some of which had failed before the start."""


@pytest.mark.slow
@pytest.mark.parametrize("left", BARE)
def test_the_law_of_each_actuator_takes_what_is_left_where_controllability_names_it(left, tmp_path):
    """Its own check and the laws that fit agree, and what it takes it flies: one step at least."""
    path = _file(tmp_path, TOLERANT_IN_ORBIT, INERTIA, BARE[left], MODULATION)
    judgement = judge_scenario(load(path, purpose="motion"))
    flies = judgement.laws == "three torques" or "fault-tolerant" in FLYABLE[judgement.laws].laws
    try:
        run = build(load(path, caution=print))
    except ScenarioError:
        assert not flies
        return
    assert flies
    assert isinstance(run.loop, SampledLoop)
    law, start = run.loop.controller, run.loop.plant.complete(run.start)
    command, memory = interpreted(law.step, jnp.zeros(()), start, law.init(start))
    assert np.isfinite(command).all()
    assert int(law.mode(memory)) in FLYABLE[judgement.laws].modes
    run.loop.distribution(jnp.zeros(()), start, command, run.loop.plant.effectors)


@pytest.mark.slow
@pytest.mark.parametrize("beside", [wheels(), wheels(0)])
def test_thrusters_in_a_plane_fly_as_without_the_wheels_that_stay_idle(beside, tmp_path):
    """Duties from a tumble, with the rates that they cause.

    Momenta by tachometers add noise to the rate, by which a torque from outside is believed.
    """
    flights = []
    for tables in (LEVEL, LEVEL + beside):
        run = build(load(_file(tmp_path, TOLERANT, INERTIA, tables, MODULATION)))
        assert isinstance(run.loop, SampledLoop)
        law, state = run.loop.controller, run.loop.plant.complete(run.start)
        step, torque = by_machine_code(law.step), law.actuators[0].reconfiguration.torque
        inverse = law.healthy.model.spacecraft.inverse_inertia
        state = eqx.tree_at(lambda one: one.omega, state, jnp.array([0.01, -0.008, 0.006]))
        memory, told = law.init(state), []
        for sample in range(60):
            command, memory = step(law.period * jnp.asarray(float(sample)), state, memory)
            assert np.all(np.asarray(command)[4:] == 0)
            rate = state.omega + law.period * (inverse @ (torque @ command[:4]))
            state = eqx.tree_at(lambda one: one.omega, state, rate)
            told.append([*np.asarray(command)[:4], float(law.mode(memory))])
        flights.append(np.array(told))
    np.testing.assert_array_equal(flights[0][:, 4], flights[1][:, 4])
    np.testing.assert_allclose(*flights, rtol=0, atol=5e-4)
    assert np.abs(flights[0][:, :4]).max() > 0.1


def test_a_plane_that_cannot_be_steered_is_refused_as_under_the_laws_of_two_torques(tmp_path):
    even = INERTIA.replace("[1.0, 0.7, 0.5]", "[0.7, 0.7, 0.5]")
    for text in (TOLERANT, REST):
        with pytest.raises(ScenarioError, match=r"spacecraft.inertia_kg_m2.*S1 = 0.7"):
            load(_file(tmp_path, text, even, LEVEL, MODULATION))


@pytest.mark.parametrize("beside", ["", wheels(0, 1, 2), rods(0, 1, 2)])
def test_a_law_of_each_actuator_refuses_ideal_thrusters_once(beside, tmp_path):
    axes = "thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\n"
    with pytest.raises(ScenarioError) as caught:
        load(_file(tmp_path, TOLERANT_IN_ORBIT, INERTIA, axes, beside))
    (problem,) = caught.value.problems
    assert problem.key == "spacecraft.thruster_torque_axes"
    assert '"fault-tolerant", which commands each actuator (it takes [[thruster]])' in (
        problem.message
    )


TWO_SIDED = "".join(
    f"[[thruster]]\ntorque_axis = {axis}\ntorque_N_m = 0.01\nmin_on_time_s = 0.02\n"
    "two_sided = true\n"
    for axis in ("[1, 0, 0]", "[0, 1, 0]")
)
ROD = "[[magnetorquer]]\naxis = [0, 0, 1]\ndipole_limit_A_m2 = 0.2\n"
ROWS = "thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\ntorque_limit_N_m = 0.01\n"


@pytest.mark.parametrize(
    ("rows", "beside", "words"),
    [
        (ROWS, ROD, "magnetorquer"),
        (ROWS, GYROS.replace("rad_s = 0.5", "rad_s = 0.5\nfailed = true"), "gimbal"),
        (ROWS, "", ""),
        ("", f"{TWO_SIDED}{ROD}", ""),
    ],
)
def test_laws_that_do_not_take_an_actuator_are_not_said_to_apply(
    tmp_path, rows, beside, words, capsys
):
    file = _file(tmp_path, INERTIA, rows, "[orbit]\naltitude_km = 500\n", beside)
    assert check(str(file)) == 0
    without = f"no law of jaxsat applies beside [[{words}]]; without it the laws for two torques"
    assert (without in capsys.readouterr().out) == bool(words)
    scenario = read_vehicle(file, caution=lambda text: None).scenario
    assert any(without in line for line in controllability_study(scenario).findings) == bool(words)
    if words != "gimbal":
        assert any(without in line for line in vehicle_verdict(scenario).lines()) == bool(words)


def test_wheels_that_would_have_to_complete_ideal_torques_are_told(tmp_path, capsys):
    """An ideal thruster whose torque only a wheel could complete to one about x."""
    rows = "thruster_torque_axes = [[-0.8, 0.6, 0]]\ntorque_limit_N_m = 0.01\n"
    wheels = "".join(WHEEL.replace("[1, 0, 0]", axis) for axis in ("[0, 1, 0]", "[0, 0, 1]"))
    assert check(str(_file(tmp_path, INERTIA, rows, wheels))) == 0
    said = "no law of jaxsat applies, as wheels do not complete ideal torques; with tables"
    assert said in capsys.readouterr().out
    scenario = read_vehicle(tmp_path / "vehicle.toml", caution=lambda text: None).scenario
    assert any(said in line for line in controllability_study(scenario).findings)
    jets = "".join(
        f"[[thruster]]\ntorque_axis = {axis}\ntorque_N_m = 0.01\nmin_on_time_s = 0.02\n"
        for axis in ("[-0.8, 0.6, 0]", "[0.8, -0.6, 0]")
    )
    assert check(str(_file(tmp_path, INERTIA, jets, wheels))) == 0
    assert "no law" not in capsys.readouterr().out
