"""The package itself: light to import, rooms on demand."""

import doctest
import importlib
import os
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import jaxsat
from jaxsat.core.errors import JaxsatError


def test_rooms_are_there_on_demand():
    assert jaxsat.controllability.analyse([1.0, 2.0, 2.5], [[1], [0], [0]]).rank == 2
    with pytest.raises(AttributeError, match="rooms"):
        _ = jaxsat.rooms


def test_import_is_light_and_switches_nothing():
    program = "import sys, jaxsat; print('jax' in sys.modules); import jax, jaxsat.simulation; "
    program += "print(jax.config.jax_enable_x64)"
    command = [sys.executable, "-c", program]
    # commands that other tests ran in this process have set it
    unset = {name: value for name, value in os.environ.items() if name != "JAX_ENABLE_X64"}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=unset)
    assert done.stdout.split() == ["False", "False"]


def test_no_module_takes_what_comes_on_demand_as_it_is_imported():
    """Its thread would wait for one that imports on demand, and that one for this module."""
    files = Path(jaxsat.__file__).parent.rglob("*.py")
    texts = {file: file.read_text(encoding="utf-8") for file in files}
    assert not [file for file, text in texts.items() if re.search("(?m)^from jaxsat import", text)]


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


def test_the_reference_has_every_public_name_and_no_other():
    text = (Path(__file__).parents[1] / "docs" / "api.md").read_text(encoding="utf-8")
    told = re.findall(r"(?m)^\.\. auto(?:function|class|exception):: jaxsat\.(\S+)$", text)
    public = set(dir(jaxsat)) - {"__version__"}
    assert sorted(name for name in told if "." not in name) == sorted(public)
    for name in told:
        assert pkgutil.resolve_name(f"jaxsat.{name}").__doc__


def test_the_names_that_the_changelog_gives_for_old_ones_are_there():
    text = (Path(__file__).parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\| `.* \| (.+) \|$", text)
    names = [name for row in rows for name in re.findall(r"`(jaxsat(?:\.\w+)+)", row)]
    assert "jaxsat.ComparisonSetting" in names
    for name in names:
        pkgutil.resolve_name(name)


def test_the_examples_of_the_errors_are_right():
    assert doctest.testmod(jaxsat.core.errors) == (0, 4)


def test_nothing_but_public_names_is_shown():
    assert set(dir(jaxsat)) == set(jaxsat.__all__)
    assert jaxsat.simulate is jaxsat.simulation.simulate
    assert not [name for name in dir(jaxsat) if name.startswith("_") and name != "__version__"]
    assert all(hasattr(jaxsat, name) for name in dir(jaxsat))


@pytest.mark.slow
def test_type_checkers_see_the_public_names(tmp_path):
    program = tmp_path / "program.py"
    program.write_text("import jaxsat\nreveal_type(jaxsat.simulate)\njaxsat.no_such_name\n")
    checker = Path(sys.executable).with_name("basedpyright")
    command = [checker, "--pythonpath", sys.executable, program]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "-> Trajectory" in done.stdout
    assert '"no_such_name" is not a known attribute' in done.stdout
