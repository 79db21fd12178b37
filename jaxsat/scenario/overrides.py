"""`--set KEY=VALUE`: values that replace those of a scenario file before it is checked."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.control import known_law, table_of
from jaxsat.scenario.errors import Problem
from jaxsat.scenario.limits import MAX_OVERRIDE_LENGTH, Excess, require_modest
from jaxsat.scenario.parts.orbit import ELLIPTIC_KEYS
from jaxsat.scenario.tables import ADAPTIVE_STEP_KEYS, FIXED_STEP_KEYS
from jaxsat.scenario.units import other_spellings
from jaxsat.scenario.wording import shown

ELLIPSE = frozenset(f"orbit.{key}" for key in ELLIPTIC_KEYS)
"""Keys of an elliptic orbit."""

ALTERNATIVES: tuple[tuple[frozenset[str], ...], ...] = (
    (frozenset({"orbit.rate_rad_s"}), frozenset({"orbit.altitude_km"}), ELLIPSE),
    (frozenset({"orbit.sidereal_angle_rad"}), frozenset({"orbit.epoch"})),
    (
        frozenset({"initial.w", "initial.z_rad"}),
        frozenset({"initial.quaternion"}),
        frozenset({"initial.euler_rad", "initial.euler_sequence"}),
        frozenset({"initial.mrp"}),
    ),
)
"""Groups of mutually exclusive keys: an override of one displaces the others of the file."""


@dataclass(frozen=True)
class Override:
    """One parsed `--set`."""

    text: str
    path: tuple[str, ...]
    value: Any

    @property
    def source(self) -> str:
        """Name of the override in messages."""
        return f"--set {self.text}"

    @property
    def key(self) -> str:
        """The dotted key."""
        return ".".join(self.path)


def override(key: str, value: Any) -> Override:
    """Return an override with a value that is not parsed, so that a title 0 remains text."""
    return Override(f"{key}={value}", tuple(key.split(".")), value)


def parse_override(text: str) -> Override | Problem:
    """Parse `KEY=VALUE`; a VALUE that is not valid TOML is taken as text."""
    source = f"--set {text}"
    if len(text) > MAX_OVERRIDE_LENGTH:
        return Problem(
            source, f"must have at most {MAX_OVERRIDE_LENGTH} characters, got {len(text)}"
        )
    key, equals, value = text.partition("=")
    try:
        require_modest(key)
        require_modest(f"value = {value}")
    except Excess as error:
        return Problem(source, str(error))
    path = _key_path(key.strip())
    if not equals or path is None:
        return Problem(source, f"must have the form KEY=VALUE with a dotted key, got {shown(text)}")
    return Override(text, path, _toml_or_text(value.strip()))


def apply_overrides(
    data: dict[str, Any], overrides: Iterable[Override]
) -> tuple[dict[str, Any], list[Problem]]:
    """Return the file's data with the overrides, and a problem for each that cannot be applied."""
    overrides = list(overrides)
    problems = []
    result = _displace(data, overrides)
    for override in overrides:
        obstacle = _put(result, override)
        if obstacle is not None:
            problems.append(
                Problem(
                    override.source,
                    f"must name a key inside a table, got {obstacle}, which is none",
                    override.key,
                )
            )
    return result, problems


def _key_path(key: str) -> tuple[str, ...] | None:
    if "\n" in key or "=" in key or not key:
        return None
    try:
        tables = tomllib.loads(f"{key} = 0")
    except tomllib.TOMLDecodeError:
        return None
    path = []
    while isinstance(tables, dict):
        if len(tables) != 1:
            return None
        name, tables = next(iter(tables.items()))
        path.append(name)
    return tuple(path)


def _toml_or_text(value: str) -> Any:
    try:
        table = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return value
    return table["value"] if len(table) == 1 else value


def _put(data: dict[str, Any], override: Override) -> str | None:
    table = data
    for depth, name in enumerate(override.path[:-1], 1):
        inner = table.setdefault(name, {})
        if not isinstance(inner, dict):
            return ".".join(override.path[:depth])
        table = inner
    table[override.path[-1]] = override.value
    return None


def _displace(data: dict[str, Any], overrides: list[Override]) -> dict[str, Any]:
    """Return a deep copy of the data without the keys that an override makes void."""
    values = {override.key: override.value for override in overrides}
    void: set[str] = set()
    for groups in ALTERNATIVES:
        for mine in groups:
            if _spellings(mine) & values.keys():
                void |= _spellings(frozenset().union(*groups) - mine)
    void |= _void_solver_keys(values)
    void |= _void_law_keys(data, values)
    void |= {twin for override in overrides for twin in _other_units(override.path)}
    return _without(data, void - values.keys())


def _spellings(keys: Iterable[str]) -> set[str]:
    """Dotted keys, and the same keys in other units."""
    return {spelling for key in keys for spelling in (key, *other_spellings(key))}


def _other_units(path: tuple[str, ...]) -> Iterator[str]:
    """Dotted keys of the override's quantity in other units."""
    for depth, name in enumerate(path):
        for twin in other_spellings(name):
            yield ".".join((*path[:depth], twin))


def _void_solver_keys(values: Mapping[str, Any]) -> set[str]:
    prefix = "simulation.solver."
    steps = values.get(prefix + "steps")
    keys = {key.removeprefix(prefix) for key in values if key.startswith(prefix)}
    if steps == "fixed" or (steps is None and not keys.isdisjoint(FIXED_STEP_KEYS)):
        return {prefix + key for key in (*ADAPTIVE_STEP_KEYS, *(() if steps else ("steps",)))}
    if steps == "adaptive" or (steps is None and not keys.isdisjoint(ADAPTIVE_STEP_KEYS)):
        return {prefix + key for key in (*FIXED_STEP_KEYS, *(() if steps else ("steps",)))}
    return set()


def _void_law_keys(data: Mapping[str, Any], values: Mapping[str, Any]) -> set[str]:
    """Keys of `[control]` that only other laws have, if the law itself is overridden."""
    law = known_law(values.get("control.law"))
    control = data.get("control")
    if law is None or not isinstance(control, Mapping):
        return set()
    before = known_law(control.get("law"))
    laws = (*LAWS.values(), *([] if before is None else [before]))
    others = {key for other in laws for key in table_of(other).model_fields}
    others -= table_of(law).model_fields.keys()
    return {f"control.{key}" for key in control if _spellings([key]) & others}


def _without(data: Any, void: set[str], prefix: str = "") -> Any:
    if not isinstance(data, Mapping):
        return data
    return {
        key: _without(value, void, f"{prefix}{key}.")
        for key, value in data.items()
        if f"{prefix}{key}" not in void
    }
