"""Units besides those of SI: the same scenario, messages about the written key, the schema."""

import math

import pytest

from jaxsat.core.declaration.keys import number
from jaxsat.scenario import ScenarioError, dump, json_schema, library, read
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.registry import TABLES
from jaxsat.scenario.units import UNITS, Conversion, spellings

BASE = """
title = "degrees"
[spacecraft]
inertia_kg_m2 = [400.0, 300.0, 500.0]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
[orbit]
{orbit}
[initial]
w = [0.1, 0.2]
{initial}
[control]
law = "coast"
[simulation]
duration_s = 10.0
[dispersion.{omega}]
distribution = "uniform"
low = {low}
high = [{high}, {high}, {high}]
[dispersion.{delay}]
distribution = "discrete"
values = [{high}, {low}]
weights = [1.0, 3.0]
"""
DEGREES = {
    "orbit": "rate_deg_s = 0.06",
    "initial": "z_deg = 30\nomega_deg_s = [1, -2.5, 0]",
    "omega": "omega_deg_s",
    "delay": "turn_deg",
    "low": -2.0,
    "high": 3.0,
}
RADIANS = {
    "orbit": f"rate_rad_s = {math.radians(0.06)!r}",
    "initial": f"z_rad = {math.radians(30)!r}\n"
    f"omega_rad_s = [{math.radians(1)!r}, {math.radians(-2.5)!r}, 0.0]",
    "omega": "omega_rad_s",
    "delay": "turn_rad",
    "low": math.radians(-2.0),
    "high": math.radians(3.0),
}


def written(tmp_path, **changes):
    path = tmp_path / "mine.toml"
    path.write_text(BASE.format(**{**DEGREES, **changes}))
    return path


def mistakes(path, *overrides):
    with pytest.raises(ScenarioError) as caught:
        read(path, overrides)
    return str(caught.value)


def test_a_file_in_degrees_is_the_one_in_radians(tmp_path):
    assert read(written(tmp_path)) == read(written(tmp_path, **RADIANS))
    assert "deg" not in dump(read(written(tmp_path, title="x"))).replace('"degrees"', "")


def test_both_spellings_are_refused_with_key_and_line(tmp_path):
    text = mistakes(written(tmp_path, initial="z_rad = 0.5\nz_deg = 30\nomega_deg_s = [1, 1, 1]"))
    assert "mine.toml:11: key initial.z_deg: must not be given with z_rad, got 30" in text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"initial": "z_deg = 30\nomega_deg_s = [1, 2]"},
            "mine.toml:11: key initial.omega_deg_s: must have 3",
        ),
        (
            {"initial": "z_deg = 30\nomega_deg_s = [1, 2, 'x']"},
            "mine.toml:11: key initial.omega_deg_s: must",
        ),
        ({"orbit": "rate_deg_s = 1e9"}, "mine.toml:7: key orbit.rate_deg_s: must"),
        ({"initial": "z_grad = 3\nomega_deg_s = [1, 2, 3]"}, "key initial.z_grad: must"),
        ({"low": "true"}, "key dispersion.omega_deg_s.low: must"),
    ],
)
def test_messages_name_the_key_that_was_written(tmp_path, changes, message):
    assert message in mistakes(written(tmp_path, **changes))


def test_overrides_displace_the_other_unit(tmp_path):
    path = written(tmp_path, **RADIANS)
    turned = read(path, ["initial.z_deg=90", "initial.omega_deg_s=[0, 0, 180]"])
    assert turned.initial.z_rad == math.pi / 2
    assert turned.initial.omega_rad_s == (0.0, 0.0, math.pi)
    back = read(written(tmp_path), ["initial.z_rad=0.25"])
    assert back.initial.z_rad == 0.25
    assert read(written(tmp_path), ["orbit.altitude_km=500"]).orbit.rate_rad_s is None
    drawn = read(path, ["dispersion.omega_deg_s={distribution='normal', mean=0, sigma=1}"])
    assert drawn.dispersion.omega_rad_s.sigma == math.radians(1)
    text = mistakes(path, "initial.z_deg=a lot")
    assert "--set initial.z_deg=a lot: key initial.z_deg: must" in text


def test_the_schema_has_one_unit_of_each_key():
    """Wherever the key may stand; one that must be given in any unit, and never two."""
    schema, found = json_schema(), set()
    for table in schema["$defs"].values():
        properties, rules = table.get("properties", {}), table.get("allOf", [])
        for key in properties:
            family = spellings(key)
            if key != family[0] or len(family) == 1:
                continue
            found.add(key)
            assert set(family) <= set(properties)
            assert key not in table.get("required", [])
            each = [{"required": [one]} for one in family]
            assert {"oneOf": [*each, {"not": {"anyOf": each}}]} in rules
    assert {"omega_rad_s", "z_rad", "rate_rad_s", "attitude_noise_rad", "angle_rad"} <= found
    orbit = schema["$defs"]["OrbitTable"]["properties"]
    assert orbit["rate_rpm"]["maximum"] == pytest.approx(30 / math.pi, rel=1e-15)
    assert orbit["rate_rpm"]["unit"] == "rpm"


def test_the_schema_has_what_must_be_given():
    """In any unit; of a device only where it has no type."""
    tables = json_schema()["$defs"]
    omega = {"anyOf": [{"required": [one]} for one in spellings("omega_rad_s")]}
    assert omega in tables["InitialTable"]["allOf"]
    assert tables["SimulationTable"]["required"] == ["duration_s"]
    gimbal = tables["GimbalTable"]
    assert gimbal["if"] == {"not": {"required": ["type"]}}
    assert gimbal["then"]["required"] == ["axis", "spin_axis", "rotor_momentum_N_m_s"]
    rate = {"anyOf": [{"required": [one]} for one in spellings("rate_limit_rad_s")]}
    assert gimbal["then"]["allOf"] == [rate]
    assert rate not in gimbal["allOf"]
    typed = {name for name, table in tables.items() if "type" in table.get("properties", {})}
    assert typed == {table.__name__ for table in TABLES.values()}


