"""What the analysis calls flyable is built, and what `check` passes is told apart by command."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from jaxsat.cli.scenarios import check
from jaxsat.core.allocation import least_propellant, plane_map, pushed_directions
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.derived import torque_limit
from jaxsat.simulation.sampled_loop import SampledLoop

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
    assert shares.left is not None
    np.testing.assert_allclose(shares.left, 0, atol=1e-9)
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
    assert "others: orbit, initial, control, simulation must" in capsys.readouterr().out
    assert check(str(_file(tmp_path, INERTIA, rows, "[orbit]\naltitude_km = 550\n"))) == 0
    printed = capsys.readouterr().out
    assert "valid for controllability and design" in printed
    assert "others: initial, control, simulation must" in printed
    assert check("two-wheel-telescope") == 0
    told = capsys.readouterr().out
    assert "not for montecarlo and tune: [dispersion] must be given, got nothing" in told
    assert "not for export" in told
    assert check("one-torque-damping") == 0
    assert "not for design: --law: must be given, as one-torque" in capsys.readouterr().out
    assert check(str(_file(tmp_path, REST.replace("period_s", "perid_s"), INERTIA, rows))) == 2
