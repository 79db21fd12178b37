"""The package itself: light to import, rooms on demand."""

import importlib
import pkgutil
import subprocess
import sys

import pytest

import jaxsat
from jaxsat.errors import JaxsatError


def test_rooms_are_there_on_demand():
    assert jaxsat.controllability.analyse([1.0, 2.0, 2.5], [[1], [0], [0]]).rank == 2
    with pytest.raises(AttributeError, match="rooms"):
        _ = jaxsat.rooms


def test_import_is_light_and_switches_nothing():
    program = "import sys, jaxsat; print('jax' in sys.modules); import jax, jaxsat.simulation; "
    program += "print(jax.config.jax_enable_x64)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "False"]


def modules():
    """All of the package's, but what begins a program."""
    names = (found.name for found in pkgutil.walk_packages(jaxsat.__path__, "jaxsat."))
    return [importlib.import_module(name) for name in names if not name.endswith("__main__")]


def test_all_errors_that_users_may_meet_have_one_base():
    """The command line's own end the program, and system errors of the cache never leave it."""
    found = {
        one
        for module in modules()
        for one in vars(module).values()
        if isinstance(one, type)
        and issubclass(one, Exception)
        and not issubclass(one, Warning)
        and one.__module__ == module.__name__
        if not (module.__name__.startswith("jaxsat.cli") or one.__name__.startswith("_"))
    }
    assert {one.__name__ for one in found if not issubclass(one, JaxsatError)} == {"NotPrivate"}
    assert {"OutputError", "ScenarioError", "CannotLower"} <= {one.__name__ for one in found}
