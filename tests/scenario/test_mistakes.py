"""Broken scenario files: every mistake is told, with its line and its key."""

import re
import warnings

import pytest

from jaxsat.core.errors import ArgumentError
from jaxsat.scenario import ScenarioError, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.store.folder import OutputFolder
from scenario.mistakes import SWITCHING, THREE_AXIS, check, problems_of

# text to replace, its replacement, then for each mistake: line, key, part of the message
BROKEN = [
    ('title = "Test"', "title = 3", [(1, "title", "must be text in quotes, got 3")]),
    ('title = "Test"', 'title = ""', [(1, "title", "must not be empty")]),
    ('title = "Test"\n', "", [(1, "title", "must be given")]),
    ('title = "Test"', 'titel = "x"', [
        (1, "titel", "did you mean title?"), (1, "title", "must be given")]),
    ('title = "Test"', 'title = "Test"\nseed = 3', [
        (2, "seed", "did you mean simulation.seed?")]),
    ('title = "Test"', 'title = "Test"\ntorque_limit_N_m = 3', [
        (2, "torque_limit_N_m", "did you mean spacecraft.torque_limit_N_m or wheel.torque_limit")]),
    ('title = "Test"', 'title = "Test"\nname = "x"', [(2, "name", 'got "name"')]),
    ("[spacecraft]", "[spacecraft]\ncolour = 1", [
        (3, "spacecraft.colour", "must be one of the keys of [spacecraft] (inertia_kg_m2,")]),
    ("[449.5, 264.6, 312.5]", "[449.5, 264.6]", [
        (3, "spacecraft.inertia_kg_m2", "must have 3 entries in kg m², got [449.5, 264.6]")]),
    ("[449.5, 264.6, 312.5]", "[449.5, 264.6, -312.5]", [
        (3, "spacecraft.inertia_kg_m2", "must be positive definite")]),
    ("[449.5, 264.6, 312.5]", "[[449.5, 1, 0],\n [0, 264.6, 0],\n [0, 0, 312.5]]", [
        (3, "spacecraft.inertia_kg_m2", "must be symmetric")]),
    ("[449.5, 264.6, 312.5]", "[[449.5, 1, 0],\n [0, nan, 0],\n [0, 0, 312.5]]", [
        (4, "spacecraft.inertia_kg_m2", "a finite number in kg m², got nan as entry 2 of row 2")]),
    ("[449.5, 264.6, 312.5]", '"heavy"', [
        (3, "spacecraft.inertia_kg_m2", 'must be a list in kg m², got "heavy"')]),
    ("inertia_kg_m2 = ", "inertia = ", [
        (3, "spacecraft.inertia", "did you mean inertia_kg_m2?"),
        (2, "spacecraft.inertia_kg_m2", "must be given in kg m²")]),
    ("  [0, 1, 0],", "  [0, 1],", [
        (6, "spacecraft.thruster_torque_axes", "must have 3 entries, got [0, 1] as entry 2")]),
    ("  [0, 1, 0],", '  [0, "up", 0],', [
        (6, "spacecraft.thruster_torque_axes", 'must be a number, got "up" as entry 2 of row 2')]),
    ("  [0, 1, 0],", "  [0, 0, 0],", [
        (4, "spacecraft.thruster_torque_axes", "in every row, got a zero row as row 2")]),
    ("  [0, 1, 0],", "  [0, 1e-200, 0],", [
        (4, "spacecraft.thruster_torque_axes", "got one that is none as row 2")]),
    ("  [0, 1, 0],", "  [1, 0, 0],", [
        (9, "spacecraft.failed_thrusters", "independent torques about body axes x and y")]),
    ("failed_thrusters = [3]", "failed_thrusters = [4]", [
        (9, "spacecraft.failed_thrusters", "must name thrusters from 1 to 3, got 4")]),
    ("failed_thrusters = [3]", "failed_thrusters = [3, 0]", [
        (9, "spacecraft.failed_thrusters", "must be at least 1, got 0 as entry 2")]),
    ("failed_thrusters = [3]", "failed_thrusters = [3,\n3]", [
        (10, "spacecraft.failed_thrusters", "must name each thruster once, got 3 again")]),
    ("failed_thrusters = [3]", "failed_thrusters = [1.5]", [
        (9, "spacecraft.failed_thrusters", "must be a whole number, got 1.5")]),
    ("failed_thrusters = [3]", "failed_thrusters = [3]\ntorque_limit_N_m = -5", [
        (10, "spacecraft.torque_limit_N_m", "must be at least 1e-09 N m, got -5")]),
    ('"held"', '"hold"', [
        (10, "spacecraft.third_rate", '"free", "held", got "hold", did you mean held?')]),
    ("rate_rad_s = 0.0011\n[dist", "[dist", [
        (11, "orbit.rate_rad_s",
         "must be given in rad/s, or altitude_km or perigee_altitude_km, got none of them")]),
    ("rate_rad_s = 0.0011\n[dist", "rate_rad_s = 0.0011\naltitude_km = 400\n[dist", [
        (13, "orbit.altitude_km", "must not be given with rate_rad_s, got 400")]),
    ("rate_rad_s = 0.0011\n[dist", "rate_rad_s = inf\n[dist", [
        (12, "orbit.rate_rad_s", "must be a finite number in rad/s, got inf")]),
    ("rate_rad_s = 0.0011\n[dist", 'rate_rad_s = 0.0011\nrelation = "small angle"\n[dist', [
        (13, "orbit.relation", "did you mean small-angle?")]),
    ("frequency_rad_s = [0.7, 0.8, 0.1]", "frequency_rad_s = [0.7, true, 0.1]", [
        (14, "disturbance.frequency_rad_s", "must be a number in rad/s, got true as entry 2")]),
    ("frequency_rad_s = [0.7, 0.8, 0.1]", "gravity_gradient = 1", [
        (14, "disturbance.gravity_gradient", "must be true or false, got 1"),
        (19, "control.internal_model_frequency_rad_s", "must be given in rad/s")]),
    ("w = [-1.0, 1.0]\n", "", [(15, "initial.w", "must be given with z_rad")]),
    ("z_rad = 1.27\n", "", [(15, "initial.z_rad", "must be given with w, got nothing")]),
    ("w = [-1.0, 1.0]\nz_rad = 1.27\n", "", [
        (15, "initial.w", "must be given with z_rad, or quaternion, euler_rad or mrp, got none")]),
    ("z_rad = 1.27", "z_rad = 1.27\nquaternion = [1, 0, 0, 0]", [
        (16, "initial.w", "must not be given with quaternion, got [-1.0, 1.0]"),
        (17, "initial.z_rad", "must not be given with quaternion, got 1.27")]),
    ("w = [-1.0, 1.0]\nz_rad = 1.27", "quaternion = [1, 0, 0, 0.1]", [
        (16, "initial.quaternion", "unit length to 1e-6, got length 1.00498756; divide")]),
    ("w = [-1.0, 1.0]\nz_rad = 1.27", "quaternion = [0, 1, 0, 0]", [
        (16, "initial.quaternion", "must not be upside down")]),
    ("w = [-1.0, 1.0]", "w = [1e7, 1.0]", [(16, "initial.w", "is upside down")]),
    ("[0.1, -0.11, 0.0]", "[0.1, -0.11, 0.01]", [
        (18, "initial.omega_rad_s", "must have 0 rad/s as entry 3 while spacecraft.third_rate")]),
    ("omega_rad_s = ", "omega_rads = ", [
        (18, "initial.omega_rads", "did you mean omega_rad_s?"),
        (15, "initial.omega_rad_s", "must be given in rad/s")]),
    ('law = "three-axis"', 'law = "three axis"', [
        (20, "control.law", "did you mean three-axis?")]),
    ('law = "three-axis"\n', "", [(19, "control.law", "must be one of")]),
    ('law = "three-axis"', 'law = "coast"', [
        (21, "control.k3", '(a key of the law "three-axis", "switching", "oscillatory", "three-'),
        (22, "control.mu", "got"), (23, "control.a", "got"), (24, "control.k4", "got"),
        (25, "control.model", "got")]),
    ("k3 = 0.05", "k3 = 0", [(21, "control.k3", "must be greater than 0 1/s, got 0")]),
    ("k3 = 0.05\n", "", [(19, "control.k3", "must be given in 1/s, got nothing")]),
    ("k4 = 0.01", "k4 = [0.01, -1]", [
        (24, "control.k4", "must be greater than 0 N m s, got -1 as entry 2")]),
    ("k4 = 0.01", "k4 = [0.01, 1, 2]", [
        (24, "control.k4", "must have 2 entries in N m s, got [0.01, 1, 2]")]),
    ("k4 = 0.01", "k4 = 0.01\nsaturation_width = 1.5", [
        (25, "control.saturation_width", "must be at most 1, got 1.5")]),
    ("k4 = 0.01", "k4 = 0.01\ninternal_model_frequency_rad_s = [0.7, 0]", [
        (25, "control.internal_model_frequency_rad_s", "must be at least 1e-09 rad/s")]),
    ("k4 = 0.01", "k4 = 0.01\nmeasured_disturbance = [true, false]", [
        (25, "control.measured_disturbance", "must have 3 entries")]),
    ("orbit_rate_rad_s = 0.0011", "orbit_rat = 0.0011", [
        (26, "control.model.orbit_rat", "did you mean orbit_rate_rad_s?")]),
    ("duration_s = 500.0", "duration_s = 500.3", [
        (28, "simulation.duration_s", "must be a multiple of save_every_s = 0.5, got 500.3")]),
    ('steps = "adaptive"', 'steps = "adaptive"\n[settled]\ndwell_s = 500.0', [
        (33, "settled.dwell_s", "must be below simulation.duration_s = 500.0, got 500.0")]),
    ("duration_s = 500.0", "duration_s = -inf", [
        (28, "simulation.duration_s", "must be a finite number in s, got -inf")]),
    ("duration_s = 500.0", "duration_s = 5e6", [
        (29, "simulation.save_every_s", "at most 2000000 saved samples")]),
    ("duration_s = 500.0", "duration_s = 1e9", [
        (28, "simulation.duration_s", "must be at most 1e+08 s, got 1000000000.0")]),
    ("save_every_s = 0.5", "save_every_s = 0", [
        (29, "simulation.save_every_s", "must be at least 1e-06 s, got 0")]),
    ("save_every_s = 0.5", 'coordinates = "error"\nattitude = "euler"', [
        (30, "simulation.attitude", 'must be one of "wz", "quaternion", got "euler"')]),
    ("save_every_s = 0.5", "seed = 1.0", [
        (29, "simulation.seed", "must be a whole number, got 1.0")]),
    ('steps = "adaptive"', 'steps = "adaptive"\nrtol = 0', [
        (32, "simulation.solver.rtol", "must be greater than 0, got 0")]),
    ('steps = "adaptive"', 'steps = "adaptive"\nstep_s = 0.1', [
        (32, "simulation.solver.step_s", "must be left out because the steps are adaptive")]),
    ('steps = "adaptive"', 'steps = "fixed"\nrtol = 1e-3', [
        (32, "simulation.solver.rtol", "must be left out because the steps are fixed"),
        (30, "simulation.solver.step_s", "must be given in s with fixed steps")]),
    ('steps = "adaptive"', "substeps = 4", [
        (31, "simulation.solver.substeps", 'because the law "three-axis" is continuous')]),
    ('steps = "adaptive"', 'name = "euler"', [
        (31, "simulation.solver.name", "must be a solver with an error estimate")]),
    ('steps = "adaptive"', 'name = "rk4"', [(31, "simulation.solver.name", '"dopri8", got "rk4"')]),
    ("[simulation.solver]", "[simulaton.solver]", [
        (30, "simulaton", "did you mean simulation?")]),
    ("[orbit]\nrate_rad_s = 0.0011\n", "", [(1, "orbit", "must be given, got nothing")]),
    ("[orbit]\n", "[[orbit]]\n", [(11, "orbit", "must be a table")]),
]  # fmt: skip

