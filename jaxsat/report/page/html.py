"""The complete page: paths to sections, by the kind of each result, and sections to HTML."""

import dataclasses
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jaxsat
from jaxsat.core.errors import JaxsatError
from jaxsat.core.once import imported
from jaxsat.core.package_files import text_of
from jaxsat.report.document import (
    Chart,
    Charts,
    Document,
    Lines,
    ReplayScene,
    Verdict,
    cell_text,
    is_number,
    prose,
)
from jaxsat.scenario.plugins import without_imports
from jaxsat.store.dataset import open_trajectory
from jaxsat.store.files import OutputError, parse_json
from jaxsat.store.marker import read_unchanged, unverified

PACKAGES = ("bokeh", "jinja2")
"""Packages of the extra `report`."""

SCRIPTS = ("vectors.js", "painter.js", "craft.js", "replay.js", "page.js")
"""Scripts that the page joins into one module, in order of dependence."""


class MissingPackages(JaxsatError, ImportError):
    """Packages for making a page are not installed."""


def report_page(paths: Sequence[str | Path], *, title: str | None = None) -> str:
    """Return one HTML file of the results at these paths, which needs no network.

    A path is the folder of a run or its `trajectory.nc`, the store of a study, or the folder of a
    tuning, a comparison, a design, a verification, a rare event, a worst case, a reproduction or an
    analysis of controllability. The order is kept. Raises `OutputError` for a path without result
    or with a damaged one, and `MissingPackages` where Bokeh or Jinja2 are not installed.
    """
    require_packages()

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
    """Return the HTML of sections."""
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
    from markupsafe import Markup, escape

    parts = ((is_code, escape(piece)) for is_code, piece in prose(text))
    return Markup(
        "".join(f"<code>{piece}</code>" if is_code else piece for is_code, piece in parts)
    )


def _window(section: Document) -> dict[str, Any] | None:
    """Return the script's data of a section's plots over time."""
    if section.plots is None:
        return None
    start, end = section.plots.reset
    ids = {"range": section.plots.range.id, "cursor": section.plots.cursor.id}
    return {**ids, "start": start, "end": end}


def _inks(charts: Sequence[Chart]) -> dict[str, list[str]]:
    """Return the ids of models whose colours follow those of the page, by tag."""
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


MOST_TOGETHER = 6
"""Largest number of spacecraft that are replayed side by side."""


MADE_BY: Mapping[str, tuple[str, str]] = {
    "zarr.json": ("study", "study_section"),
    "verdict.json": ("batches", "tuning_section"),
    "comparison.json": ("batches", "record_section"),
    "design.json": ("batches", "design_section"),
    "verification.json": ("batches", "record_section"),
    "rare-event.json": ("batches", "record_section"),
    "worst-case.json": ("batches", "record_section"),
    "failures.nc": ("batches", "controllability_section"),
    "verdicts.md": ("batches", "reproduction_section"),
}
"""Module and function of each kind of section, by a file that only that kind of result has;
imported on demand."""


def sections_of(paths: Sequence[Path]) -> list[Document]:
    """Return a section for each path; with several runs one more before them, which replays all.

    No module that a result names is imported. Raises `OutputError` for a path without result or
    with a damaged one.
    """
    with without_imports():
        sections = [_told_if_unverified(path, _section(path)) for path in paths]
    crafts = [
        craft
        for section in sections
        for block in section.blocks
        if isinstance(block, ReplayScene)
        for craft in block.crafts
    ]
    if not 1 < len(crafts) <= MOST_TOGETHER:
        return sections
    verdict = Verdict(None, f"{len(crafts)} runs on a common time axis.")
    return [
        Document("Side by side", verdict, [ReplayScene("3-D replay", crafts)], "Replay"),
        *sections,
    ]


def _told_if_unverified(path: Path, section: Document) -> Document:
    """Begin a section with a remark if no marker verifies its files; stores have own checks."""
    is_store = (path / "zarr.json").is_file()
    remark = None if is_store else unverified(path if path.is_dir() else path.parent)
    if remark is None:
        return section
    return dataclasses.replace(section, blocks=[Lines("Not verified", [remark]), *section.blocks])


def _section(path: Path) -> Document:
    if not path.exists():
        raise OutputError(f"{path} does not exist.")
    if path.is_file() or (path / "trajectory.nc").is_file():
        return _run(path)
    for name, maker in MADE_BY.items():
        if (path / name).is_file():
            return _maker(*maker)(path)
    raise OutputError(
        f"{path} is no result of jaxsat; give the folder of a run, a tuning, a comparison, a "
        "design, a verification, a rare event, a worst case, a reproduction or an analysis of "
        "controllability, or the store of a study."
    )


def _run(path: Path) -> Document:
    dataset = open_trajectory(path)
    if not {"time", "quaternion", "pointing_error_total", "omega"} <= set(dataset.variables):
        raise OutputError(f"{path} contains no trajectory.")
    record = parse_json(read_unchanged(path / "run.json")) if path.is_dir() else None
    command = record.get("command", "") if isinstance(record, Mapping) else ""
    return _maker("run", "run_section")(dataset, path.name, str(command))


def _maker(module: str, function: str) -> Callable[..., Document]:
    return getattr(imported(f"jaxsat.report.page.{module}"), function)
