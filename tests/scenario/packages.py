"""The plug-in package as an installer leaves it."""

import os
import shutil
import sys
import tomllib
from pathlib import Path

from jaxsat.scenario import plugins

FROZEN = Path(__file__).parents[1] / "frozen_0_2"
PACKAGE = FROZEN / "tsiotras-luo"


def install_package(site, monkeypatch, package=PACKAGE):
    """Put modules and a record of entry points into a folder of packages, for workers too."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    module = project["name"].replace("-", "_")
    shutil.copytree(package / module, site / module)
    record = site / f"{module}-{project['version']}.dist-info"
    record.mkdir()
    (record / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = []
    for group, points in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {place}" for name, place in points.items())]
    (record / "entry_points.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(site)
    plugins.installed.cache_clear()
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(site), *_inherited()])))


def forget_package():
    """Let the next test import the package anew, and look for installed ones again."""
    plugins.installed.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == "tsiotras_luo"]:
        del sys.modules[name]


def _inherited():
    return os.environ.get("PYTHONPATH", "").split(os.pathsep)