BROKEN_SWITCHING = [
    ("torque_limit_N_m = 5\n", "", [
        (10, "control.rate_slope_limit_rad_s2", "must be given in rad/s²"),
        (10, "control.three_axis_slope_limit_rad_s2", "must be given in rad/s²")]),
    ("lower_threshold_rad_s = 1e-3", "lower_threshold_rad_s = 1e-2", [
        (21, "control.lower_threshold_rad_s", "must not exceed upper_threshold_rad_s = 0.008")]),
    ("period_s = 0.1", "period_s = 0.3", [(23, "simulation.save_every_s", "control.period_s")]),
    ("period_s = 0.1", "period_s = 1e-6", [(22, "control.period_s", "steps in a run, got")]),
    ("period_s = 0.1", "period_s = 1e-9", [(22, "control.period_s", "at least 1e-06 s")]),
    ("duration_s = 100", "duration_s = 100\nsolver = { steps = \"fixed\" }", [
        (25, "simulation.solver.steps", "is sampled and takes `substeps`")]),
    ("quaternion = [1, 0, 0, 0]", "quaternion = [0, 0.6, 0.8, 0]", [
        (9, "initial.quaternion", 'control.law = "switching" works in are singular')]),
    ("altitude_km = 400", "altitude_km = 400\nrate_rad_s = 0.001", [
        (7, "orbit.altitude_km", "must not be given with rate_rad_s")]),
    ("internal_model = false", "", [
        (11, "control.internal_model_frequency_rad_s", "must be given in rad/s")]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), BROKEN)
