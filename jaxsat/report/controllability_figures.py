"""Figures of the controllability analysis.

Lightness alone carries the values (cividis), the uncontrollable set is hatched or outlined, so the
figures read in grey and with any colour vision.
"""

import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib.tri as mtri
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.controllability.actuators import ActuatorSet
from jaxsat.controllability.cone import TorqueCone
from jaxsat.report.figure_painter import paint
from jaxsat.report.plot import TIME, Axis, Line, Plot
from jaxsat.report.style import NotebookFigure, escape_mathematics

_MOST_ROWS = 48  # of a chart of failures

_FLOOR = 1e-3  # margins below share the darkest shade
_MARK = "#d55e00"


def _shades(figure: Figure, axes, image) -> None:
    bar = figure.colorbar(image, ax=axes, extend="min", shrink=0.85)
    bar.set_label("controllability margin (smallest singular value)")


def _norm(margins: Float[np.ndarray, "..."]) -> LogNorm:
    return LogNorm(_FLOOR, max(float(np.max(margins)), 10 * _FLOOR))


def inertia_map(
    points: Float[np.ndarray, "n 2"],
    margins: Float[np.ndarray, " n"],
    *,
    spacecraft: Float[np.ndarray, "3"] | None = None,
    title: str = "Margin over all bodies",
) -> Figure:
    """Plot margins over the triangle of physical inertias (`physical_inertias` gives `points`).

    The uncontrollable set (margin 0 to rounding, or between grid points) is darkest; points at
    exactly zero are outlined in orange. `spacecraft` (3,) marks moments of inertia.
    """
    figure = NotebookFigure(figsize=(7.0, 5.6), layout="constrained")
    axes = figure.add_subplot()
    mesh = mtri.Triangulation(points[:, 0], points[:, 1])
    levels = np.maximum(margins, _FLOOR)
    image = axes.tripcolor(
        mesh, levels, shading="gouraud", cmap="cividis", norm=_norm(levels), rasterized=True
    )
    zero = margins <= 1e-9
    if np.any(zero):
        axes.plot(*points[zero].T, ".", color=_MARK, ms=2.5, label="uncontrollable")
    height = np.sqrt(0.75)
    axes.plot([0, 1, 0.5, 0], [0, 0, height, 0], "k-", lw=1)
    for start, end, text in (
        ((0.5, 0.0), (0.5, height), "$J_1 = J_2$"),
        ((0.75, height / 2), (0.0, 0.0), "$J_2 = J_3$"),
        ((0.25, height / 2), (1.0, 0.0), "$J_1 = J_3$"),
    ):
        axes.plot(*np.transpose([start, end]), "w:", lw=1)
        outward = np.subtract(start, [0.5, height / 3])
        x, y = np.add(start, 0.1 * outward / np.linalg.norm(outward))
        axes.annotate(text, (x, y), ha="center", va="center")
    for corner, text in (((0, 0), "rod along x"), ((1, 0), "rod along y")):
        axes.annotate(text, (corner[0], -0.07), ha="center", va="center")
    axes.annotate("rod along z", (0.5, height + 0.05), ha="center", va="center")
    if spacecraft is not None:
        moments = np.asarray(spacecraft, dtype=float)
        second = 1.0 - 2.0 * moments / moments.sum()
        place = second @ np.array([[0.0, 0.0], [1.0, 0.0], [0.5, height]])
        axes.plot(*place, "D", mfc="white", mec="black", ms=7, ls="none", label="this spacecraft")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", frameon=False)
    axes.set_aspect("equal")
    axes.set_xlim(-0.12, 1.12)
    axes.set_ylim(-0.13, height + 0.1)
    axes.set_axis_off()
    axes.set_title(f"{escape_mathematics(title)}\nedges: flat plates, centre: sphere")
    _shades(figure, axes, image)
    return figure


