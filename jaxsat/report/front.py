"""Documents and figure of least times and efforts, from the records of `bound` and `front`."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jaxsat.core.text import number_text
from jaxsat.report.comparison_document import ENDS
from jaxsat.report.document import Cell, Document, Facts, Table, Verdict
from jaxsat.report.saving import save_figures
from jaxsat.report.style import MARKERS, STYLES, escape_mathematics, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = {"time": "s", "effort": "N m s"}


def bound_document(title: str, record: Mapping[str, Any]) -> Document:
    """Return the document of the best manoeuvre, its verification, and the other local optima."""
    flight, value = record["flown_again"], number_text(record["value"])
    unit = UNITS[record["objective"]]
    where = f"{flight['angle']:.1e} rad and {flight['rate']:.1e} rad/s from rest in the orbit frame"
    if record["target"] == "rates":
        where = f"with {flight['rate']:.1e} rad/s"
    elif record["end"] == "settled":
        tilt, turn, rate = (number_text(flight[one], 3) for one in ("tilt", "turn", "rate"))
        where = f"at {tilt} rad of tilt, {turn} rad of turn and {rate} rad/s"
    optima = ", ".join(map(number_text, record["local_optima"]))
    facts = {
        "duration": f"{number_text(record['duration_s'])} s",
        "effort": f"{number_text(flight['effort'])} N m s",
        "end": record["end_meaning"],
        "independent verification": f"ends {where}",
        "local optima": f"{optima} {unit}, of {record['starts']} starts",
    }
    text = f"Least {record['objective']}: {value} {unit}, not certified."
    return Document(title, Verdict(None, text), [Facts("Best found", facts)])


WIDTH, HEIGHT, MOST_COLUMNS = 3.4, 3.0, 3

TIME_TICKS = (1, 1.5, 2, 3, 5, 8)
"""Ticks per decade; a front seldom covers a whole decade."""


def write_front(write: Callable[[str, str | bytes], Any], title: str, record: Mapping[str, Any]):
    """Pass record and figure to `write`, which takes a file name and the content."""
    write("front.json", json.dumps(record, indent=1, allow_nan=False) + "\n")
    heading = f"{title}: time against effort"
    save_figures({"front": lambda: front_figure(record["fronts"], heading)}, write)


def front_document(title: str, record: Mapping[str, Any]) -> Document:
    """Return the document of the front under every torque limit, with the laws beside it."""
    rows = [row for front in record["fronts"] for row in _rows(front)]
    columns = ["N m", "by", "time (s)", "effort (N m s)"]
    text = f"Plans end {record['end_meaning']}; laws where they settle."
    note = "Plans are local optima, not certified."
    table = Table("Least effort within a time", columns, rows, note)
    return Document(f"{title}: time against effort", Verdict(None, text), [table])


def _rows(front: Mapping[str, Any]) -> Iterator[Sequence[Cell]]:
    limit = front["torque_limit_N_m"]
    for one in front["front"]:
        yield [limit, "plan", one["duration_s"], one["effort_N_m_s"]]
    for duration in front["failed_durations_s"]:
        yield [limit, "no plan", duration, None]
    for one in front["laws"]:
        settles = one["settled_from_s"] is not None
        by = one["law"] if settles else f"{one['law']}, which does not settle"
        yield [limit, by, one["settled_from_s"], one["effort_N_m_s"]]


def front_figure(fronts: Sequence[dict[str, Any]], title: str) -> "Figure":
    """Plot a panel for each front, the data of `jaxsat.synthesis.comparison.Front.as_data`.

    Left of the front's first point no plan reaches the target; below the line none is known.
    """
    columns = min(len(fronts), MOST_COLUMNS)
    rows = -(-len(fronts) // columns)
    names = list(dict.fromkeys(one["law"] for front in fronts for one in front["laws"]))
    size = (max(5.5, WIDTH * columns + 0.6), HEIGHT * rows + 0.7)
    figure, axes = panels(title, size, rows, columns)
    each = [axis for row in axes for axis in row]
    for axis, front in zip(each, fronts, strict=False):
        _draw(axis, front, names)
    for axis in each[len(fronts) :]:
        axis.set_visible(False)
    for row in axes:
        row[0].set_ylabel("effort (N m s)")
    handles = [zip(*axis.get_legend_handles_labels(), strict=True) for axis in each[: len(fronts)]]
    lines = {label: handle for pairs in handles for handle, label in pairs}
    figure.legend([*lines.values()], [*lines], loc="outside lower center", ncols=min(4, len(lines)))
    return figure


def _draw(axis: "Axes", front: dict[str, Any], names: Sequence[str]) -> None:
    times = [one["duration_s"] for one in front["front"]]
    efforts = [one["effort_N_m_s"] for one in front["front"]]
    style = {**STYLES[0], "marker": "o", "markersize": 2.5}
    axis.plot(
        times, efforts, label=f"least effort within the time, until {ENDS[front['end']]}", **style
    )
    colors = [line["color"] for line in STYLES[1:]]
    settled = [one for one in front["laws"] if one["settled_from_s"] is not None]
    for one in settled:
        number = names.index(one["law"])
        point: dict[str, Any] = {"color": colors[number % len(colors)], "markersize": 8}
        point |= {"marker": MARKERS[1 + number % (len(MARKERS) - 1)], "linestyle": "none"}
        name = escape_mathematics(one["law"])
        axis.plot(one["settled_from_s"], one["effort_N_m_s"], label=f"law {name}", **point)
    all_times = [*times, *(one["settled_from_s"] for one in settled)]
    all_efforts = [*efforts, *(one["effort_N_m_s"] for one in settled)]
    axis.set_title(f"{front['torque_limit_N_m']:g} N m", fontsize=8, loc="left")
    settles = front["end"] == "settled"
    axis.set_xlabel("time until settled (s)" if settles else "time until rest, laws settled (s)")
    axis.set_xscale("log")
    if all_times:
        first, last = 0.85 * min(all_times), 1.15 * max(all_times)
        axis.set_xlim(first, last)
        axis.set_ylim(0, 1.08 * max(all_efforts))
        ticks = [base * 10**power for power in range(-2, 7) for base in TIME_TICKS]
        visible_ticks = [tick for tick in ticks if first <= tick <= last]
        axis.set_xticks(visible_ticks, [f"{tick:g}" for tick in visible_ticks])
        axis.minorticks_off()
        axis.axvspan(first, min(times, default=first), color="#dddddd", linewidth=0)
