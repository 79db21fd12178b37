"""Sections of a page from paths: recognises the kind of each result."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from jaxsat.core.once import imported
from jaxsat.report.document import Document, Lines, ReplayScene, Verdict
from jaxsat.scenario.plugins import without_imports
from jaxsat.store.dataset import open_trajectory
from jaxsat.store.files import OutputError, parse_json
from jaxsat.store.marker import read_unchanged, unverified

MOST_TOGETHER = 6
"""Spacecraft that are replayed side by side."""


MADE_BY: Mapping[str, tuple[str, str]] = {
    "zarr.json": ("study", "study_section"),
    "verdict.json": ("batches", "tuning_section"),
    "comparison.json": ("batches", "comparison_section"),
    "design.json": ("batches", "design_section"),
    "verification.json": ("batches", "verification_section"),
    "rare-event.json": ("batches", "rare_event_section"),
    "failures.nc": ("batches", "controllability_section"),
    "verdicts.md": ("batches", "reproduction_section"),
}
"""Module and function that make the section of a folder, by a file that only its kind of result
has; imported when there is one."""


def sections_of(paths: Sequence[Path]) -> list[Document]:
    """A section for each path; with several runs one more before them, which replays all at once.

    No module that a result names is imported.
    Raises `OutputError` for what is no result of jaxsat or is damaged.
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
    """A section that says first where no marker vouches for its files; a store does that itself."""
    is_store = (path / "zarr.json").is_file()
    remark = None if is_store else unverified(path if path.is_dir() else path.parent)
    if remark is None:
        return section
    return dataclasses.replace(section, blocks=[Lines("Not verified", [remark]), *section.blocks])


def _section(path: Path) -> Document:
    """The section of one path, made by what is there."""
    if not path.exists():
        raise OutputError(f"{path} does not exist.")
    if path.is_file() or (path / "trajectory.nc").is_file():
        return _run(path)
    for name, maker in MADE_BY.items():
        if (path / name).is_file():
            return _maker(*maker)(path)
    raise OutputError(
        f"{path} is no result of jaxsat; give the folder of a run, a tuning, a comparison, a "
        "design, a verification, a rare event, a reproduction or an analysis of controllability, "
        "or the store of a study."
    )


def _run(path: Path) -> Document:
    """The section of a run: of its folder, or of its netCDF file alone."""
    dataset = open_trajectory(path)
    if not {"time", "quaternion", "pointing_error_total", "omega"} <= set(dataset.variables):
        raise OutputError(f"{path} contains no trajectory.")
    record = parse_json(read_unchanged(path / "run.json")) if path.is_dir() else None
    command = record.get("command", "") if isinstance(record, Mapping) else ""
    return _maker("run", "run_section")(dataset, path.name, str(command))


def _maker(module: str, function: str) -> Callable[..., Document]:
    return getattr(imported(f"jaxsat.report.page.{module}"), function)
