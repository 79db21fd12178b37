"""Plug-ins: laws and parts of installed packages and of the user's own modules.

A scenario names them by an entry point, or as "module:Class". Modules are also searched in the
folder of the scenario file and the current folder, but only if a scenario names one.
"""

import contextlib
import importlib
import importlib.util
import inspect
import pkgutil
import re
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from jaxsat.core.declaration import LawDeclaration, PartDeclaration, VectorDeclaration
from jaxsat.core.declaration.laws import LAW_GROUP
from jaxsat.core.errors import JaxsatError, foreign_exceptions
from jaxsat.core.once import holding, once
from jaxsat.core.text import suggestion

_MODULE_AND_CLASS = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


@dataclass(frozen=True)
class PluginKind:
    """A kind of plug-in: its name in messages, entry-point group, base classes and declaration.

    `key` is the key of a table that names the part, `own` the names of jaxsat's own parts.
    """

    what: str
    group: str
    bases: tuple[str, ...]
    declaration: type
    key: str = "kind"
    own: tuple[str, ...] = ()


LAW = PluginKind(
    "a law",
    LAW_GROUP,
    (
        "jaxsat.control.controller:AbstractController",
        "jaxsat.control.sampled:AbstractSampledController",
    ),
    LawDeclaration,
    "law",
)
DISTURBANCE = PluginKind(
    "a disturbance",
    "jaxsat.disturbances",
    ("jaxsat.spacecraft.environment.disturbances:AbstractDisturbance",),
    PartDeclaration,
)
ACTUATORS = PluginKind(
    "actuators",
    "jaxsat.actuators",
    ("jaxsat.spacecraft.actuators:AbstractActuators",),
    PartDeclaration,
)
SENSOR = PluginKind(
    "the vector of a sensor",
    "jaxsat.sensors",
    ("jaxsat.spacecraft.environment.sensed_vectors:AbstractSensedVector",),
    VectorDeclaration,
)
ESTIMATOR = PluginKind(
    "an estimator",
    "jaxsat.estimators",
    ("jaxsat.control.navigation.estimator:AbstractEstimator",),
    PartDeclaration,
    own=("mekf", "none"),
)


class PluginError(JaxsatError, ValueError):
    """A plug-in that cannot be used; the text is "must …, got …".

    `key` is the key that names the part.
    """

    key: str

    def __init__(self, kind: PluginKind, message: str):
        super().__init__(message)
        self.key = kind.key


@once
def installed(kind: PluginKind) -> Mapping[str, Any]:
    """Entry points of installed packages by name, not imported yet.

    They are objects of `importlib.metadata` or of the backport that other packages bring.
    """
    return {entry.name: entry for entry in entry_points(group=kind.group)}


@dataclass(frozen=True)
class Part:
    """A plug-in other than a law, by its name in a scenario, and the place of its class."""

    name: str
    kind: PluginKind
    declaration: PartDeclaration
    place: str

    @property
    def made(self) -> Any:
        """The class of the part, imported."""
        return pkgutil.resolve_name(self.place)


def find_part(kind: PluginKind, name: str) -> Part:
    """Return the part that a scenario names; raises `PluginError` if it cannot be used."""
    part_class, place = find_class(kind, name)
    part = Part(name, kind, part_class.declaration, place)
    require_constants(kind, part)
    return part


def known_part(kind: PluginKind, name: Any) -> Part | None:
    """Return the part with this name; None if there is no usable part."""
    try:
        return find_part(kind, name) if isinstance(name, str) else None
    except PluginError:
        return None


def find_class(kind: PluginKind, name: str) -> tuple[Any, str]:
    """Return the class with this name, checked for use in a scenario, and its place.

    Raises `PluginError`.
    """
    if ":" in name:
        if not _MODULE_AND_CLASS.fullmatch(name):
            raise PluginError(kind, 'must have the form "module:Class", got one that has not')
        place = name
    elif name in installed(kind):
        entry = installed(kind)[name]
        place = f"{entry.module}:{entry.attr}"
    else:
        names = (*kind.own, *sorted(installed(kind)))
        quoted = ", ".join(f'"{one}"' for one in names)
        options = f"be one of {quoted} or " if names else ""
        hint = suggestion(name, names)
        raise PluginError(kind, f'must {options}have the form "module:Class", got {name}{hint}')
    module, attribute = place.split(":")
    return _check_class(kind, name, _import_module(kind, name, module), attribute), place


def require_constants(kind: PluginKind, part: Any) -> None:
    """Raise `PluginError` for an unhashable declaration: tables are cached by declaration."""
    try:
        hash(part)
    except TypeError as error:
        message = f"must name {kind.what} that declares constants, got {part.name}: {error}"
        raise PluginError(kind, message) from None


def require_not_hidden(kind: PluginKind, name: str, folders: Iterable[Path]) -> None:
    """Raise `PluginError` if another module hides the module of a part in one of the folders."""
    package = name.partition(":")[0].partition(".")[0]
    file = next((path for folder in folders for path in _files(folder, package)), None)
    try:
        spec = importlib.util.find_spec(package)
    except (ValueError, ImportError):  # the main module of a program has no spec
        return
    if file is None or spec is None or spec.origin is None:
        return
    if Path(spec.origin).resolve() != file.resolve():
        raise PluginError(
            kind,
            f"must name a module that no other hides, got {package}, which is {file} and is "
            f"hidden by {spec.origin}",
        )


