"""The complete page: sections to self-contained HTML."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jaxsat
from jaxsat.core.errors import JaxsatError
from jaxsat.core.package_files import text_of
from jaxsat.report.document import Chart, Charts, Document, cell_text, is_number, prose

PACKAGES = ("bokeh", "jinja2")
"""What the extra `report` installs."""

SCRIPTS = ("vectors.js", "painter.js", "craft.js", "replay.js", "page.js")
"""Scripts that the page puts into one module, in the order in which they build on each other."""


class MissingPackages(JaxsatError, ImportError):
    """The packages that a page is made with are not installed."""


def report_page(paths: Sequence[str | Path], *, title: str | None = None) -> str:
    """One HTML file of the results at these paths, which needs no network.

    A path is the folder of a run or its `trajectory.nc`, the store of a study, or the folder of a
    tuning, a comparison, a design, a reproduction or an analysis of controllability. The order
    stays. Raises `OutputError` for what is no result or is damaged, and `MissingPackages` where
    Bokeh or Jinja2 are not installed.
    """
    require_packages()
    from jaxsat.report.page.sources import sections_of

    sections = sections_of([Path(path) for path in paths])
    several = f"{len(paths)} results of jaxsat"
    return render(sections, title or (sections[0].title if len(paths) == 1 else several))


def require_packages() -> None:
    """Raise `MissingPackages` where a page could not be made."""
    missing = [name for name in PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        names = " and ".join(missing)
        raise MissingPackages(f"a report needs {names}: pip install 'jaxsat[report]'")


def render(sections: Sequence[Document], title: str) -> str:
    """The HTML of some sections."""
    from bokeh.document import Document as Models
    from bokeh.embed import components
    from bokeh.resources import Resources
    from jinja2 import Environment, PackageLoader, select_autoescape

    charts = [
        chart
        for section in sections
        for block in section.blocks
        if isinstance(block, Charts)
        for chart in block.charts
    ]
    script, places = "", {}
    if charts:
        keys = {f"chart{number}": chart.figure for number, chart in enumerate(charts)}
        models = Models()
        with models.models.freeze():  # each alone goes through all that are there
            for figure in keys.values():
                models.add_root(figure)
        script, divs = components(keys, wrap_script=False)
        places = {id(chart.figure): divs[key] for key, chart in zip(keys, charts, strict=True)}
    environment = Environment(
        loader=PackageLoader("jaxsat.report.page", "assets"),
        autoescape=select_autoescape(["html"]),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "prose": _prose,
        "cell_text": cell_text,
        "sorted_by": lambda cell: getattr(cell, "value", cell),
    }
    environment.tests["quantity"] = is_number
    library = Resources(mode="inline", minified=True, components=["bokeh"]).js_raw if charts else []
    page = environment.get_template("page.html")
    return page.render(
        title=title,
        version=jaxsat.__version__,
        sections=sections,
        style=_asset("page.css"),
        library=library,
        plots=script,
        places=places,
        pointer=id,
        scripts=[_asset(name) for name in SCRIPTS],
        told={"windows": [_window(section) for section in sections], "inks": _inks(charts)},
    )


def _prose(text: str) -> str:
    """Prose with what a reader types as code."""
    from markupsafe import Markup, escape

    parts = ((is_code, escape(piece)) for is_code, piece in prose(text))
    return Markup(
        "".join(f"<code>{piece}</code>" if is_code else piece for is_code, piece in parts)
    )


def _window(section: Document) -> dict[str, Any] | None:
    """What the script needs to know of the plots of a section over time."""
    if section.plots is None:
        return None
    start, end = section.plots.reset
    ids = {"range": section.plots.range.id, "cursor": section.plots.cursor.id}
    return {**ids, "start": start, "end": end}


def _inks(charts: Sequence[Chart]) -> dict[str, list[str]]:
    """The models whose colours go with those of the page, by tag."""
    from jaxsat.report.page.plots import INKS

    models: dict[str, set[str]] = {ink: set() for ink in INKS}
    for chart in charts:
        for model in chart.figure.references():
            for ink in INKS:
                if ink in model.tags:
                    models[ink].add(model.id)
    return {ink: sorted(ids) for ink, ids in models.items()}


def _asset(name: str) -> str:
    return text_of("jaxsat.report.page", f"assets/{name}")
