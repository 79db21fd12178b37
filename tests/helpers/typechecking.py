"""Calls of jaxsat checked against annotations, shapes of arrays among them.

A function is prepared at its first call: few of them are called in one process. Its first `CALLS`
calls in each test are checked: to check all takes a fifth of the time of tests. The compiler is
left to the static checks: it has no shapes, and calls by the million.
"""

import ast
import dataclasses
import functools
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable
from importlib.abc import MetaPathFinder
from importlib.machinery import PathFinder, SourceFileLoader
from types import CodeType, SimpleNamespace
from typing import Any, get_args, get_type_hints

from beartype import BeartypeConf, beartype
from jaxtyping import jaxtyped

PACKAGE = "jaxsat"
UNCHECKED = ("jaxsat.compiler", "jaxsat.simulation.engine.native")

CALLS = 2
"""Calls of a function that are checked in a test; and closures of a function within another."""

_one_at_a_time = threading.RLock()
_closures: Counter[int] = Counter()
_codes: dict[int, CodeType] = {}
"""The code of closures counted in a test, by `id`, so that no other gets the same one."""
_test = 0
_typed = beartype(conf=BeartypeConf(violation_type=TypeError))
_shapes = jaxtyped("context")
"""In it, an axis has one length wherever its name stands."""


def install() -> None:
    """Check all modules of jaxsat that are imported from now on."""
    sys.meta_path.insert(0, _Finder())


def begin_test() -> None:
    """Check the calls of a test from its first ones on."""
    global _test
    _test += 1
    _closures.clear()
    _codes.clear()


class _Finder(MetaPathFinder):
    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        if not _is_in(fullname, [PACKAGE]) or _is_in(fullname, UNCHECKED):
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def _is_in(module: str, packages: Iterable[str]) -> bool:
    return any(f"{module}.".startswith(f"{package}.") for package in packages)


class _Loader(SourceFileLoader):
    """Decorates all functions and classes, and neither reads nor writes bytecode."""

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        module = ast.parse(self.get_data(path), path)
        _decorate(module)
        return compile(module, path, "exec", dont_inherit=True)

    def exec_module(self, module: Any) -> None:
        module.__checked__ = checked
        super().exec_module(module)


def _decorate(block: ast.AST) -> None:
    for name in ("body", "handlers", "cases", "orelse", "finalbody"):
        statements = getattr(block, name, [])
        for one in statements if isinstance(statements, list) else []:
            if isinstance(one, ast.FunctionDef):  # below what would hide its annotations
                one.decorator_list.append(_decorator_at(one))
            elif isinstance(one, ast.ClassDef):  # above what makes it a dataclass
                one.decorator_list.insert(0, _decorator_at(one))
            _decorate(one)


def _decorator_at(place: ast.stmt) -> ast.expr:
    return ast.copy_location(ast.Name("__checked__", ast.Load()), place)


def checked(part: Any) -> Any:
    """The function, or the class with the constructor that its fields make, checked."""
    if not isinstance(part, type):
        return _checked(part) if part.__annotations__ else part
    if dataclasses.is_dataclass(part) and not hasattr(part.__init__, "is_checked"):
        part.__init__ = _checked(part.__init__)
    return part


def _checked(function: Callable) -> Callable:
    if _test:  # functions made at import are all checked
        code = id(function.__code__)
        _codes[code] = function.__code__
        _closures[code] += 1
        if _closures[code] > CALLS:
            return function
    call: Any = None
    has_shapes, count, test = False, 0, _test

    @functools.wraps(function)
    def checked_function(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        nonlocal call, has_shapes, count, test
        if test != _test:
            count, test = 0, _test
        if count >= CALLS:
            return function(*args, **kwargs)
        count += 1
        if call is None:
            with _one_at_a_time:
                function.__annotations__ = hints = _hints(function)
                has_shapes = any(map(_has_shape, hints.values()))
                call = _typed(function)
        if not has_shapes:
            return call(*args, **kwargs)
        with _shapes:
            return call(*args, **kwargs)

    checked_function.is_checked = True
    # For `jaxsat.compiler.trace` this is no place of an operation.
    checked_function.__code__ = checked_function.__code__.replace(co_filename="<checked>")
    return checked_function


def _hints(function: Callable) -> dict[str, Any]:
    """Its annotations; `Any` for names that a module imports for static checks alone."""
    hints: dict[str, Any] = {}
    for name, hint in function.__annotations__.items():
        alone = SimpleNamespace(__annotations__={name: hint})
        try:
            hints |= get_type_hints(alone, function.__globals__, include_extras=True)
        except NameError:
            hints[name] = Any
    return hints


def _has_shape(hint: Any) -> bool:
    if isinstance(hint, list):  # the arguments of a callable
        return any(map(_has_shape, hint))
    place = getattr(hint, "__module__", "") or ""
    return place.startswith("jaxtyping") or any(map(_has_shape, get_args(hint)))
