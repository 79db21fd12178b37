"""Source distribution, wheel and recipes: what they contain, and what the wheel does in an
environment with nothing else, on each Python that jaxsat supports."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import jaxsat
from jaxsat.scenario.read import library

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [line.split(" :: ")[-1] for line in PROJECT["classifiers"] if ":: 3." in line]
BESIDE = {"CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "SECURITY.md", "pyproject.toml"}
"""Files of the source distribution besides the package."""

OPTIONAL = {"bokeh", "casadi", "cma", "dask", "distributed", "jinja2"}
"""Packages of extras that modules import as they are imported."""

PROGRAM = """
import importlib, json, pkgutil
import jaxsat
lacking = set()
for found in pkgutil.walk_packages(jaxsat.__path__, "jaxsat."):
    if not found.name.endswith("__main__"):
        try:
            importlib.import_module(found.name)
        except ModuleNotFoundError as error:
            lacking.add(error.name)
print(json.dumps([jaxsat.__file__, sorted(lacking)]))
"""
"""Imports every module; prints where the package is, and which packages its modules lack."""


def run(*command, cwd, status=0):
    """Return standard output of a program, which must end with the status, as users run it."""
    ours = {"PYTHONPATH", "XLA_FLAGS"}
    kept = {name: text for name, text in os.environ.items() if name not in ours}
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd, env=kept)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


def uv(*arguments):
    return run(sys.executable, "-m", "uv", *arguments, cwd=ROOT)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Files and contents of the source distribution, of the wheel made of it, and of the wheel
    made of the tree; and the path of the former wheel."""
    pytest.importorskip("uv")
    folder = tmp_path_factory.mktemp("distributions")
    uv("build", "--quiet", "--out-dir", folder / "both")
    uv("build", "--quiet", "--wheel", "--out-dir", folder / "direct")
    (source,) = (folder / "both").glob("*.tar.gz")
    (wheel,) = (folder / "both").glob("*.whl")
    with tarfile.open(source) as archive:
        members = [one for one in archive.getmembers() if one.isfile()]
        contents = {one.name.partition("/")[2]: archive.extractfile(one).read() for one in members}
    (direct,) = (folder / "direct").glob("*.whl")
    return contents, unpacked(wheel), unpacked(direct), wheel


def unpacked(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.slow
def test_wheel_and_source_distribution_have_every_file_of_the_package(built):
    source, wheel, direct, _ = built
    found = (file for file in (ROOT / "jaxsat").rglob("*") if file.is_file())
    package = {
        file.relative_to(ROOT).as_posix(): file.read_bytes()
        for file in found
        if "__pycache__" not in file.parts
    }
    assert {"jaxsat/py.typed", "jaxsat/scenario/library/paper-rate.toml"} <= set(package)
    metadata = {name for name in wheel if ".dist-info/" in name}
    assert {name: wheel[name] for name in set(wheel) - metadata} == package
    assert {name: source[name] for name in source if name.startswith("jaxsat/")} == package
    assert BESIDE | {"PKG-INFO"} == {name for name in source if "/" not in name} - {".gitignore"}
    assert direct == wheel


@pytest.mark.slow
@pytest.mark.parametrize("version", PYTHONS)
def test_the_wheel_works_in_an_empty_environment(built, tmp_path, version):
    python = interpreter(version)
    uv("venv", "--quiet", "--python", python, tmp_path / "environment")
    programs = tmp_path / "environment" / "bin"
    uv("pip", "install", "--quiet", "--python", programs / "python", built[-1])

    def command(*tokens, status=0):
        return run(programs / "jaxsat", *tokens, cwd=tmp_path, status=status)

    assert command("--version") == f"{jaxsat.__version__}\n"
    assert set(library()) <= set(command("scenarios", "list").split())
    place, lacking = json.loads(run(programs / "python", "-c", PROGRAM, cwd=tmp_path))
    assert Path(place).is_relative_to(tmp_path)
    assert set(lacking) <= OPTIONAL
    command("simulate", "paper-rate", "--set", "simulation.duration_s=5", "--out", "run")
    command("report", "run", status=2)  # names the extra
    if version == PYTHONS[0]:  # the same packages make the others
        command("simulate", "thruster-dies", "--set", "simulation.duration_s=20", "--out", "pulses")
        assert "controllable" in command("controllability", "thruster-dies")


def interpreter(version):
    """The path of a Python of this version; skips the test where there is none."""
    root = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    places = [f"python{version}", *root.glob(f"versions/{version}.*/bin/python3")]
    for place in filter(None, map(shutil.which, places)):
        if subprocess.run([place, "--version"], capture_output=True, check=False).returncode == 0:
            return place  # a shim of pyenv may name a Python that is not in use
    return pytest.skip(f"needs the tool python{version}")


def test_version_is_the_same_everywhere():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    recipe = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8"))
    assert str(citation["version"]) == recipe["context"]["version"] == jaxsat.__version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\n## {jaxsat.__version__} (" in changes


def test_the_recipe_requires_what_the_wheel_requires():
    recipe = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8"))
    required = [re.split(r" *(?=>=)", one.partition(";")[0]) for one in PROJECT["dependencies"]]
    names = {"matplotlib": "matplotlib-base"}
    expected = {f"{names.get(name, name)} {bound}".strip() for name, bound in required}
    oldest = recipe["context"]["python_min"]
    assert PROJECT["requires-python"] == f">={oldest}"
    assert set(recipe["requirements"]["run"]) - expected == {"python >=${{ python_min }}"}
    assert expected <= set(recipe["requirements"]["run"])
    scripts = [" = ".join(one) for one in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts


def test_scripts_in_exports_name_their_licence():
    assets = ROOT / "jaxsat" / "flight" / "assets"
    scripts = [*assets.rglob("*.py"), assets / "Makefile", *assets.rglob("CMakeLists.txt")]
    assert len(scripts) > 4
    for script in scripts:
        first = script.read_text(encoding="utf-8").split("\n")[0]
        assert first == f"# SPDX-License-Identifier: {PROJECT['license']}", script
