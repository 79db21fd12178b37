"""What a comparison leaves in its folder: a record and figures."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jaxsat.store import ResumableFolder, command_line, provenance
from jaxsat.synthesis.comparison.acceptance import horizon
from jaxsat.synthesis.comparison.verdict import ComparisonRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORD = "comparison.json"

Panel = tuple[str, float | None]
"""Level and torque limit (N m) of a panel of the figure."""


def write_record(
    folder: ResumableFolder, data: Mapping[str, Any], figures: "Callable[[], dict[str, Figure]]"
) -> None:
    """The record as JSON, with what made it, and the figures; raises `OutputError`."""
    from jaxsat.report.saving import save_figures

    record = {"command": command_line(), **data, **provenance()}
    folder.write(RECORD, json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    save_figures(figures, folder.write)


def acceptance_figures(rows: Sequence[ComparisonRow]) -> "dict[str, Figure]":
    """Settling times on the acceptance set, a panel for every limit and level."""
    from jaxsat.report.comparison_figures import settling_comparison

    panels: dict[Panel, dict[str, Any]] = {}
    for row in rows:
        panels.setdefault(row.setting[:2], {})[row.setting.law] = row.settling_times
    horizons = {row.setting[:2]: horizon(row.setting.torque_limit) for row in rows}
    title = "Three axes with two torques, third rate free"
    return {"comparison": settling_comparison(panels, horizons, title)}


def scenario_figures(
    title: str, duration: float, rows: Sequence[ComparisonRow], recovered: Mapping[str, Any]
) -> "dict[str, Figure]":
    """Settling times in a scenario that lasts `duration` s, and what recovered under each law."""
    from jaxsat.report.comparison_figures import recovery_comparison, settling_comparison

    panel: Panel = ("the same cases under every law", None)
    times = {row.setting.law: row.settling_times for row in rows}
    figures = {"comparison": settling_comparison({panel: times}, {panel: duration}, title)}
    if recovered:
        figures["recovered"] = recovery_comparison(recovered, title)
    return figures
