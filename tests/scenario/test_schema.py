"""The JSON Schema of scenario files."""

import copy
import json
import re
import subprocess
import tomllib

import jsonschema
import pytest

from helpers.tools import executable, needs
from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario import json_schema, library
from jaxsat.scenario.toml_text import toml_document


def test_schema_describes_every_key_with_its_unit():
    schema = json_schema()
    tables = [schema, *schema["$defs"].values()]
    suffixes = {"kg_m2": "kg m²", "N_m": "N m", "N_m_s": "N m s", "m": "m",
                "N": "N", "rad_s": "rad/s", "rad_s2": "rad/s²", "km": "km",
                "sqrt_kg_m": "√kg m",
                "rad": "rad", "s": "s", "deg": "deg", "deg_s": "deg/s"}  # fmt: skip
    seen = 0
    for table in tables:
        plugin = "module:Class" in str(table["properties"].get("kind"))  # has keys of its own
        assert table["additionalProperties"] is plugin
        for key, entry in table["properties"].items():
            assert entry.get("description"), key
            if "$ref" in str(entry):  # a table, whose own keys have the units
                continue
            for suffix, unit in suffixes.items():
                if key.endswith("_" + suffix) and not any(
                    key.endswith(f"{longer}") for longer in suffixes if len(longer) > len(suffix)
                ):
                    assert entry["unit"] == unit, key
                    seen += 1
            if "unit" in entry:
                shown = "no unit" if entry["unit"] == "1" else entry["unit"]
                assert entry["description"].endswith(f"({shown})")
    assert seen > 25
    assert schema["$schema"].startswith("https://json-schema.org/")


MISTAKES = {
    "law": ("control.law", "three-axes"),
    "kind": ("failure", [{"of": "thruster 1", "at_s": 3.0, "kind": "ded"}]),
    "unknown key": ("simulation.duraton_s", 3.0),
    "unknown table": ("contrl", {"law": "rate"}),
    "text": ("simulation.duration_s", "long"),
    "range": ("orbit.rate_rad_s", -1.0),
    "two units": ("initial.z_deg", 3.0),
    "length": ("initial.omega_rad_s", [0.1, 0.1]),
    "estimator": ("estimator", {"kind": "ukf"}),
    "key of another law": ("control.k4", 1.0),
}
"""Values that a scenario cannot have, by what is wrong with them."""


@pytest.fixture(scope="module")
def schema():
    return json_schema()


def library_scenarios():
    return {name: tomllib.loads(path.read_text("utf-8")) for name, path in library().items()}


def with_mistakes():
    """The scenario `paper-rate` with each of the mistakes."""
    found = {}
    for name, (key, value) in MISTAKES.items():
        scenario = copy.deepcopy(library_scenarios()["paper-rate"])
        *tables, last = key.split(".")
        table = scenario
        for one in tables:
            table = table[one]
        table[last] = value
        found[name] = scenario
    return found


def test_library_scenarios_follow_the_schema_and_mistakes_do_not(schema):
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    for name, scenario in library_scenarios().items():
        assert validator.is_valid(scenario), name
    for name, scenario in with_mistakes().items():
        assert not validator.is_valid(scenario), name
    own = library_scenarios()["paper-rate"]
    own["control"] = {"law": "mine:Law", "gain": 3.0}
    assert validator.is_valid(own)


def test_editors_find_a_description_of_every_key(schema):
    """Taplo shows that of a list's entries, and of alternatives those of each."""

    def described(entry):
        if "$ref" in entry or "discriminator" in entry:
            return True
        parts = [entry[name][0] for name in ("anyOf", "oneOf") if name in entry]
        parts += [entry["items"]] if isinstance(entry.get("items"), dict) else []
        return "description" in entry and all(map(described, parts))

    tables = [schema, *schema["$defs"].values()]
    for table in tables:
        for key, entry in table["properties"].items():
            assert described(entry), key
    assert "null" not in json.dumps(schema)
    laws = [schema["$defs"][one["$ref"].rpartition("/")[2]] for one in schema["properties"][
        "control"]["oneOf"] if "$ref" in one]  # fmt: skip
    assert {law["properties"]["law"]["const"] for law in laws} == set(LAWS)


@needs("taplo")
@pytest.mark.parametrize("by", ["directive", "configuration"])
def test_taplo_finds_the_mistakes(tmp_path, schema, by):
    """Taplo is the checker of the extension Even Better TOML."""
    (tmp_path / "jaxsat.schema.json").write_text(json.dumps(schema), "utf-8")
    folder = tmp_path / "scenarios"
    folder.mkdir()
    head = "#:schema ../jaxsat.schema.json\n" if by == "directive" else ""
    for name, path in library().items():
        (folder / f"{name}.toml").write_text(head + path.read_text("utf-8"), "utf-8")
    for name, scenario in with_mistakes().items():
        (folder / f"bad {name}.toml").write_text(head + toml_document(scenario), "utf-8")
    if by == "configuration":
        rule = (
            '[[rule]]\ninclude = ["scenarios/*.toml"]\n[rule.schema]\npath = "jaxsat.schema.json"\n'
        )
        (tmp_path / ".taplo.toml").write_text(rule)
    command = [executable("taplo"), "check"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = set(re.findall(r'schema validation failed.*path="?.*/([^"/]+)\.toml', done.stderr))
    assert found == {f"bad {name}" for name in MISTAKES}, done.stderr