def test_mistake(old, new, expected, tmp_path):
    check(THREE_AXIS, old, new, expected, tmp_path)


@pytest.mark.parametrize(("old", "new", "expected"), BROKEN_SWITCHING)
def test_mistake_in_a_sampled_loop(old, new, expected, tmp_path):
    check(SWITCHING, old, new, expected, tmp_path)


@pytest.mark.parametrize("base", [THREE_AXIS, SWITCHING])
def test_bases_are_sound(base, tmp_path):
    path = tmp_path / "sound.toml"
    path.write_text(base, encoding="utf-8")
    load(path)


@pytest.mark.parametrize(
    "override",
    [
        'title="two\\nlines"',
        "spacecraft.inertia_kg_m2=[1, 2, -3]",
        "spacecraft.thruster_torque_axes=[[0, 0, 0], [0, 1, 0]]",
        "initial.quaternion=[1, 1, 0, 0]",
        "dispersion.omega_rad_s={distribution='uniform', low=2, high=1}",
        "dispersion.omega_rad_s={distribution='uniform', low=2}",
        "tuning={optimiser='no such'}",
    ],
)
def test_what_is_told_does_not_depend_on_the_text_of_an_error(override, monkeypatch):
    def told():
        with pytest.raises(ScenarioError) as caught:
            load("switching", [override], purpose="study")
        return caught.value.problems

    before = told()
    monkeypatch.setattr(ArgumentError, "__str__", lambda self: "another text")
    assert told() == before


