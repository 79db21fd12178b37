"""Hashes of a package's code in memory, which reveal code that a program has changed there.

A program may replace functions, methods and constants of jaxsat: an experiment in a notebook, a
test, a tool that reloads edited modules. The hash of a module is over the code of its functions and
of the methods of its classes, with their defaults and closures, and over its constants. Processes
with the same module have the same hash, whatever else they have imported or done: a function or
class of another module counts by its name, and objects that a running program creates (locks,
counters, cached results) only by their type. A name says nothing of code that others wrote, which
may be edited: a module that holds such code has no hash.
"""

import dataclasses
import enum
import functools
import hashlib
import marshal
import sys
from collections.abc import Collection, Iterable
from decimal import Decimal
from fractions import Fraction
from importlib.machinery import SourceFileLoader
from types import FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxsat.core.errors import JaxsatError
from jaxsat.core.once import once_property
from jaxsat.core.process import no_collection


class _Named(NamedTuple):
    """A value that counts by its name, outside the module that defines it."""

    home: Any
    tree: tuple[str, str]
    value: Any


_PLAIN = {int, bool, float, complex, str, bytes, type(None), type(...)}

_BLANK = {
    kind: f"{kind.__module__}:{kind.__qualname__}"
    for kind in (dataclasses.Field, type(_Named.home))
}
"""Kinds that dataclasses and named tuples have for each field, and that hold nothing hashed."""

_CONTAINERS = (list, dict, set)

_KEPT_RESULTS = (once_property, functools.cached_property)  # noqa: TID251

_NO_REFERENCES = 2
"""Version of the `marshal` format that does not depend on reference counts."""

_NOT_CODE = ("__annotations__", "__dict__", "__doc__", "__module__", "__slotnames__", "__weakref__")
"""Names in a class that no function depends on."""

_HOLDERS = {
    staticmethod: ("__func__",),
    classmethod: ("__func__",),
    property: ("fget", "fset", "fdel"),
    functools.partial: ("func", "args", "keywords"),
    MethodType: ("__func__", "__self__"),
}
"""Attributes of objects that hold functions."""

_TOLD = (range, slice, Fraction, Decimal)
"""Kinds of values of which `repr` tells everything."""


class ForeignCode(JaxsatError):
    """A module holds a function or a class that is not of known packages."""


def loaded_code(
    package: str, packages: Collection[str], parts: Collection[str] | None = None
) -> dict[str, bytes]:
    """A hash of every imported module inside a package, by name; of these `parts` of it alone.

    The modules may hold code of these parts, of Python and of the `packages`; raises `ForeignCode`
    for other code.
    """
    inside = [f"{package}.{part}" for part in parts] if parts is not None else [package]
    content = _Content(f"{package}.", [*inside, *packages])
    with no_collection():
        return {
            name: content.hash_of(module)
            for name, module in _imported(package)
            if _is_inside(name, inside)
        }


def loaded_as_written(package: str) -> bool:
    """Whether Python's own loader has loaded all imported modules of a package.

    Other loaders, such as the import hook of jaxtyping, wrap each function.
    """
    loaders = [getattr(module, "__loader__", None) for _, module in _imported(package)]
    return all(type(loader) is SourceFileLoader for loader in loaders)


def _imported(package: str) -> list[tuple[str, ModuleType]]:
    return [
        (name, module)
        for name, module in list(sys.modules.items())
        if isinstance(module, ModuleType) and name.startswith(f"{package}.")
    ]


def _is_inside(module: str, packages: Iterable[str]) -> bool:
    return any(module == one or module.startswith(f"{one}.") for one in packages)


