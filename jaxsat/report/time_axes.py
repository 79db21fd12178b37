"""Common parts of figures of signals over time."""

import tomllib
from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from jaxsat.report.style import LINES, escape_mathematics
from jaxsat.store.labels import part_names

Span = tuple[float, float]

DIAGNOSED = ("dead", "degraded", "stuck on", "stuck at a level", "leaking", "reversed",
             "friction up", "runaway", "stopped")  # fmt: skip
"""Kinds of failure by the numbers of `jaxsat.control.diagnosis.DiagnosedKind`."""

MOST_ENTRIES = 6
"""Of a legend with modes, in one row."""

MOST_VERDICTS = 6
"""Alarms and verdicts that a figure names."""


def figure_title(dataset: xr.Dataset, subject: str, title: str) -> str:
    """The title that is given, or that of the run and a subject."""
    return title or f"{dataset.attrs.get('title', 'Trajectory')}: {subject}"


def draw_lines(axes: Axes, time, values, labels: Sequence[str], *, legend: bool = True) -> None:
    """A line for every label over time (s), in styles that tell them apart without colour."""
    for column, (label, style) in enumerate(zip(labels, LINES, strict=False)):
        axes.plot(time, np.asarray(values)[:, column], label=label, **style)
    if legend:
        place_legend(axes, len(labels))


def place_legend(axes: Axes, count: int) -> None:
    """The legend above a panel, in rows of one more than `count` entries."""
    axes.legend(
        loc="lower right",
        ncols=count + 1,
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.1,
        frameon=False,
    )


def finish(
    dataset: xr.Dataset, axes: Sequence[Axes], enlarged: Axes | None = None, zoom: Span = (0, 0)
) -> None:
    """Time axes from the start to the end, or over `zoom` (s), and their label under the lowest.

    A vertical line marks each failure in flight, and each alarm and verdict of a law that diagnoses
    its actuators, with their names in the uppermost panel.
    """
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    for row, (at, name) in enumerate([*failures(dataset), *verdicts(dataset)]):
        for panel in (*axes, *(() if enlarged is None else (enlarged,))):
            _mark(panel, at, name if panel is axes[0] else "", row)
    for one in axes:
        one.set_xlim(start, end)
    if enlarged is not None:
        enlarged.set_xlim(*zoom)
    lowest = axes[-1] if enlarged is None else enlarged
    lowest.set_xlabel("time (s)")


def failures(dataset: xr.Dataset) -> list[tuple[float, str]]:
    """When (s) something fails during the run, and what, by the scenario; in order of time."""
    tables = tomllib.loads(dataset.attrs.get("scenario", "")).get("failure", [])
    end = float(dataset["time"][-1])
    return sorted(
        (float(one["at_s"]), f"{one['of']}: {one['kind']}") for one in tables if one["at_s"] <= end
    )


def verdicts(dataset: xr.Dataset) -> list[tuple[float, str]]:
    """When (s) a law that diagnoses its actuators had its first alarms, and what it isolated."""
    if "diagnosed_kind" not in dataset:
        return []
    time, kinds = dataset["time"].values, dataset["diagnosed_kind"].values
    alarm = [mode for mode, name in mode_names(dataset).items() if name == "alarm"]
    in_alarm = np.isin(dataset["mode"].values, alarm)
    found = [(float(time[row]), "alarm") for row in np.flatnonzero(np.diff(in_alarm * 1) > 0) + 1]
    part = diagnosed_part(dataset)
    names = part_names(dataset.attrs.get("scenario", ""), part, kinds.shape[1])
    for row, thruster in np.argwhere(np.diff(kinds, axis=0) != 0):
        kind = kinds[row + 1, thruster]
        if np.isfinite(kind):
            verdict = f"isolated, {DIAGNOSED[int(kind)]}" if kind >= 0 else "works again"
            found.append((float(time[row + 1]), f"{part} {names[thruster]}: {verdict}"))
    return sorted(found)[:MOST_VERDICTS]


def diagnosed_part(dataset: xr.Dataset) -> str:
    """What the law of a run diagnoses: "thruster" or "wheel"."""
    return str(dataset["diagnosed_kind"].dims[-1])


def _mark(axes: Axes, at: float, name: str, row: int = 0) -> None:
    axes.axvline(at, color="black", linewidth=0.9, linestyle=(0, (1, 1.5)))
    if name:
        axes.text(
            at,
            0.97 - 0.13 * (row % 4),
            f" {escape_mathematics(name)}",
            transform=axes.get_xaxis_transform(),
            verticalalignment="top",
            fontsize="small",
            bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1},
        )


def shade_modes(dataset: xr.Dataset, axes: Axes) -> None:
    """Bands of grey, each with its name, where a sampled controller is not in its usual mode.

    That is mode 0 or, without one, the mode in which the run ends.
    """
    names, modes = mode_names(dataset), dataset["mode"].values
    last = modes[np.isfinite(modes)][-1:]
    usual = 0 if 0 in names else int(last.sum())
    unusual = [mode for mode in names if mode != usual]
    for grey, mode in zip(np.linspace(0.7, 0.9, max(len(unusual), 1)), unusual, strict=False):
        axes.fill_between(
            dataset["time"],
            0,
            1,
            where=dataset["mode"].values == mode,
            transform=axes.get_xaxis_transform(),
            color=str(grey),
            linewidth=0,
            step="post",
            label=escape_mathematics(names[mode]),
        )
    if unusual:
        entries = 3 + len(unusual)
        place_legend(axes, entries if entries <= MOST_ENTRIES else (entries - 1) // 2)


def mode_names(dataset: xr.Dataset) -> dict[int, str]:
    """What the numbers of `mode` mean, those that occur."""
    attributes = dataset["mode"].attrs
    meanings = str(attributes.get("flag_meanings", "")).split()
    values = np.atleast_1d(attributes.get("flag_values", [])).astype(int).tolist()
    found = set(dataset["mode"].values[np.isfinite(dataset["mode"].values)].astype(int).tolist())
    return {
        mode: meaning.replace("_", " ")
        for mode, meaning in zip(values, meanings, strict=True)
        if mode in found
    }
