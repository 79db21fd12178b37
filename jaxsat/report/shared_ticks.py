"""Axes with one tick object that is drawn at many locations.

Matplotlib makes an object with five artists for every tick, which takes longer than drawing it.
"""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick, XAxis, XTick, YAxis
from matplotlib.text import Text

ROUNDING = 1e-10
"""Fraction of an axis by which a tick may be beyond its end."""


class _Place:
    """Location and number of a tick, in place of a tick object.

    The first one has the `locations` of all, and draws grid lines and marks of all ticks, each as
    one line.
    """

    def __init__(self, tick: Tick, at: float, text: str, locations: np.ndarray | None):
        self._tick, self._at, self._text, self._locations = tick, at, text, locations

    @property
    def label1(self) -> Any:
        """Number on the usual side."""
        return self._move(self._tick.label1)

    @property
    def label2(self) -> Any:
        """Number on the other side."""
        return self._move(self._tick.label2)

    def _move(self, label: Text) -> Text:
        if label.get_visible():
            (label.set_x if isinstance(self._tick, XTick) else label.set_y)(self._at)
            label.set_text(self._text)
        return label

    def draw(self, renderer: Any) -> None:
        """Draw the number, and in the first place the lines of all ticks."""
        if self._locations is not None:
            self._draw_lines(renderer, self._locations)
        self.label1.draw(renderer)
        self.label2.draw(renderer)

    def _draw_lines(self, renderer: Any, locations: np.ndarray) -> None:
        tick, grid = self._tick, self._tick.gridline
        alone = grid.get_data()
        across, along = np.tile([0.0, 1.0, np.nan], len(locations)), np.repeat(locations, 3)
        grid.set_data(*((along, across) if isinstance(tick, XTick) else (across, along)))
        for mark in (tick.tick1line, tick.tick2line):
            (mark.set_xdata if isinstance(tick, XTick) else mark.set_ydata)(locations)
        for line in (grid, tick.tick1line, tick.tick2line):
            line.draw(renderer)
        grid.set_data(*alone)


class _SharedTicks(Axis):
    """An axis that draws one tick at many locations."""

    def _update_ticks(self) -> list[Any]:
        """Return the ticks to draw; matplotlib calls this before it draws or measures them."""
        first, last = np.sort(self.get_transform().transform(self.get_view_interval()))
        room = ROUNDING * (last - first)
        places = []
        kinds: Any = (  # of ticks, whose objects are made where there are some
            (self.get_majorticklocs(), self.major.formatter, lambda: self.majorTicks),
            (self.get_minorticklocs(), self.minor.formatter, lambda: self.minorTicks),
        )
        for tick_locations, formatter, ticks in kinds:
            locations = np.asarray(tick_locations, float)
            if not len(locations):
                continue
            texts, tick = formatter.format_ticks(locations), ticks()[0]
            positions = self.get_transform().transform(locations)
            visible = np.flatnonzero((positions >= first - room) & (positions <= last + room))
            places += [
                _Place(tick, locations[one], texts[one], locations[visible] if not number else None)
                for number, one in enumerate(visible)
            ]
        return places

    _is_drawn = False

    def draw(self, renderer: Any) -> None:
        """Draw the axis; numbers are measured only where something is placed by them."""
        self._is_drawn = True
        super().draw(renderer)
        self._is_drawn = False

    def _get_ticklabel_bboxes(self, ticks: list[Any], renderer: Any) -> tuple[list[Any], list[Any]]:
        """Return the boxes of the numbers at the ticks."""
        axis: Any = self
        followed = axis._autolabelpos and axis.label.get_text()
        if self._is_drawn and not (followed or axis.major.formatter.get_offset()):
            return [], []
        return Axis._get_ticklabel_bboxes(axis, ticks, renderer)  # pyright: ignore[reportAttributeAccessIssue]

    def get_majorticklabels(self) -> list[Any]:
        """Return the numbers at the ticks, an object each."""
        Axis._update_ticks(self)  # pyright: ignore[reportAttributeAccessIssue]
        return super().get_majorticklabels()

    def get_minorticklabels(self) -> list[Any]:
        """Return the numbers at the minor ticks, an object each."""
        Axis._update_ticks(self)  # pyright: ignore[reportAttributeAccessIssue]
        return super().get_minorticklabels()


class _X(_SharedTicks, XAxis):
    """Horizontal axis."""


class _Y(_SharedTicks, YAxis):
    """Vertical axis."""


class SharedTicksAxes(Axes):
    """A panel, drawn as `matplotlib.axes.Axes` draws it."""

    def _init_axis(self) -> None:
        self.xaxis, self.yaxis = _X(self, clear=False), _Y(self, clear=False)
        for spines, axis in (("bottom", "top"), self.xaxis), (("left", "right"), self.yaxis):
            for name in spines:
                self.spines[name].register_axis(axis)
