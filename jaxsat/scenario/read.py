"""Reading of scenarios from the library or a file, with overrides, every mistake with its place."""

import dataclasses
import functools
import re
import tomllib
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from jaxsat.core.process import add_folders
from jaxsat.core.text import suggestion
from jaxsat.scenario.cautions import cautions
from jaxsat.scenario.errors import Issue, Location, Problem, ScenarioError, ScenarioWarning, key_of
from jaxsat.scenario.limits import MAX_FILE_SIZE, MAX_OVERRIDES, Excess, require_modest
from jaxsat.scenario.lines import line_map, nearest_line
from jaxsat.scenario.overrides import Override, apply_overrides, parse_override
from jaxsat.scenario.plugins import (
    ACTUATORS,
    DISTURBANCE,
    ESTIMATOR,
    LAW,
    SENSOR,
    PluginError,
    PluginKind,
    failing_once,
    require_not_hidden,
)
from jaxsat.scenario.schema import Scenario, issues_of
from jaxsat.scenario.stand_ins import converted, without_types
from jaxsat.scenario.units import Conversion, spellings
from jaxsat.store.files import OutputError
from jaxsat.store.marker import is_verified


def library() -> dict[str, Traversable]:
    """Return the named scenarios that come with jaxsat."""
    folder = resources.files("jaxsat.scenario") / "library"
    files = [entry for entry in folder.iterdir() if entry.name.endswith(".toml")]
    scenarios = {entry.name.removesuffix(".toml"): entry for entry in files}
    return dict(sorted(scenarios.items()))


def warn(text: str) -> None:
    """Warn the caller of `read` with a `ScenarioWarning`."""
    warnings.warn(text, ScenarioWarning, stacklevel=3)


@failing_once()
def read(
    name_or_path: str | Path,
    overrides: Iterable[str | Override] = (),
    *,
    law: bool = True,
    trial: Callable[[Scenario], list[Issue]] = lambda scenario: [],
    caution: Callable[[str], None] = warn,
) -> Scenario:
    """Read the library's scenario with this name, or a TOML file.

    `overrides` are texts `KEY=VALUE`, as after `--set`: dotted keys and TOML values (or bare text),
    checked like the file. An override displaces contradicting keys of the file: the orbit's
    altitude its rate, another `control.law` the gains of the former law.

    Without `law` the rules that concern the control law are omitted. `trial` returns further issues
    of a scenario whose keys are valid. Raises `ScenarioError` with every problem at once; passes
    cautions about likely mistakes to `caution`, by default as a `ScenarioWarning`.
    """
    source = _read(name_or_path)
    entries = _overrides(overrides)
    problems = [entry for entry in entries if isinstance(entry, Problem)]
    valid_overrides = [entry for entry in entries if isinstance(entry, Override)]
    places = _Places(source, valid_overrides)
    folders = (Path(name_or_path).resolve().parent, Path.cwd())
    plugin_parts = [
        *_plugin_parts(source.data),
        *_plugin_parts(apply_overrides({}, valid_overrides)[0]),
    ]
    if plugin_parts:
        add_folders(map(str, folders))
    data, obstacles = apply_overrides(source.data, valid_overrides)
    for kind, location, name in _plugin_parts(data):
        try:
            require_not_hidden(kind, name, folders)
        except PluginError as error:
            raise ScenarioError([places.problem(Issue(location, str(error)))]) from None
    problems += obstacles
    scenario, conversion = None, converted(data)
    places = dataclasses.replace(places, conversion=conversion)
    problems += [places.problem(issue) for issue in conversion.issues]
    try:
        scenario = without_types(Scenario.model_validate(conversion.data, context={"law": law}))
        issues = [] if problems else trial(scenario)
    except ValidationError as error:
        issues = issues_of(error)
    located = map(places.problem, issues)
    problems += sorted(located, key=lambda one: (one.line is not None, one.line or 0))
    if scenario is None or problems:
        raise ScenarioError(list(dict.fromkeys(problems)))
    if source.change:
        caution(source.change)
    for issue in cautions(scenario, law):
        caution(str(places.problem(issue)))
    return scenario


def _plugin_parts(data: Mapping[str, Any]) -> Iterator[tuple[PluginKind, Location, str]]:
    """Parts of a scenario that are named by module and class, with their locations."""
    torques, sensors = _table(_table(data, "disturbance"), "torques"), _table(data, "sensor")
    places = [(LAW, ("control", "law")), (ACTUATORS, ("actuators", "kind"))]
    places += [(ESTIMATOR, ("estimator", "kind"))]
    places += [(DISTURBANCE, ("disturbance", "torques", name, "kind")) for name in torques]
    places += [(SENSOR, ("sensor", name, "kind")) for name in sensors]
    for kind, location in places:
        table = functools.reduce(_table, location[:-1], data)
        name = table.get(location[-1])
        if isinstance(name, str) and ":" in name:
            yield kind, location, name


