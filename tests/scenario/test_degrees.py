"""Angles in degrees: the same scenario, messages about the key that was written, the schema."""

import math

import pytest

from jaxsat.scenario import ScenarioError, dump, json_schema, read
from jaxsat.scenario.degrees import SUFFIXES, other_spellings

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


def test_the_schema_has_both_for_every_key_in_radians():
    """Wherever one of them may stand, and not both."""
    found = []

    def visit(node):
        if isinstance(node, list):
            for entry in node:
                visit(entry)
        if isinstance(node, dict):
            properties = node.get("properties", {})
            for key, entry in properties.items():
                if key.endswith(tuple(SUFFIXES.values())):
                    (twin,) = other_spellings(key)
                    assert twin in properties
                    assert "deg" in properties[twin]["unit"]
                    excluded = [
                        entry.get("not", entry.get("oneOf"))
                        for entry in node["allOf"]
                        if repr(key) in str(entry)
                    ]
                    assert excluded in (
                        [{"required": [key, twin]}],
                        [[{"required": [key]}, {"required": [twin]}]],
                    )
                    assert key not in node.get("required", [])
                    found.append(key)
            for entry in node.values():
                visit(entry)

    visit(json_schema())
    assert {"omega_rad_s", "z_rad", "rate_rad_s", "attitude_noise_rad"} <= set(found)