def place_in(file: str | None, error: BaseException) -> str:
    """Last line of this file in an exception's traceback, " (file:12)", or empty."""
    frames = [one for one in traceback.extract_tb(error.__traceback__) if one.filename == file]
    return f" ({file}:{frames[-1].lineno})" if frames else ""


def _files(folder: Path, package: str) -> list[Path]:
    candidates = (folder / package / "__init__.py", folder / f"{package}.py")
    return [path for path in candidates if path.is_file()]


_IMPORTS: ContextVar[bool] = ContextVar("_IMPORTS", default=True)
"""Whether modules that a scenario names may be imported."""


def without_imports() -> contextlib.AbstractContextManager[None]:
    """Prevent imports of modules that a scenario names, inside this context.

    Parts of modules that are already imported can be used.
    """
    return holding(_IMPORTS, False)


_FAILED: ContextVar[dict[str, BaseException] | None] = ContextVar("_FAILED", default=None)
"""Exceptions of modules that could not be imported, inside `failing_once`."""


@contextlib.contextmanager
def failing_once() -> Iterator[None]:
    """Prevent a second import, with its side effects, of a module whose import failed."""
    with holding(_FAILED, {}):  # a new dict at each call of the decorated function
        yield


def _import(module: str) -> ModuleType:
    failures = _FAILED.get()
    if failures is not None and module in failures:
        raise failures[module]
    try:
        return importlib.import_module(module)
    except foreign_exceptions() as error:
        if failures is not None and not _is_missing(module, error):
            failures[module] = error
        raise


def _is_missing(module: str, error: BaseException) -> bool:
    """Whether a module, or a package around it, does not exist; a folder may still be added."""
    missing = isinstance(error, ModuleNotFoundError) and error.name
    return bool(missing) and f"{module}.".startswith(f"{missing}.")


def _import_module(kind: PluginKind, name: str, module: str) -> ModuleType:
    if not _IMPORTS.get() and module not in sys.modules:
        raise PluginError(kind, f"must name a module that is imported already, got {name}")
    try:
        return _import(module)
    except ModuleNotFoundError as error:
        if _is_missing(module, error):
            raise PluginError(
                kind,
                f"must name a module that can be found, got {name}: there is no module {error.name}"
                " beside the scenario, in the current folder or among the installed packages",
            ) from None
        raise _of_their_code(kind, name, module, error) from error
    except foreign_exceptions() as error:
        raise _of_their_code(kind, name, module, error) from error


def _of_their_code(kind: PluginKind, name: str, module: str, error: BaseException) -> PluginError:
    spec = importlib.util.find_spec(module.partition(".")[0])
    reason = f"{type(error).__name__}: {error}{place_in(spec and spec.origin, error)}"
    if isinstance(error, ModuleNotFoundError):
        reason += _own_module(error.name or "")
    return PluginError(kind, f"must name a module that can be imported, got {name}: {reason}")


def _own_module(missing: str) -> str:
    """Present name of a jaxsat module with this file name, as a hint for outdated plug-ins."""
    package, _, leaf = missing.rpartition(".")
    if package.partition(".")[0] != "jaxsat":
        return ""
    root = Path(__file__).parents[1]
    places = [
        *root.rglob(f"{leaf}.py"),
        *(file.parent for file in root.rglob(f"{leaf}/__init__.py")),
    ]
    names = [".".join(place.relative_to(root.parent).with_suffix("").parts) for place in places]
    return f"; it is {names[0]} now" if len(names) == 1 else ""


def _check_class(kind: PluginKind, name: str, module: ModuleType, attribute: str) -> Any:
    """Return the class `attribute` of a module; raises `PluginError` if it violates its kind."""
    part_class = getattr(module, attribute, None)
    if not inspect.isclass(part_class):
        classes = [one for one, value in vars(module).items() if inspect.isclass(value)]
        hint = suggestion(attribute, classes)
        message = f"must name a class of {module.__name__}, got {name}, which is none{hint}"
        raise PluginError(kind, message)
    bases = tuple(pkgutil.resolve_name(base) for base in kind.bases)  # imports JAX
    if not issubclass(part_class, bases):
        base_names = " or ".join(base.__name__ for base in bases)
        message = f"must name {kind.what}, a subclass of {base_names}, got {name}, which is none"
        raise PluginError(kind, message)
    lacking = sorted(getattr(part_class, "__abstractmethods__", ()))
    if lacking:
        message = f"must name {kind.what} with {', '.join(lacking)}, got {name} without"
        raise PluginError(kind, message)
    if not isinstance(getattr(part_class, "declaration", None), kind.declaration):
        raise PluginError(
            kind,
            f"must name {kind.what} with a `declaration` that is a {kind.declaration.__name__}, "
            f"got {name} without",
        )
    if not callable(getattr(part_class, "from_table", None)):
        message = f"must name {kind.what} with a class method `from_table`, got {name} without"
        raise PluginError(kind, message)
    return part_class
