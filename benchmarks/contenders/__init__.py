"""Programs that do the same piece of work, each in a file of its own.

A file gives its contenders by a function `contenders()`, an empty list where what it needs is not
installed. To add one, write a file and name it in `FILES`.
"""

import importlib

from contenders.contender import Contender

FILES = (
    "jaxsat_engines",
    "diffrax_plain",
    "lax_scan",
    "numba_loop",
    "scipy_dop853",
    "basilisk",
)


def all_contenders() -> list[Contender]:
    """Every contender that can run here."""
    found = [importlib.import_module(f"contenders.{name}").contenders() for name in FILES]
    return [contender for several in found for contender in several]
