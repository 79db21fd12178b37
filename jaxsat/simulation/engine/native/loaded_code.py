"""Hashes of a package's code in memory, which reveal code that a program has changed there.

A program may replace functions, methods and constants of jaxsat: an experiment in a notebook, a
test, a tool that reloads edited modules. The hash of a module is over the code of its functions and
of the methods of its classes, with their defaults and closures, and over its constants. Processes
with the same module have the same hash, whatever else they have imported or done: a function or
class of another module counts by its name, and objects that a running program creates (locks,
counters, cached results) only by their type.
"""

import enum
import functools
import hashlib
import marshal
import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from types import FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any

import numpy as np

from jaxsat.core.once import once_property

_PLAIN = {int, bool, float, complex, str, bytes, type(None), type(...)}

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


def loaded_code(package: str) -> dict[str, bytes]:
    """A hash of every imported module inside a package, by name."""
    content = _Content(f"{package}.")
    return {name: content.hash_of(module) for name, module in _imported(package)}


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


class _Content:
    """Hashed content of values, as trees that `repr` distinguishes.

    Containers and objects, which many modules share, are represented by a hash of their tree.
    """

    def __init__(self, prefix: str):
        self._prefix = prefix
        self._hashes: dict[int, bytes] = {}
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
            ]
        )

    def _of(self, value: Any, module: str = "") -> Any:
        """The tree of a value; functions and classes of the `module` count as a whole."""
        kind = type(value)
        if kind in _PLAIN or isinstance(value, enum.Enum):
            return value
        if id(value) in self._above:
            self._circles += 1
            return "around this"
        if kind is ModuleType or not self._is_whole(value, module):
            return _name(kind), _name(value)
        if id(value) in self._hashes:
            return self._hashes[id(value)]
        circles = self._circles
        self._above.add(id(value))
        tree = _name(kind), *self._parts(value)
        self._above.remove(id(value))
        if self._circles == circles and not isinstance(value, type | FunctionType):
            self._hashes[id(value)] = tree = _hash(tree)
        return tree

    def _is_whole(self, value: Any, module: str) -> bool:
        """Whether more than the name counts: in the value's own module, or without a place."""
        home = getattr(value, "__module__", None)
        if isinstance(value, type) and not str(home).startswith(self._prefix):
            return False
        return home == module or not _has_its_place(value)

    def _parts(self, value: Any) -> Iterator[Any]:
        if isinstance(value, FunctionType):
            yield from (_name(value), _digest(marshal.dumps(value.__code__, _NO_REFERENCES)))
            yield from ((name, self._of(one)) for name, one in _around(value))
        elif isinstance(value, type):
            yield from (_name(value), *map(_name, value.__bases__))
            yield from ((name, self._of(one, value.__module__)) for name, one in _members(value))
        elif isinstance(value, np.ndarray | np.generic):
            yield from (value.dtype.str, value.shape, _digest(value.tobytes()))
        elif isinstance(value, dict | MappingProxyType):
            yield from ((self._of(key), self._of(one)) for key, one in value.items())
        elif isinstance(value, set | frozenset):
            yield from sorted(repr(self._of(one)) for one in value)
        elif isinstance(value, tuple | list):
            yield from map(self._of, value)
        else:
            yield _name(value)
            yield from ((name, self._of(one)) for name, one in self._attributes(value))

    def _attributes(self, value: Any) -> Iterator[tuple[str, Any]]:
        """Hashed attributes of an object: public ones of the package's own, functions of others."""
        if type(value) in _HOLDERS:
            yield from ((name, getattr(value, name)) for name in _HOLDERS[type(value)])
            return
        if hasattr(value, "__wrapped__"):
            yield "__wrapped__", value.__wrapped__
        own = type(value).__module__.startswith(self._prefix)
        for name, one in sorted(getattr(value, "__dict__", {}).items()):
            is_cache = isinstance(getattr(type(value), name, None), _KEPT_RESULTS)
            if isinstance(one, FunctionType) or (own and not is_cache and not name.startswith("_")):
                yield name, one


def _hash(tree: Any) -> bytes:
    return _digest(repr(tree).encode("utf-8", "surrogatepass"))


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).digest()


def _around(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """What a function has besides its code: defaults, attributes and the cells of its closure."""
    for name in ("__defaults__", "__kwdefaults__", "__dict__"):
        if one := getattr(function, name):
            yield name, one
    for cell in function.__closure__ or ():
        try:
            yield "cell", cell.cell_contents
        except ValueError:
            yield "empty cell", None


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
