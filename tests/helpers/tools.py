"""Programs and packages that some tests need and that need not be there."""

import os
import re
import shutil
import sys
from collections import Counter
from collections.abc import Iterable
from importlib.util import find_spec
from typing import Any

import pytest

PROGRAMS = {
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
    "firefox": ("firefox-esr", "firefox"),
    "slurm": ("sbatch",),
    "taplo": ("taplo", os.path.join(os.path.dirname(sys.executable), "taplo")),  # a wheel
}
"""Names of executables where they are not the tool's own."""

MODULES = ("Basilisk", "casadi", "cma", "distributed", "fmpy", "heyoka")

REQUIRED = "JAXSAT_TOOLS"
"""Environment variable with the tools, separated by spaces, whose tests must run."""

_REASON = re.compile(r"needs the tool (\S+)|could not import '([^'.]+)")


def executable(tool: str) -> str | None:
    """The path of a program, or None where it is not installed."""
    return next(filter(None, map(shutil.which, PROGRAMS.get(tool, (tool,)))), None)


def is_installed(tool: str) -> bool:
    """Whether a program or module is there."""
    return find_spec(tool) is not None if tool in MODULES else executable(tool) is not None


def needs(tool: str) -> pytest.MarkDecorator:
    """Skip a test, and count it, where a tool is not installed."""
    return pytest.mark.skipif(not is_installed(tool), reason=f"needs the tool {tool}")


def missing_in(reasons: Iterable[Any]) -> Counter[str]:
    """How many tests were skipped for each tool, by the reports' `longrepr`.

    Those that `pytest.importorskip` skips are among them.
    """
    texts = (reason[2] if isinstance(reason, tuple) else str(reason) for reason in reasons)
    found = filter(None, map(_REASON.search, texts))
    return Counter(match[1] or match[2] for match in found)


def absent_of_required() -> list[str]:
    """The tools that must be there and are not."""
    return [tool for tool in os.environ.get(REQUIRED, "").split() if not is_installed(tool)]
