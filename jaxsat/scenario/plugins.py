"""Control laws that do not come with jaxsat: installed packages and a user's own modules.

A scenario names them by the name of an entry point of the group `jaxsat.laws`, or as
"module:Class". Modules are looked for in the folder of the scenario file and the current folder
too, but only where a scenario asks for a module.
"""

import functools
import importlib
import importlib.util
import inspect
import re
import traceback
from collections.abc import Iterable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from jaxsat.declaration import LawDeclaration
from jaxsat.declaration.laws import LAWS, Law
from jaxsat.errors import JaxsatError

GROUP = "jaxsat.laws"
_MODULE_AND_CLASS = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


class PluginError(JaxsatError, ValueError):
    """A law that does not come with jaxsat cannot be used; the text is "must …, got …"."""


@functools.cache
def installed() -> Mapping[str, Any]:
    """Laws of installed packages by name, not imported yet; none by a name of jaxsat's own.

    They are entry points of `importlib.metadata` or of the backport that other packages bring.
    """
    return {entry.name: entry for entry in entry_points(group=GROUP) if entry.name not in LAWS}


def law_names() -> tuple[str, ...]:
    """The laws that have a name of their own."""
    return (*LAWS, *sorted(installed()))


def is_plugin(name: str) -> bool:
    """Whether this is the name of a law that does not come with jaxsat."""
    return name not in LAWS and (":" in name or name in installed())


def find_law(name: str) -> Law:
    """The law that a scenario names.

    Raises `PluginError` for one that does not come with jaxsat and cannot be used, and `KeyError`
    for a name that there is not.
    """
    if name in LAWS:
        return LAWS[name]
    if ":" not in name:
        entry = installed()[name]
        return _checked(name, _imported(name, entry.module), entry.attr)
    if not _MODULE_AND_CLASS.fullmatch(name):
        raise PluginError('must have the form "module:Class", got one that has not')
    module, attribute = name.split(":")
    return _checked(name, _imported(name, module), attribute)


def known_law(name: Any) -> Law | None:
    """The law of that name; None where there is none that can be used."""
    try:
        return find_law(name) if isinstance(name, str) else None
    except (KeyError, PluginError):
        return None


def require_not_hidden(name: str, folders: Iterable[Path]) -> None:
    """Raise `PluginError` where a folder has the module of a law and another one hides it."""
    package = name.partition(":")[0].partition(".")[0]
    file = next((path for folder in folders for path in _files(folder, package)), None)
    try:
        spec = importlib.util.find_spec(package)
    except (ValueError, ImportError):  # a program's main module has none
        return
    if file is None or spec is None or spec.origin is None:
        return
    if Path(spec.origin).resolve() != file.resolve():
        raise PluginError(
            f"must name a module that no other hides, got {package}, which is {file} and is "
            f"hidden by {spec.origin}"
        )


def place_in(file: str | None, error: BaseException) -> str:
    """The last line of this file that an exception passed through, " (file:12)", or nothing."""
    frames = [one for one in traceback.extract_tb(error.__traceback__) if one.filename == file]
    return f" ({file}:{frames[-1].lineno})" if frames else ""


def _files(folder: Path, package: str) -> list[Path]:
    candidates = (folder / package / "__init__.py", folder / f"{package}.py")
    return [path for path in candidates if path.is_file()]


def _imported(name: str, module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name and f"{module}.".startswith(f"{error.name}."):
            raise PluginError(
                f"must name a module that can be found, got {name}: there is no module {error.name}"
                " beside the scenario, in the current folder or among the installed packages"
            ) from None
        raise _of_their_code(name, module, error) from error
    except Exception as error:
        raise _of_their_code(name, module, error) from error


def _of_their_code(name: str, module: str, error: Exception) -> PluginError:
    spec = importlib.util.find_spec(module.partition(".")[0])
    reason = f"{type(error).__name__}: {error}{place_in(spec and spec.origin, error)}"
    return PluginError(f"must name a module that can be imported, got {name}: {reason}")


def _checked(name: str, module: ModuleType, attribute: str) -> Law:
    """The law of a class, once it is one that a scenario can use."""
    from jaxsat.control import (
        AbstractBacksteppingLaw,
        AbstractController,
        AbstractSampledController,
    )

    controller = getattr(module, attribute, None)
    if not inspect.isclass(controller):
        raise PluginError(f"must name a class of {module.__name__}, got {name}, which is none")
    bases = (AbstractController, AbstractSampledController)
    if not issubclass(controller, bases):
        allowed = " or ".join(base.__name__ for base in bases)
        raise PluginError(f"must name a law, a subclass of {allowed}, got {name}, which is none")
    lacking = sorted(getattr(controller, "__abstractmethods__", ()))
    if lacking:
        raise PluginError(f"must name a law that has {', '.join(lacking)}, got {name} without")
    declaration = getattr(controller, "declaration", None)
    if not isinstance(declaration, LawDeclaration):
        raise PluginError(
            f"must name a law with a `declaration` that is a LawDeclaration, got {name} without"
        )
    if not callable(getattr(controller, "from_table", None)):
        raise PluginError(f"must name a law with a class method `from_table`, got {name} without")
    sampled = issubclass(controller, AbstractSampledController)
    if sampled and not declaration.sampled:
        raise PluginError(
            f"must name a sampled law that declares the key period_s, got {name} without"
        )
    if declaration.sampled and not sampled:
        raise PluginError(
            "must name a law that declares the key period_s only if it is a subclass of "
            f"AbstractSampledController, got {name} with it"
        )
    if declaration.tracks_rates and not issubclass(controller, AbstractBacksteppingLaw):
        raise PluginError(
            "must name a law that declares tracks_rates only if it is a subclass of "
            f"AbstractBacksteppingLaw, got {name} with it"
        )
    law = Law(name, declaration, f"{module.__name__}:{attribute}")
    try:
        hash(law)  # its table is made once
    except TypeError as error:
        raise PluginError(f"must name a law that declares constants, got {name}: {error}") from None
    return law
