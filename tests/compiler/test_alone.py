"""The compiler stands alone: it is imported without any room of the package but the core."""

import subprocess
import sys

PROGRAM = """
import importlib, pkgutil, sys
import jaxsat.compiler
for module in pkgutil.walk_packages(jaxsat.compiler.__path__, "jaxsat.compiler."):
    importlib.import_module(module.name)
print(*sorted({name.split(".")[1] for name in sys.modules if name.startswith("jaxsat.")}))
"""


def test_the_compiler_needs_the_core_alone():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["compiler", "core"]