def _table(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    inner = data.get(name)
    return inner if isinstance(inner, Mapping) else {}


def _overrides(texts: Iterable[str | Override]) -> list[Override | Problem]:
    texts = list(texts)
    if len(texts) > MAX_OVERRIDES:
        message = f"must be given at most {MAX_OVERRIDES} times, got {len(texts)}"
        raise ScenarioError([Problem("--set", message)])
    return [one if isinstance(one, Override) else parse_override(one) for one in texts]


@dataclass(frozen=True)
class _File:
    """A readable TOML file."""

    name: str
    data: dict[str, Any]
    lines: dict[Location, int]
    change: str | None = None
    """Notice of a change since jaxsat wrote this file to a folder of results."""


@dataclass(frozen=True)
class _Places:
    """The file and the overrides from which the values of a scenario come."""

    source: _File
    overrides: Sequence[Override] = field(default=())
    conversion: Conversion | None = None

    def problem(self, issue: Issue) -> Problem:
        issue = issue if self.conversion is None else self.conversion.as_written(issue)
        key = key_of(issue.location)
        override = self._override(issue)
        if override is not None:
            return Problem(override.source, issue.message, key)
        line = nearest_line(self.source.lines, issue.location)
        return Problem(self.source.name, issue.message, key, line)

    def _override(self, issue: Issue) -> Override | None:
        """Override to blame: of the key itself, or else of another key in the same rule."""
        last_first = self.overrides[::-1]
        for location in (issue.location, *issue.involved):
            for override in last_first:
                inside = location[: len(override.path)] == override.path
                missing_table = (
                    location not in self.source.lines and location == override.path[: len(location)]
                )
                if location and (inside or missing_table):
                    return override
        if issue.missing and issue.location[:1] == ("control",):
            return next((one for one in last_first if one.key == "control.law"), None)
        return None


def _read(name_or_path: str | Path) -> _File:
    text_name = str(name_or_path)
    scenarios = library()
    if isinstance(name_or_path, str) and text_name in scenarios:
        return _parse(f"{text_name}.toml", scenarios[text_name].read_bytes())
    path = Path(name_or_path)
    try:
        text_name.encode()
        if not path.exists():
            raise ScenarioError([_unknown_name(text_name, list(scenarios))])
        if not path.is_file():
            what = "a folder" if path.is_dir() else "something else"
            raise ScenarioError([Problem(text_name, f"must be a scenario file, got {what}")])
        with path.open("rb") as file:
            content = file.read(MAX_FILE_SIZE + 1)
    except UnicodeEncodeError:
        message = "must be a name of valid characters, got bytes that are none"
        raise ScenarioError([Problem(text_name, message)]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        problem = Problem(text_name, f"must be a file that can be read, got: {reason}")
        raise ScenarioError([problem]) from None
    if len(content) > MAX_FILE_SIZE:
        message = f"must be a scenario file of at most {MAX_FILE_SIZE} bytes, got more"
        raise ScenarioError([Problem(text_name, message)])
    return dataclasses.replace(_parse(text_name, content), change=_change(path, content))


def _change(path: Path, content: bytes) -> str | None:
    try:
        is_verified(path, content)
    except OutputError as error:
        return str(error)
    return None


def _unknown_name(name: str, names: list[str]) -> Problem:
    if name.endswith(".toml") or "/" in name or "\\" in name:
        stem = Path(name).stem
        hint = f" (jaxsat has a scenario {stem})" if stem in names else ""
        return Problem(name, f"no such file{hint}")
    hint = suggestion(name, names) or " (`jaxsat scenarios list` lists the library)"
    return Problem(name, f"no such file, and no scenario of jaxsat{hint}")


def _parse(name: str, content: bytes) -> _File:
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        got = f"got byte 0x{content[error.start]:02x}"
        raise ScenarioError([Problem(name, f"must be UTF-8 text, {got}", None, line)]) from None
    try:
        require_modest(text)
        data = tomllib.loads(text)
        lines = line_map(text)
    except Excess as error:
        raise ScenarioError([Problem(name, str(error), None, error.line)]) from None
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError([_syntax_problem(name, text, str(error))]) from None
    return _File(name, data, lines)


def _syntax_problem(name: str, text: str, message: str) -> Problem:
    match = re.search(r" \(at (?:line (\d+), column \d+|end of document)\)$", message)
    what = message[: match.start()] if match else message
    last = text.rstrip("\n").count("\n") + 1
    line = int(match.group(1)) if match and match.group(1) else last
    return Problem(name, f"must be valid TOML, got: {what}", None, min(line, last))


def given_keys(name_or_path: str | Path, overrides: Iterable[str] = ()) -> set[str]:
    """Dotted keys, in SI, of a file and its overrides; none for an unreadable file."""
    try:
        data = _read(name_or_path).data
    except ScenarioError:  # which `read` reports
        data = {}
    keys = _keys(data) | {text.partition("=")[0].strip() for text in overrides}
    return {spellings(key)[0] for key in keys}


def _keys(data: Any, prefix: str = "") -> set[str]:
    if not isinstance(data, dict):
        return {prefix.removesuffix(".")}
    return {key for name, value in data.items() for key in _keys(value, f"{prefix}{name}.")}
