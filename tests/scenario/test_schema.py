"""The JSON Schema of scenario files."""

from jaxsat.scenario import json_schema


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
