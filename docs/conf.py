"""Sphinx settings."""

import jaxsat

project = "jaxsat"
author = "the jaxsat authors"
release = jaxsat.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"
html_theme = "furo"
html_title = "jaxsat"
exclude_patterns = ["_build"]
autodoc_typehints = "signature"
autodoc_member_order = "bysource"


def _keep_bars(app, what, name, obj, options, lines):
    """Docstrings write |w| for a length; reStructuredText would read a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    app.connect("autodoc-process-docstring", _keep_bars)
