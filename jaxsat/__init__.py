"""Differentiable simulator and gain tuner for spacecraft that have lost thrusters or wheels.

The names for users are those of `__init__.pyi`, each imported when it is first used, so that
`import jaxsat` takes no time and imports no JAX. Modules come the same way:
`jaxsat.controllability.analyse(...)`.
"""

import ast
import importlib.util
import sys
import time
from pathlib import Path
from typing import Any

from jaxsat.core.once import imported

IMPORTED_NS = time.time_ns()
"""When this was imported, before all other modules of the package but `once`."""

__version__ = "0.2.0"

if not getattr(sys, "_is_gil_enabled", lambda: True)():
    raise ImportError(
        "jaxsat must have a Python with its global interpreter lock, for threads of its machine "
        f"code are tested with it alone, but got the free-threaded {sys.version.split()[0]}"
    )


def _homes() -> dict[str, str]:
    """The module of each name for users, as type checkers read it."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = (node for node in stub.body if isinstance(node, ast.ImportFrom))
    return {alias.name: str(node.module) for node in imports for alias in node.names}


_HOMES = _homes()
__all__ = ["__version__", *_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(imported(_HOMES[name]), name)
    place = f"jaxsat.{name}"
    if not name.startswith("_") and importlib.util.find_spec(place) is not None:
        return imported(place)
    raise AttributeError(f"module 'jaxsat' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
