"""Differentiable simulator and gain tuner for spacecraft that have lost thrusters.

Rooms are imported when first used: `import jaxsat; jaxsat.controllability.analyse(...)`.
"""

import importlib
import pkgutil
from types import ModuleType

__version__ = "0.1.0"


def __getattr__(name: str) -> ModuleType:
    if name in __dir__():
        return importlib.import_module(f"jaxsat.{name}")
    raise AttributeError(f"module 'jaxsat' has no attribute {name!r}")


def __dir__() -> list[str]:
    found = (module.name for module in pkgutil.iter_modules(__path__))
    return sorted(name for name in found if not name.startswith("_"))
