"""Keys that stand in place of others, against SciPy and against the scenario without them."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsat.core.attitude import Quaternion, euler_angles
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.scenario import ScenarioError, ScenarioWarning, dump, read
from jaxsat.scenario.parts.registry import TABLES, TYPES
from jaxsat.scenario.stand_ins import euler_quaternion, mrp_quaternion
from jaxsat.scenario.tables import EulerSequence

BASE = """
title = "stand-ins"
[spacecraft]
inertia_kg_m2 = [4.0, 3.0, 5.0]
{spacecraft}
[orbit]
rate_rad_s = 0.0
[initial]
{initial}
omega_rad_s = [0, 0, 0]
[control]
law = "quaternion-feedback"
period_s = 0.5
natural_frequency_rad_s = 0.1
[simulation]
duration_s = 10.0
{rest}
"""
WHEELS = """
[[wheel]]
axis = [1, 0, 0]
{one}
[[wheel]]
axis = [0, 1, 0]
[[wheel]]
axis = [0, 0, 1]
"""
THRUSTERS = """
[[thruster]]
position_m = {position}
direction = [0, 1, 0]
force_N = 2.0
[[panel]]
area_m2 = 1.0
normal = [1, 0, 0]
centre_m = {position}
"""


@pytest.fixture
def written(tmp_path):
    def write(*, initial="quaternion = [1, 0, 0, 0]", wheel="", spacecraft="", rest=""):
        path = tmp_path / "mine.toml"
        rest += WHEELS.format(one=wheel)
        path.write_text(BASE.format(initial=initial, spacecraft=spacecraft, rest=rest))
        return path

    return write


def mistakes(path, *overrides):
    with pytest.raises(ScenarioError) as caught:
        read(path, overrides)
    return str(caught.value).split("\n")


@pytest.mark.parametrize("sequence", EulerSequence.__args__)
def test_euler_angles_are_intrinsic(sequence):
    angles = [0.3, -1.1, 2.5]
    ours = np.array(euler_quaternion(angles, sequence))
    theirs = Rotation.from_euler(sequence.upper(), angles).as_quat(scalar_first=True)
    np.testing.assert_allclose(ours * np.sign(ours[0]), theirs * np.sign(theirs[0]), atol=1e-15)


def test_euler_angles_of_a_start_are_those_that_results_have():
    """Yaw, pitch and roll from the orbit to the body frame: C = C1(roll) C2(pitch) C3(yaw)."""
    yaw, pitch, roll = np.radians([40.0, -20.0, 10.0])
    quaternion = np.array(euler_quaternion([yaw, pitch, roll], "zyx"))
    np.testing.assert_allclose(euler_angles(quaternion), [10.0, -20.0, 40.0], rtol=1e-13)
    turned = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix().T
    np.testing.assert_allclose(Quaternion(quaternion).as_dcm().matrix, turned, atol=1e-15)


@pytest.mark.parametrize("parameters", [[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [1.0, 2.0, -0.5]])
def test_mrp_are_those_of_scipy(parameters):
    theirs = Rotation.from_mrp(parameters).as_quat(scalar_first=True)
    ours = np.array(mrp_quaternion(parameters))
    np.testing.assert_allclose(ours * np.sign(ours[0]), theirs * np.sign(theirs[0]), atol=1e-15)


def test_a_start_is_read_in_any_form(written):
    turn = math.sin(math.radians(15))
    path = written(initial='euler_deg = [30, 0, 0]\neuler_sequence = "xyz"')
    scenario = read(path)
    np.testing.assert_allclose(scenario.initial.quaternion, [math.cos(math.pi / 12), turn, 0, 0])
    assert "euler" not in dump(scenario)
    assert "centre_of_mass" not in dump(scenario)
    (path.parent / "again.toml").write_text(dump(scenario))
    assert read(path.parent / "again.toml") == scenario
    other = read(path, ["initial.euler_arcsec=[0, 0, 108000]"]).initial.quaternion
    np.testing.assert_allclose(other, [math.cos(math.pi / 12), 0, 0, turn])
    other = read(path, [f"initial.mrp=[0, {math.tan(math.pi / 24)}, 0]"]).initial.quaternion
    np.testing.assert_allclose(other, [math.cos(math.pi / 12), 0, turn, 0], atol=1e-15)
    assert read(path, ["initial.quaternion=[1,0,0,0]"]).initial.quaternion == (1, 0, 0, 0)


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        (
            "euler_deg = [30, 0, 0]",
            "initial.euler_sequence: must be given with euler_deg (read as euler_rad)",
        ),
        ('euler_sequence = "xyz"', "initial.euler_rad: must be given with euler_sequence"),
        (
            'euler_deg = [30, 0, 0]\neuler_sequence = "zyxx"',
            'mine.toml:10: key initial.euler_sequence: must be one of "xyz"',
        ),
        (
            'euler_deg = [30, 0]\neuler_sequence = "zyx"',
            "mine.toml:9: key initial.euler_deg: must have 3 entries in rad",
        ),
        ("mrp = [0, 0, 0]\nquaternion = [1, 0, 0, 0]", "mrp: must not be given with quaternion"),
        (
            'mrp = [0, 0, 0]\neuler_deg = [1, 0, 0]\neuler_sequence = "zyx"',
            "mine.toml:9: key initial.mrp: must not be given with euler_deg (read as euler_rad)",
        ),
        (
            "quaternion = [1, 0, 0, 0]\neuler_degs = [1, 0, 0]",
            "initial.euler_degs: must be one of the keys of [initial]",
        ),
        ("mrp = [inf, 0, 0]", "initial.mrp: must be a finite number, got inf as entry 1"),
    ],
)
def test_a_mistaken_start_is_told_by_what_was_written(written, initial, message):
    (found,) = mistakes(written(initial=initial))
    assert message in found


def test_what_is_wrong_with_the_quaternion_names_the_angles(written):
    turned = 'euler_deg = [180, 0, 0]\neuler_sequence = "xyz"'
    (found,) = mistakes(written(initial=turned), "simulation.attitude=wz")
    assert "mine.toml:9: key initial.euler_deg: must not be upside down" in found or (
        "--set simulation.attitude=wz: key initial.euler_deg: must not be upside down" in found
    )
    assert found.endswith("(read as quaternion)")


def test_speeds_of_wheels_become_momenta(written):
    wheel = "rotor_inertia_kg_m2 = 2e-3\nspeed_rpm = -600\nspeed_limit_rpm = 6000"
    (one, *_) = read(written(wheel=wheel)).wheel
    assert one.momentum_N_m_s == pytest.approx(-2e-3 * 20 * math.pi)
    assert one.momentum_limit_N_m_s == pytest.approx(2e-3 * 200 * math.pi)
    assert (one.speed_rad_s, one.speed_limit_rad_s) == (None, None)


@pytest.mark.parametrize(
    ("wheel", "message"),
    [
        ("speed_rpm = 6", "wheel.rotor_inertia_kg_m2: must be given in kg m² with speed_rpm"),
        (
            "speed_rpm = 6\nmomentum_N_m_s = 1\nrotor_inertia_kg_m2 = 1e-3",
            "key wheel.speed_rpm: must not be given with momentum_N_m_s, got",
        ),
        (
            "speed_rpm = 60\nspeed_limit_rpm = 30\nrotor_inertia_kg_m2 = 1e-3",
            "key wheel.speed_rpm: must not exceed speed_limit_rpm",
        ),
        (
            "speed_limit_rpm = 0\nrotor_inertia_kg_m2 = 1e-3",
            "key wheel.speed_limit_rpm: must be greater than 0",
        ),
    ],
)
def test_mistaken_speeds_are_told_by_what_was_written(written, wheel, message):
    (found,) = mistakes(written(wheel=wheel))
    assert message in found


def test_positions_are_from_the_centre_of_mass(written):
    """Torque (r - c) × f of a thruster at r: c = (0.1, 0, 0), r = (0.3, 0, 0), f = 2 N along y."""
    rest = "\n[disturbance]\nresidual_dipole_A_m2 = [0, 0, 0]"
    moved = THRUSTERS.format(position="[0.3, 0, 0.5]") + rest
    scenario = read(written(spacecraft="centre_of_mass_m = [0.1, 0, 0.5]", rest=moved))
    np.testing.assert_allclose(scenario.thruster[0].torque(), [0, 0, 0.4], atol=1e-15)
    np.testing.assert_allclose(scenario.panel[0].centre_m, [0.2, 0, 0], atol=1e-15)
    assert scenario.spacecraft.centre_of_mass_m is None
    again = read(written(rest=THRUSTERS.format(position=list(scenario.panel[0].centre_m)) + rest))
    assert again == scenario
    drag = "\n[disturbance]\nsolar_centre_m = [0.1, 0.2, 0.3]"
    one = read(written(spacecraft="centre_of_mass_m = [0.1, 0.1, 0.1]", rest=drag)).disturbance
    np.testing.assert_allclose(one.solar_centre_m, [0, 0.1, 0.2], atol=1e-15)
    assert one.drag_centre_m == (0, 0, 0)


def test_a_centre_of_mass_without_positions_is_likely_a_mistake(written):
    with pytest.warns(ScenarioWarning, match=r"key spacecraft.centre_of_mass_m: should be given w"):
        read(written(spacecraft="centre_of_mass_m = [0.1, 0, 0.5]"))


@pytest.mark.parametrize("name", ["initial", "spacecraft", "disturbance", "wheel", "thruster"])
@pytest.mark.parametrize("value", ["3", "[]", "[1]", "[[1]]", "{x = 1}", "[{x = 1}]"])
def test_what_is_no_table_is_told_and_not_converted(tmp_path, name, value):
    path = tmp_path / "mine.toml"
    path.write_text(f"title = 'x'\n{name} = {value}\n")
    assert all(": must " in line for line in mistakes(path))


TYPED = """
[thruster_type.cold-gas]
force_N = {force}
min_on_time_s = 0.02
specific_impulse_s = 70
[[thruster]]
type = "cold-gas"
position_m = [0.1, 0, 0]
direction = [0, 1, 0]
[[thruster]]
type = "cold-gas"
position_m = [-0.1, 0, 0]
direction = [0, 1, 0]
min_on_time_s = 0.05
[gimbal_type.small]
rotor_momentum_N_m_s = 1.0
rate_limit_deg_s = 30
[[gimbal]]
type = "small"
axis = [1, 0, 0]
spin_axis = [0, 1, 0]
"""


def test_devices_have_the_keys_of_their_type(written):
    scenario = read(written(rest=TYPED.format(force=0.5)))
    one, two = scenario.thruster
    assert (one.force_N, one.min_on_time_s, one.specific_impulse_s) == (0.5, 0.02, 70)
    assert (two.force_N, two.min_on_time_s, two.position_m) == (0.5, 0.05, (-0.1, 0, 0))
    assert scenario.gimbal[0].rate_limit_rad_s == math.radians(30)
    other = read(written(rest=TYPED.format(force=3)), ["thruster_type.cold-gas.force_N=0.5"])
    assert other == scenario
    again = written().with_name("again.toml")
    again.write_text(dump(scenario))
    assert "type" not in dump(scenario)
    assert read(again) == scenario


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.5\n", "-0.5\n", "19: key thruster_type.cold-gas.force_N: must be at least 1e-09 N"),
        ("specific_", "specfic_", "21: key thruster_type.cold-gas.specfic_impulse_s: must be one"),
        ("30\n", "-30\n", "33: key gimbal_type.small.rate_limit_deg_s: must be at least"),
        ("_s = 0.02", "_s = 0.9", "20: key thruster_type.cold-gas.min_on_time_s: must be at most"),
        (
            '"cold-gas"\nposition_m = [0.1',
            '"cold_gas"\nposition_m = [0.1',
            'must be one of cold-gas, got "cold_gas", did you mean cold-gas?',
        ),
    ],
)
def test_mistakes_in_a_type_are_told_once_where_they_are(written, old, new, message):
    (found,) = mistakes(written(rest=changed(old, new)))
    assert message in found


def test_a_message_names_a_key_of_a_type_as_it_is_written(written):
    """A wheel holds more than its type lets it, which is given as momentum or as speed."""
    for limit, told in (
        ("momentum_limit_N_m_s = 50", "must not exceed momentum_limit_N_m_s = 50.0, got 67.0"),
        ("speed_limit_rpm = 60", "must not exceed speed_limit_rpm (read as momentum_limit_N_m_s)"),
    ):
        text = f"[wheel_type.big]\nrotor_inertia_kg_m2 = 1.0\ntorque_limit_N_m = 1\n{limit}\n"
        text += "[[wheel]]\ntype = 'big'\naxis = [1, 0, 0]\nmomentum_N_m_s = 67\n"
        assert sum(told in one for one in mistakes(written(rest=text))) == 1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type = "small"', "type = 3", "key gimbal.type: must be text in quotes, got 3"),
        ("[gimbal_type.small]", "[gimbal_typ.small]", "did you mean gimbal_type?"),
    ],
)
def test_a_device_without_its_type_lacks_keys_as_well(written, old, new, message):
    found = mistakes(written(rest=changed(old, new)))
    assert [message in line for line in found].count(True) == 1
    assert "key gimbal.rate_limit_rad_s: must be given in rad/s, got nothing" in "".join(found)


def changed(old, new):
    text = TYPED.format(force=0.5)
    assert text.count(old) == 1
    return text.replace(old, new)


def test_every_actuator_has_types_of_all_that_its_devices_share():
    for name, table in TABLES.items():
        shared = TYPES[f"{name}_type"].model_fields
        own = {"name", "type"} | ({"failed"} if name in {one.name for one in ACTUATORS} else set())
        assert table.model_fields.keys() - shared.keys() == own
        assert not [key for key, field in shared.items() if field.is_required()]
        units = {key: field.json_schema_extra for key, field in shared.items()}
        assert units == {key: table.model_fields[key].json_schema_extra for key in shared}