EVERYWHERE = """
title = "units"
[spacecraft]
inertia_kg_m2 = [400.0, 300.0, 500.0]
[[gimbal]]
axis = [1, 0, 0]
spin_axis = [0, 0, 1]
rotor_momentum_N_m_s = 1.0
rate_limit_deg_s = 30
angle_deg = {angle}
[orbit]
rate_rad_s = 0.0
[initial]
quaternion = [1, 0, 0, 0]
omega_rpm = [0.1, 0, 0]
[gyro]
noise_density_deg_sqrt_h = 0.06
bias_deg_h = [1, 2, 3]
[star_tracker]
across_arcsec = 6
along_arcsec = 60
[control]
law = "quaternion-feedback"
period_s = 0.5
natural_frequency_rad_s = 0.1
max_rate_deg_s = 1.0
[simulation]
duration_s = 10.0
[dispersion.omega_rpm]
distribution = "uniform"
low = -1
high = 1
[tuning.parameters.natural_frequency_deg_s]
low = 1
high = 10
"""


def test_units_are_known_in_every_table(tmp_path):
    """Of devices, sensors and laws, in bounds of tuning: against the unit converter of astronomers,
    1 deg/h = 4.84813681109536e-6 rad/s over 1 s, and the identity 1 deg/√h = π/10800 rad/√s."""
    path = tmp_path / "mine.toml"
    path.write_text(EVERYWHERE.format(angle=45))
    scenario = read(path)
    assert scenario.gimbal[0].angle_rad == math.pi / 4
    assert scenario.gimbal[0].rate_limit_rad_s == pytest.approx(math.pi / 6)
    assert scenario.initial.omega_rad_s[0] == pytest.approx(0.2 * math.pi / 60)
    assert scenario.gyro.noise_density_rad_s_sqrt_Hz == pytest.approx(0.06 * math.pi / 10800)
    assert scenario.gyro.bias_rad_s[2] == pytest.approx(3 * 4.84813681109536e-6)
    assert scenario.star_tracker.across_rad == pytest.approx(6 * 4.84813681109536e-6)
    assert scenario.control.max_rate_rad_s == math.radians(1)
    assert scenario.dispersion.omega_rad_s.high == pytest.approx(math.pi / 30)
    assert scenario.tuning.parameters["natural_frequency_rad_s"].high == math.radians(10)


def test_a_list_of_tables_and_bounds_tell_of_the_key_that_was_written(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(EVERYWHERE.format(angle="1e9"))
    text = mistakes(path, "tuning.parameters.natural_frequency_deg_s.high=0.5")
    assert "mine.toml:10: key gimbal.angle_deg: must be at most" in text
    assert "(read as angle_rad)" in text
    assert "key tuning.parameters.natural_frequency_deg_s.high: must be above low" in text


def test_what_is_said_of_another_key_names_it_as_it_was_written():
    """Keys of two tables, one told with its table; and one that stands for another that stands in
    for momentum."""
    conversion = Conversion.of({"wheel": [{"speed_limit_rpm": 1}], "initial": {"omega_rpm": [1]}})
    conversion.replace(("wheel", 0), "speed_limit_rpm", "speed_limit_rad_s", 1)
    conversion.replace(("wheel", 0), "speed_limit_rad_s", "momentum_limit_N_m_s", 1)
    conversion.replace(("initial",), "omega_rpm", "omega_rad_s", 1)
    message = "must fit momentum_limit_N_m_s = 1, omega_rad_s and initial.omega_rad_s, not my"
    told = conversion.as_written(Issue(("wheel", 0, "axis"), message)).message
    assert told == (
        "must fit speed_limit_rpm (read as momentum_limit_N_m_s) = 1, omega_rad_s and "
        "initial.omega_rpm (read as omega_rad_s), not my"
    )


def test_two_units_of_one_key_are_refused(tmp_path):
    text = mistakes(written(tmp_path, initial="z_deg = 5\nz_arcsec = 30\nomega_rpm = [1, 1, 1]"))
    assert "key initial.z_arcsec: must not be given with z_deg, got 30" in text
    assert text.count("\n") == 0


def test_every_ending_is_its_own():
    for si, units in UNITS.items():
        for one in (si, *units):
            assert spellings(f"x{one}") == tuple(f"x{other}" for other in (si, *units))


def test_a_frequency_in_hertz_is_that_in_radians(tmp_path):
    mode = "flexible_mode=[{coupling_sqrt_kg_m=[0.01, 0, 0], frequency_Hz=0.5, damping=0.01}]"
    found = read(library()["cubesat-12u"], [mode])
    assert found.flexible_mode[0].frequency_rad_s == math.pi
    turned = read(written(tmp_path), ["initial.omega_Hz=[0, 0, 0.5]"])
    assert turned.initial.omega_rad_s == (0.0, 0.0, math.pi)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("slope_rad_s", "rad/s"), ("gain_N_m_s", "N m s"), ("gain", "1"), ("speed_m_s", "1"),
     ("rate_deg_s", "1"), ("stiffness_N_m_rad", "1"), ("torque_mN_m", "1")],
)  # fmt: skip
def test_the_unit_of_a_key_is_that_of_its_name_where_the_name_has_no_other(name, unit):
    assert number(name, "A quantity").unit == unit
