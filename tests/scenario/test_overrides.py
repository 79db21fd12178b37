"""`--set KEY=VALUE`: applied before the checks, and named in their messages."""

import pytest

from jaxsat.core.text import clean
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load


def problems(name, *overrides):
    with pytest.raises(ScenarioError) as caught:
        load(name, overrides)
    return [str(problem) for problem in caught.value.problems]


def test_values_are_toml_values_or_bare_text():
    scenario = load(
        "paper-three-axis",
        [
            "control.k3=0.07",
            "control.k4 = [0.01, 0.02]",
            "control.internal_model=false",
            "spacecraft.third_rate=free",
            'simulation.coordinates="torque"',
            "title=Two words = three",
            '"simulation"."seed"=7',
        ],
    )
    assert scenario.control.k3 == 0.07
    assert scenario.control.k4 == (0.01, 0.02)
    assert scenario.control.internal_model is False
    assert scenario.spacecraft.third_rate == "free"
    assert scenario.simulation.coordinates == "torque"
    assert scenario.title == "Two words = three"
    assert scenario.simulation.seed == 7


def test_later_overrides_win():
    assert load("paper-rate", ["control.k1=1", "control.k1=2"]).control.k1 == 2


def test_tables_that_do_not_exist_are_made():
    scenario = load("paper-rate", ["control.model.orbit_rate_rad_s=0.001"])
    assert scenario.control.model.orbit_rate_rad_s == 0.001


def test_a_whole_table_can_be_set():
    assert load("paper-rate", ['control={law="coast"}']).control.law == "coast"


def test_another_law_displaces_the_gains_of_the_law_before():
    scenario = load("paper-three-axis", ["control.law=rate", "control.k1=1", "control.k2=2"])
    assert (scenario.control.law, scenario.control.k1) == ("rate", 1)
    assert load("switching", ["control.law=coast"]).control.law == "coast"


def test_another_law_needs_its_own_gains():
    assert problems("paper-three-axis", "control.law=rate", "control.k1=1") == [
        "--set control.law=rate: key control.k2: must be given in 1/s, got nothing"
    ]


def test_a_gain_that_the_new_law_lacks_is_still_refused_when_set_by_hand():
    (found,) = problems("paper-three-axis", "control.law=coast", "control.k3=1")
    assert found.startswith("--set control.k3=1: key control.k3: must be one of the keys")


def test_one_form_displaces_the_other():
    scenario = load("paper-rate", ["orbit.altitude_km=400"])
    assert (scenario.orbit.rate_rad_s, scenario.orbit.altitude_km) == (None, 400)
    scenario = load("paper-rate", ["initial.quaternion=[1,0,0,0]"])
    assert (scenario.initial.w, scenario.initial.z_rad) == (None, None)
    scenario = load("rods-only", ["orbit.epoch=2025-06-01T12:00:00"])
    assert (scenario.orbit.sidereal_angle_rad, scenario.orbit.epoch) == (0.0, "2025-06-01T12:00:00")
    scenario = load("free-third-rate", ["simulation.solver.step_s=0.01"])
    assert scenario.simulation.solver.rtol is None
    scenario = load("free-third-rate", ["simulation.solver.steps=fixed",
                                        "simulation.solver.step_s=0.01"])  # fmt: skip
    assert (scenario.simulation.solver.steps, scenario.simulation.solver.step_s) == ("fixed", 0.01)


def test_both_forms_by_hand_still_exclude_each_other():
    (found,) = problems("paper-rate", "orbit.altitude_km=400", "orbit.rate_rad_s=0.001")
    assert "key orbit.altitude_km: must not be given with rate_rad_s" in found


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("control.k1", 'must have the form KEY=VALUE with a dotted key, got "control.k1"'),
        ("=3", "must have the form KEY=VALUE"),
        ("control..k1=3", "must have the form KEY=VALUE"),
        ("a b=3", "must have the form KEY=VALUE"),
        ("x=1\ny=2", "key x: must be one of the keys of the scenario"),
        ("control.k1=-1", "key control.k1: must be greater than 0 √(rad/s), got -1"),
        ("control.k1=fast", 'key control.k1: must be a number in √(rad/s), got "fast"'),
        ("control.k1=true", "key control.k1: must be a number in √(rad/s), got true"),
        ("control.k1=nan", "key control.k1: must be a finite number in √(rad/s), got nan"),
        ("control.k11=1", "did you mean k1?"),
        ("contrl.k1=1", "key contrl: must be one of the keys of the scenario"),
        ("title.x=1", "key title.x: must name a key inside a table, got title, which is none"),
        ("control=3", "key control: must be a table, got 3"),
        ("control.law=three", "did you mean three-axis?"),
        ("spacecraft.failed_thrusters=[2,3]", "independent torques"),
        ("simulation.save_every_s=0.3", "key simulation.duration_s: must be a multiple"),
        ("initial.omega_rad_s=[1,2]", "must have 3 entries in rad/s, got [1, 2]"),
        ("control.model.inertia_kg_m2=[1,2]", "must have 3 entries in kg m²"),
    ],
)
def test_mistakes_name_the_option(override, message):
    (found,) = problems("paper-rate", override)
    assert found.startswith(f"--set {clean(override)}: ")
    assert message in found


def test_all_mistakes_of_options_and_file_at_once(tmp_path):
    path = tmp_path / "file.toml"
    path.write_text('title = ""\n', encoding="utf-8")
    found = problems(str(path), "orbit=3", "bad", "seed=1")
    assert len(found) == 8
    assert sum(line.startswith("--set ") for line in found) == 3
    assert sum(line.startswith(f"{path}:1: ") for line in found) == 5
