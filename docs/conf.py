"""Sphinx settings."""

import sys
from pathlib import Path

import jaxsat
from jaxsat.scenario import json_schema

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "tools"))

import llms  # noqa: E402
import scenario_keys  # noqa: E402

project = "jaxsat"
author = "the jaxsat authors"
release = jaxsat.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "cyclopts.ext.sphinx"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # their outputs are kept, and docs/tools/notebooks.py checks them
html_theme = "furo"
html_title = "jaxsat"
exclude_patterns = ["_build", "tools"]
suppress_warnings = ["mystnb.unknown_mime_type"]
autodoc_typehints = "signature"
autodoc_member_order = "bysource"


def _keep_bars(app, what, name, obj, options, lines):
    """Docstrings write |w| for a length; reStructuredText would read a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def _write_scenario_keys(app):
    text = scenario_keys.page(json_schema())
    place = HERE / "scenario-keys.md"
    if not place.exists() or place.read_text(encoding="utf-8") != text:
        place.write_text(text, encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _write_scenario_keys)
    app.connect("autodoc-process-docstring", _keep_bars)
    app.connect("build-finished", llms.write)