def test_every_mistake_is_told_at_once(tmp_path):
    text = (
        THREE_AXIS.replace("449.5", "-1")
        .replace('"held"', '"hold"')
        .replace("[-1.0, 1.0]", "[nan, 1.0]")
        .replace("k3 = 0.05", "k33 = 0.05")
        .replace("500.0", "500.3")
    )
    found = [(problem.line, problem.key) for problem in problems_of(text, tmp_path)]
    assert found == [
        (3, "spacecraft.inertia_kg_m2"),
        (10, "spacecraft.third_rate"),
        (16, "initial.w"),
        (19, "control.k3"),
        (21, "control.k33"),
        (28, "simulation.duration_s"),
    ]


def test_fixed_steps_are_refused_where_the_torque_jumps(tmp_path):
    limited = THREE_AXIS.replace(
        "failed_thrusters = [3]", "failed_thrusters = [3]\ntorque_limit_N_m = 5"
    )
    text = limited.replace('steps = "adaptive"', 'steps = "fixed"\nstep_s = 0.01')
    (problem,) = problems_of(text, tmp_path)
    assert (problem.line, problem.key) == (32, "simulation.solver.steps")
    assert "derivative of a saturation that jumps" in problem.message
    smooth = text.replace("k4 = 0.01", "k4 = 0.01\nsaturation_width = 1\ntilt_width = 0.01")
    path = tmp_path / "smooth.toml"
    path.write_text(smooth, encoding="utf-8")
    load(path)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (["spacecraft.torque_limit_N_m=5"], "the torque is limited"),
        (["spacecraft.inertia_kg_m2=[[4,1,0],[1,4,0],[0,0,5]]"], "not principal axes"),
        (["spacecraft.thruster_torque_axes=[[0.6,0,0.8],[0,1,0],[0,0,1]]"], "x and y alone"),
        (["control.model.inertia_kg_m2=[449,264,312]"], "model differs from the plant"),
        (["control.model.orbit_relation=exact"], "model differs from the plant"),
        (["control.model.orbit_rate_rad_s=0.001"], "model differs from the plant"),
        (["control.law=coast"], 'the law is "coast"'),
    ],
)
def test_error_coordinates_only_where_they_hold(changes, reason):
    with pytest.raises(ScenarioError, match=re.escape(reason)):
        load("paper-three-axis", ["simulation.coordinates=error", *changes])
    load("paper-three-axis", changes)