class _Content:
    """Content of values as trees of plain values and code, all of which `marshal` distinguishes.

    Containers and objects, which many modules share, are represented by a hash of their tree.
    What is known of a value is kept with it, so that no other value gets its `id`.
    """

    def __init__(self, prefix: str, packages: Collection[str]):
        self._prefix, self._known = prefix, packages
        self._homes = {prefix[:-1]}
        self._named: dict[int, _Named] = {}
        self._hashed: dict[int, tuple[bytes, Any]] = {}
        self._above: set[int] = set()
        self._circles = 0

    def hash_of(self, module: ModuleType) -> bytes:
        """The hash of a module's definitions, without containers (state) under lower-case names."""
        return _hash(
            [
                (name, self._of(value, module.__name__))
                for name, value in sorted(vars(module).items())
                if not name.startswith("__")
                and not (isinstance(value, _CONTAINERS) and name != name.upper())
                and value is not sys.modules.get(f"{module.__name__}.{name}")
            ]
        )

    def _of(self, value: Any, module: str = "") -> Any:
        """The tree of a value; functions and classes of the `module` count as a whole."""
        kind, number = type(value), id(value)
        if kind in _PLAIN:
            return value
        if kind in _BLANK:
            return _BLANK[kind]
        if kind is FunctionType and _is_of(value, module) and not _around(value):
            return _name(value), value.__code__
        if number in self._above:
            self._circles += 1
            return "around this"
        if number in self._hashed:
            return self._hashed[number][0]
        if number in self._named and self._named[number].home != module:
            return self._named[number].tree
        if isinstance(value, enum.Enum):
            return _name(kind), value.name, self._of(value.value)
        home = getattr(value, "__module__", None)
        by_name = kind is ModuleType or not self._is_whole(value, home, module)
        if kind is FunctionType:  # `functools.wraps` states the module of another function
            self._require_known(value.__globals__.get("__name__"))
        if by_name or kind is FunctionType:
            self._require_known(value.__name__ if kind is ModuleType else home)
        if by_name:
            tree = _name(kind), _name(value)
            self._named[number] = _Named(home, tree, value)
            return tree
        circles = self._circles
        self._above.add(number)
        tree = _name(kind), *self._parts(value, kind, home)
        self._above.remove(number)
        if isinstance(value, type | FunctionType):
            return tree
        digest = _hash(tree)
        if self._circles == circles and home != module:  # a whole everywhere
            self._hashed[number] = digest, value
        return digest

    def _is_whole(self, value: Any, home: Any, module: str) -> bool:
        """Whether more than the name counts: in the value's own module, or without a place."""
        if isinstance(value, type) and not str(home).startswith(self._prefix):
            return False
        return home == module or not _has_its_place(value)

    def _require_known(self, home: Any) -> None:
        """Raise `ForeignCode` for code of a module that others wrote."""
        if home in self._homes or home not in sys.modules:  # generated code states no module
            return
        root = home.partition(".")[0]
        if root not in sys.stdlib_module_names and not _is_inside(home, self._known):
            raise ForeignCode(f"{home} is not of {self._known}")
        self._homes.add(home)

    def _parts(self, value: Any, kind: type, home: Any) -> list[Any]:
        of = self._of
        if kind is FunctionType:
            around = [(name, of(one)) for name, one in _around(value)]
            return [_name(value), value.__code__, *around]
        if isinstance(value, type):
            members = [(name, of(one, home)) for name, one in _members(value)]
            return [_name(value), *map(_name, value.__bases__), *members]
        if isinstance(value, tuple | list):
            return [one if type(one) in _PLAIN else of(one) for one in value]
        if isinstance(value, dict | MappingProxyType):
            return [
                (key if type(key) is str else of(key), one if type(one) in _PLAIN else of(one))
                for key, one in value.items()
            ]
        if isinstance(value, set | frozenset):
            return sorted(_bytes(of(one)) for one in value)
        if isinstance(value, np.ndarray | np.generic | jax.Array):
            array = np.asarray(value)
            return [_name(kind), array.dtype.str, array.shape, array.tobytes()]
        if isinstance(value, _TOLD):
            return [repr(value)]
        self._require_known(kind.__module__)
        return [_name(value), *((name, of(one)) for name, one in self._attributes(value, kind))]

    def _attributes(self, value: Any, kind: type) -> list[tuple[str, Any]]:
        """Hashed attributes of an object: public ones of the package's own, functions of others."""
        for holder, names in _HOLDERS.items():
            if isinstance(value, holder):
                return [(name, getattr(value, name)) for name in names]
        wrapped = [("__wrapped__", value.__wrapped__)] if hasattr(value, "__wrapped__") else []
        own = kind.__module__.startswith(self._prefix)
        return wrapped + [
            (name, one)
            for name, one in sorted(getattr(value, "__dict__", {}).items())
            if isinstance(one, FunctionType)
            or (
                own
                and not name.startswith("_")
                and not isinstance(getattr(kind, name, None), _KEPT_RESULTS)
            )
        ]


def _bytes(tree: Any) -> bytes:
    return marshal.dumps(tree, _NO_REFERENCES)


def _hash(tree: Any) -> bytes:
    return hashlib.sha256(_bytes(tree)).digest()


def _is_of(function: FunctionType, module: str) -> bool:
    """Whether a module has the code of a function, and no decorator has said so."""
    return function.__module__ == module == function.__globals__.get("__name__")


def _around(function: FunctionType) -> list[tuple[str, Any]]:
    """What a function has besides its code: defaults, attributes and the cells of its closure."""
    around: list[tuple[str, Any]] = []
    if function.__defaults__:
        around.append(("defaults", function.__defaults__))
    if function.__kwdefaults__:
        around.append(("keyword defaults", function.__kwdefaults__))
    if function.__dict__:
        around.append(("attributes", function.__dict__))
    for cell in function.__closure__ or ():
        try:
            around.append(("cell", cell.cell_contents))
        except ValueError:
            around.append(("empty cell", None))
    return around


def _members(owner: type) -> list[tuple[str, Any]]:
    """A class's definitions by name, without those that pydantic and `abc` add on use."""
    return [
        (name, one)
        for name, one in sorted(vars(owner).items())
        if name not in _NOT_CODE and not name.startswith(("__pydantic", "_abc_"))
    ]


def _name(value: Any) -> str:
    return f"{getattr(value, '__module__', '')}:{getattr(value, '__qualname__', '')}"


def _has_its_place(value: Any) -> bool:
    """Whether a value is the object at the module and qualified name that it states."""
    qualname = getattr(value, "__qualname__", None)
    if not isinstance(qualname, str):
        return False
    place = sys.modules.get(str(getattr(value, "__module__", None)))
    for name in qualname.split("."):
        place = getattr(place, "__dict__", {}).get(name)
    return place is value
