"""Programs that do the same piece of work, each in a file of its own.

A file gives its contenders by a function `contenders()`. To add one, write a file and name it in
`FILES`, with the module that it needs if that may be missing.
"""

import importlib
import importlib.util
import sys

from contenders.contender import Contender

FILES = {
    "jaxsat_engines": None,
    "diffrax_plain": None,
    "lax_scan": None,
    "numba_loop": "numba",
    "scipy_dop853": "numba",
    "heyoka_taylor": "heyoka",
    "basilisk": "Basilisk",
}


def all_contenders() -> list[Contender]:
    """Every contender that can run here; a line on standard error tells of the others."""
    found = []
    for name, needed in FILES.items():
        if needed is None or importlib.util.find_spec(needed) is not None:
            found += importlib.import_module(f"contenders.{name}").contenders()
        else:
            print(f"contenders/{name}.py is skipped: {needed} is not installed", file=sys.stderr)
    return found