def _direction_map(
    azimuths: Float[np.ndarray, " a"],
    elevations: Float[np.ndarray, " e"],
    values: Float[np.ndarray, "e a"],
    direction: str,
    title: str,
    **look: Any,
) -> tuple[Figure, Axes, QuadMesh]:
    """Draw values over azimuth and elevation (rad in, degrees drawn) of a `direction`."""
    figure = NotebookFigure(figsize=(7.5, 4.4), layout="constrained")
    axes = figure.add_subplot()
    degrees = np.degrees(azimuths), np.degrees(elevations)
    image = axes.pcolormesh(*degrees, values, shading="nearest", rasterized=True, **look)
    axes.set_xlabel(f"azimuth of the {direction} (deg, body x towards y)")
    axes.set_ylabel("elevation (deg, towards z)")
    axes.set_xticks(np.arange(-180, 181, 60))
    axes.set_yticks(np.arange(-90, 91, 30))
    axes.set_title(escape_mathematics(title))
    return figure, axes, image


def angle_map(
    azimuths: Float[np.ndarray, " a"],
    elevations: Float[np.ndarray, " e"],
    margins: Float[np.ndarray, "e a"],
    *,
    uncontrollable: Sequence[Float[np.ndarray, "_ 2"]] = (),
    title: str = "Margin over thruster directions",
) -> Figure:
    """Plot margins over azimuth and elevation (rad in, degrees drawn).

    `uncontrollable` are curves or points (azimuth, elevation) in rad, drawn over the map.
    """
    levels = np.maximum(margins, _FLOOR)
    look = {"cmap": "cividis", "norm": _norm(levels)}
    figure, axes, image = _direction_map(azimuths, elevations, levels, "torque axis", title, **look)
    for k, curve in enumerate(uncontrollable):
        degrees = np.degrees(curve).T
        style = {"ls": "none", "marker": "o", "mfc": "none", "ms": 7} if len(curve) == 1 else {}
        # No line across the map where a curve leaves at 180 degrees or passes a pole.
        if len(curve) > 1:
            jump = np.abs(np.diff(degrees[0])) > 60
            degrees = np.insert(degrees, np.flatnonzero(jump) + 1, np.nan, axis=1)
        label = "uncontrollable" if k == 0 else None
        axes.plot(*degrees, color=_MARK, lw=1.2, label=label, **style)
    if uncontrollable:
        axes.legend(loc="upper right", framealpha=0.9)
    _shades(figure, axes, image)
    return figure