def test_what_is_odd_but_allowed_is_a_warning(tmp_path):
    path = tmp_path / "odd.toml"
    path.write_text(THREE_AXIS.replace("449.5", "600"), encoding="utf-8")
    with pytest.warns(ScenarioWarning, match=r"odd\.toml:3: key spacecraft\.inertia_kg_m2: should"):
        load(path)
    with pytest.warns(ScenarioWarning, match="J1 apart from J2"):
        load("paper-rate", ["spacecraft.inertia_kg_m2=[300, 300, 312.5]"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load("paper-rate")


def test_a_part_of_a_key_of_the_table_itself_is_taken_for_that_key(tmp_path):
    """And not for the key of the same name of another table: a wheel has `momentum_N_m_s`."""
    text = THREE_AXIS.replace("[orbit]", "[[gimbal]]\nmomentum_N_m_s = 1\n[orbit]")
    messages = {one.key: one.message for one in problems_of(text, tmp_path)}
    assert messages["gimbal.momentum_N_m_s"].endswith("did you mean rotor_momentum_N_m_s?")


def test_a_scenario_of_a_folder_of_results_that_was_changed_is_told(tmp_path):
    """A user may change it, but not by mistake; what jaxsat did not write there is the user's."""
    file = tmp_path / "run" / "tuned.toml"
    with OutputFolder(file.parent) as folder:
        folder.write(file.name, THREE_AXIS)
    (file.parent / "own.toml").write_text(THREE_AXIS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(file)
        load(file.parent / "own.toml")
    file.write_text(THREE_AXIS.replace('"Test"', '"Other"'))
    with pytest.warns(ScenarioWarning, match=r"tuned\.toml was damaged, or changed, since jaxsat"):
        load(file)
