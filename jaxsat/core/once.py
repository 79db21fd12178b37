"""Memoisation for threads: a value is computed once, and threads that need it meanwhile wait.

`functools.cache` and `functools.lru_cache` let two threads compute one value at once, and so does
`functools.cached_property` from Python 3.12 on. One of the two is then freed, or replaces the
other, while a thread still uses it: for machine code that is a crash.
"""

import functools
import importlib
import threading
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import ModuleType
from typing import Any, Generic, ParamSpec, TypeVar, overload

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def holding(variable: ContextVar[T], value: T) -> Iterator[None]:
    """Set a context variable to a value inside the `with` block."""
    before = variable.set(value)
    try:
        yield
    finally:
        variable.reset(before)


def once(function: Callable[P, T]) -> Callable[P, T]:
    """`functools.cache` with a lock: for equal arguments the function is called once.

    The function may call itself, but no thread that it waits for may call it.
    """
    return latest(None)(function)


def latest(most: int | None) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """`once` for at most `most` arguments: the least recently used are forgotten."""

    def guarded(function: Callable[P, T]) -> Callable[P, T]:
        lock = threading.RLock()
        memo = functools.lru_cache(most)(function)  # noqa: TID251

        @functools.lru_cache(most)  # noqa: TID251
        def found(*args: Any, **keywords: Any) -> T:
            with lock:
                return memo(*args, **keywords)

        def forget(clear: Callable[[], None] = found.cache_clear) -> None:
            with lock:
                memo.cache_clear()
                clear()

        found.cache_clear = forget
        return functools.update_wrapper(found, function)  # pyright: ignore[reportReturnType]

    return guarded


class Locks:
    """A lock for every key: different keys do not wait for one another.

    A lock exists only while it is held or awaited, so the number of keys is unlimited.
    """

    def __init__(self):
        self._guard = threading.Lock()
        self._known: dict[Hashable, tuple[threading.RLock, list[None]]] = {}

    @contextmanager
    def __call__(self, key: Hashable) -> Iterator[None]:
        """Hold the lock of a key; the holding thread may enter again."""
        with self._guard:
            lock, users = self._known.setdefault(key, (threading.RLock(), []))
            users.append(None)
        try:
            with lock:
                yield
        finally:
            with self._guard:
                users.pop()
                if not users:
                    del self._known[key]


_importing = threading.RLock()


def imported(module: str) -> ModuleType:
    """Import a module at its first use, one thread at a time.

    Where packages import one another in a circle, as JAX's do, threads that enter by different
    modules would see incomplete ones. No module may call this during its own import: its thread
    holds Python's lock of that module, for which the thread with this lock may wait.
    """
    with _importing:
        return importlib.import_module(module)


_locks = Locks()


class once_property(Generic[T]):
    """`functools.cached_property` with a lock for every object.

    The value is in the object's `__dict__`, which copying and pickling preserve; frozen classes may
    use it. There is no lock in the object.
    """

    def __init__(self, function: Callable[[Any], T]):
        self._function, self.__doc__ = function, function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> "once_property[T]": ...
    @overload
    def __get__(self, instance: object, owner: type | None = None) -> T: ...
    def __get__(self, instance: object | None, owner: type | None = None):
        """Return the value; Python calls this only while `__dict__` has none."""
        if instance is None:
            return self
        attributes = vars(instance)
        with _locks((id(instance), self._name)):  # the caller keeps the object, so its id is unique
            if self._name not in attributes:
                attributes[self._name] = self._function(instance)
            return attributes[self._name]