def failure_chart(records: Sequence[dict]) -> Figure:
    """Plot margins of every failure case as bars (`failure_records` gives `records`).

    Hatching distinguishes the verdicts, a cross marks uncontrollable cases, so no colour is needed.
    """
    first_records, count = records[:_MOST_ROWS], len(records)
    texts = [textwrap.fill(f"rank {one['rank']}: lost {one['lost']}", 72) for one in first_records]
    wide = any("\n" in text for text in texts)
    figure = NotebookFigure(
        figsize=(10 if wide else 7.5, 1.2 + 0.32 * len(first_records)), layout="constrained"
    )
    axes = figure.add_subplot()
    rows = np.arange(len(first_records))
    looks = {
        "controllable": ("#0072b2", ""),
        "controllable, by no law": ("#56b4e9", "///"),
        "by drift": ("#56b4e9", "..."),
        "some attitudes": ("#f0f0f0", "\\\\\\"),
        "not decided": ("#f0f0f0", "xxx"),
        "borderline": ("#e8c468", "///"),
        "uncontrollable": ("none", ""),
    }
    verdicts = [one["verdict"] for one in first_records]
    unflown = [not FLYABLE[one["laws"]].everywhere for one in first_records]
    verdicts = [
        f"{one}, by no law" if one == "controllable" and none else one
        for one, none in zip(verdicts, unflown, strict=True)
    ]
    for verdict, (colour, hatch) in looks.items():
        places = [k for k, one in enumerate(verdicts) if one == verdict]
        widths = [float(first_records[k]["margin"]) for k in places]
        if places and verdict != "uncontrollable":
            axes.barh(places, widths, color=colour, hatch=hatch, edgecolor="k", label=verdict)
        elif places:
            axes.plot(np.zeros(len(places)), places, "x", color=_MARK, ms=8, mew=2, label=verdict)
    for row, record, text in zip(rows, first_records, texts, strict=True):
        bar = 0.0 if record["verdict"] == "uncontrollable" else float(record["margin"])
        axes.annotate(
            text, (bar, row), xytext=(8, 0), textcoords="offset points", va="center", fontsize=8
        )
    axes.set_yticks(rows, [f"failed: {record['failed']}" for record in first_records])
    axes.invert_yaxis()
    margins = [float(one["margin"]) for one in first_records if one["verdict"] != "uncontrollable"]
    largest = max(margins, default=0.0) or 1.0
    axes.set_xlim(-0.03 * largest, (3.0 if wide else 2.0) * largest)
    if count > len(first_records):
        axes.set_title(f"The first {len(first_records)} of {count} cases")
    ticks = MaxNLocator(5).tick_values(0.0, largest)
    axes.set_xticks([one for one in ticks if one <= 1.25 * largest])
    by_rods = any("magnetorquers" in record["both_signs_by"] for record in first_records)
    remark = "; of magnetorquers: least / largest, over an orbit" if by_rods else ""
    axes.set_xlabel(f"controllability margin (smallest singular value{remark})")
    axes.legend(loc="lower right", frameon=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def torque_map(cone: TorqueCone, actuators: ActuatorSet, *, without: Sequence[str] = ()) -> Figure:
    """Plot the angle from every direction of torque to the nearest attainable torque.

    It is zero inside the cone of the actuators; thrusters, wheels (both ends of their axes) and the
    direction farthest from all torques are marked. The title names actuators that the cone is
    `without`.
    """
    azimuths, elevations = np.linspace(-np.pi, np.pi, 91), np.linspace(-np.pi / 2, np.pi / 2, 46)
    angles = [
        [
            cone.angle(np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]))
            for a in azimuths
        ]
        for e in elevations
    ]
    values = np.degrees(angles)
    title = ", ".join(["Attainable torques", *(f"without {one}" for one in without)])
    title = f"{title}: {cone.kind}"
    look = {"cmap": "cividis_r", "vmin": 0, "vmax": max(90.0, float(np.max(values)))}
    figure, axes, image = _direction_map(azimuths, elevations, values, "torque", title, **look)
    pushes = [actuators.torques, -actuators.torques[:, actuators.two_sided]]
    wheels = [actuators.wheel_axes, -actuators.wheel_axes]
    worst = [] if cone.opposed is None else [cone.opposed[:, None]]
    for columns, marker, label in (
        (pushes, "o", "thruster"),
        (wheels, "s", "wheel"),
        (worst, "X", "farthest from all torques"),
    ):
        vectors = np.concatenate([np.zeros((3, 0)), *columns], axis=1)
        vectors = vectors[:, np.any(vectors != 0, axis=0)]
        if vectors.shape[1]:
            x, y, z = vectors / np.linalg.norm(vectors, axis=0)
            places = np.degrees([np.arctan2(y, x), np.arcsin(np.clip(z, -1, 1))])
            axes.plot(*places, marker, ls="none", mfc="w", mec=_MARK, mew=1.5, ms=8, label=label)
    axes.legend(loc="upper right", framealpha=0.9)
    bar = figure.colorbar(image, ax=axes, shrink=0.85)
    bar.set_label("angle to the nearest attainable torque (deg)")
    return figure


def recurrence_chart(
    times: Float[np.ndarray, " n"], distances: Float[np.ndarray, " n"], radius: float
) -> Figure:
    """Plot the distance from the start against time, with the neighbourhood of the start.

    `times` in s; `distances` and `radius` as `recurrence` defines them (dimensionless).
    """
    lines = [
        Line(times, np.maximum(distances, 1e-6), "of the free body"),
        Line(times[[0, -1]], np.full(2, radius), f"neighbourhood, {radius:g}"),
    ]
    distance = Axis("distance from the start", "1", log=True)
    return paint([Plot("Distance", "", TIME, distance, lines)], "Recurrence of the free body", 3.0)


def energy_chart(
    times: Float[np.ndarray, " n"],
    energies: Float[np.ndarray, " n"],
    claimed: float,
    bound: Float[np.ndarray, " n"],
) -> Figure:
    """Plot rotational energy (J) against the claimed bound (18) and the one that holds."""
    lines = [
        Line(times, energies, "energy under T_d"),
        Line(times[[0, -1]], np.full(2, claimed), "claim (18): C + Σ a_i"),
        Line(times, bound, "bound that holds"),
    ]
    top, low = max(claimed, float(energies.max())), min(claimed, float(energies.min()))
    limits = (low - 0.1 * (top - low), top + 0.6 * (top - low))
    energy = Axis("rotational energy", "J", limits=limits)
    return paint([Plot("Energy", "", TIME, energy, lines)], "Energy of a spin, and claim (18)", 3.0)
