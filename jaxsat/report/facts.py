"""Facts common to documents of several kinds: the scenario, and the provenance of a result."""

import hashlib
import tomllib
from collections.abc import Mapping
from typing import Any

from jaxsat.core.declaration.actuators import PARTS
from jaxsat.core.once import latest
from jaxsat.core.text import number_text
from jaxsat.core.tolerances import Tolerances
from jaxsat.report.document import Facts
from jaxsat.scenario.control import known_law
from jaxsat.scenario.parts.orbit import OrbitTable
from jaxsat.store.labelled import Dataset


def scenario_tables(dataset: Dataset) -> dict[str, Any]:
    """Return the tables of a dataset's scenario, not to be changed; empty where it has none.

    Failures are those of the dataset's case.
    """
    scenario = _tables(str(dataset.attrs.get("scenario", "")))
    failures = dataset.attrs.get("failures")
    return scenario if failures is None else scenario | _tables(str(failures))


@latest(4)
def _tables(scenario: str) -> dict[str, Any]:
    try:
        return tomllib.loads(scenario)
    except tomllib.TOMLDecodeError:
        return {}


def settles_in_attitude(scenario: Mapping[str, Any]) -> bool:
    """Whether the law of a scenario's tables has a target attitude; true for an unknown law."""
    law = known_law(str(scenario.get("control", {}).get("law", "unknown")))
    return law is None or law.declaration.regulates_attitude


def settled_meaning(scenario: Mapping[str, Any], of_study: bool = False) -> str:
    """Describe the tolerances within which a run, or a case of a study, is settled.

    Under a law that only stops a rotation a case of a study may also rotate at the orbital rate.
    """
    keys = ("tilt_rad", "turn_rad", "rate_rad_s", "dwell_s")
    table = scenario.get("settled", {})
    values = {key: table[key] for key in keys if isinstance(table.get(key), int | float)}
    tolerances, attitude = Tolerances.of_keys(**values), settles_in_attitude(scenario)
    if attitude or not of_study:
        return tolerances.text(attitude)
    return tolerances.of_rate(OrbitTable.model_validate(scenario.get("orbit", {})).rate()).text()


def spacecraft_facts(scenario: Mapping[str, Any]) -> dict[str, str]:
    """Return the main facts of the spacecraft of a scenario."""
    spacecraft = scenario.get("spacecraft", {})
    rows = {
        "description": " ".join(str(scenario.get("description", "")).split()),
        "inertia": f"{_numbers(spacecraft.get('inertia_kg_m2'))} kg m²",
        "actuators": _actuators(scenario),
        "third rate": str(spacecraft.get("third_rate", "")),
    }
    return {label: text for label, text in rows.items() if text}


def scenario_facts(scenario: Mapping[str, Any]) -> dict[str, str]:
    """Return the main facts of a scenario: spacecraft, law, start and duration."""
    control, initial = scenario.get("control", {}), scenario.get("initial", {})
    keys = (f"{key} = {_numbers(value)}" for key, value in control.items() if key != "law")
    rows = {
        "control law": ", ".join([str(control.get("law", "")), *keys]),
        "start": ", ".join(f"{key} = {_numbers(value)}" for key, value in initial.items()),
        "duration": f"{_numbers(scenario.get('simulation', {}).get('duration_s'))} s",
    }
    return spacecraft_facts(scenario) | {label: text for label, text in rows.items() if text}


def _actuators(scenario: Mapping[str, Any]) -> str:
    spacecraft, parts = scenario.get("spacecraft", {}), []
    axes = spacecraft.get("thruster_torque_axes")
    if axes:
        failed = ", ".join(map(str, spacecraft.get("failed_thrusters", ())))
        limit = spacecraft.get("torque_limit_N_m")
        more = f" of at most {_numbers(limit)} N m" if limit is not None else ""
        parts.append(
            f"{len(axes)} ideal thrusters{more}" + (f", failed: {failed}" if failed else "")
        )
    for part in PARTS:
        tables = scenario.get(part.name, ())
        if tables:
            failed = sum(bool(table.get("failed")) for table in tables)
            prices = [table.get("price", 1.0) for table in tables]
            dear = f" at prices {_numbers(prices)}" if set(prices) != {1.0} else ""
            words = f"{len(tables)} {part.called}{'s' if len(tables) > 1 else ''}"
            parts.append(f"{words}{dear}" + (f", {failed} failed" if failed else ""))
    return "; ".join(parts)


def _numbers(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return "(" + ", ".join(map(_numbers, value)) + ")"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_numbers(entry)}" for key, entry in value.items()) + "}"
    return number_text(value, 6) if isinstance(value, float) else str(value)


def provenance_facts(attributes: Mapping[str, Any], command: str = "") -> Facts:
    """Return the provenance of a dataset, and the hash of its scenario."""
    text = str(attributes.get("scenario", ""))
    versions = {
        key.removesuffix("_version"): str(value)
        for key, value in attributes.items()
        if key.endswith("_version")
    }
    digest = hashlib.sha256(text.encode()).hexdigest() if text else ""
    record = {**attributes, "command": command, "versions": versions}
    facts = record_provenance(record, **{"scenario (SHA-256)": digest}).rows
    steps = str(attributes.get("steps", ""))
    return Facts("Provenance", {**facts, **({"steps": steps} if steps else {})})


def record_provenance(record: Mapping[str, Any], **more: str) -> Facts:
    """Return the provenance of a result, from the record in its folder."""
    facts = {
        "command": str(record.get("command", "")),
        **more,
        "seed": str(record.get("seed", "")),
        "made": str(record.get("created", "")),
        "versions": ", ".join(f"{k} {v}" for k, v in record.get("versions", {}).items()),
        "platform": str(record.get("platform", "")),
    }
    return Facts("Provenance", {label: text for label, text in facts.items() if text})


def step_error(rate: float | None, attitude: float | None) -> str:
    """Describe the errors (rad/s, rad) by equal steps; empty without estimates."""
    if rate is None or attitude is None:
        return ""
    sizes = f"{number_text(rate, 2)} rad/s and {number_text(attitude, 2)} rad"
    return f"up to {sizes}, compared with steps of half the length"
