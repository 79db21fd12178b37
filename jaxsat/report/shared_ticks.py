"""Axes whose ticks are drawn by one object, moved from place to place.

matplotlib makes an object with five artists for every tick, which takes longer than drawing it.
"""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick, XAxis, YAxis

ROUNDING = 1e-10
"""By what part of an axis a tick may be beyond its end."""


class _Place:
    """Where a tick is drawn, and its number: in place of a tick for what draws and measures it."""

    def __init__(self, tick: Tick, at: float, text: str, last: list["_Place | None"]):
        self._tick, self._at, self._text, self._last = tick, at, text, last

    def _moved(self) -> Tick:
        """The tick, here; `last` is where it was put last."""
        if self._last[0] is not self:
            self._tick.update_position(self._at)
            self._tick.label1.set_text(self._text)
            self._tick.label2.set_text(self._text)
            self._last[0] = self
        return self._tick

    @property
    def label1(self) -> Any:
        """The number on the usual side."""
        return self._moved().label1

    @property
    def label2(self) -> Any:
        """The number on the other side."""
        return self._moved().label2 if self._tick.label2.get_visible() else self._tick.label2

    def draw(self, renderer: Any) -> None:
        """Draw the tick, with what belongs to it."""
        self._moved().draw(renderer)


class _SharedTicks(Axis):
    """An axis that draws one tick in many places."""

    def _update_ticks(self) -> list[Any]:
        """What is drawn of the ticks; matplotlib calls this before it draws or measures them."""
        first, last = np.sort(self.get_transform().transform(self.get_view_interval()))
        room = ROUNDING * (last - first)
        places = []
        kinds: Any = (  # of ticks, whose objects are made where there are some
            (self.get_majorticklocs(), self.major.formatter, lambda: self.majorTicks),
            (self.get_minorticklocs(), self.minor.formatter, lambda: self.minorTicks),
        )
        for given, formatter, ticks in kinds:
            locations = np.asarray(given, float)
            if not len(locations):
                continue
            texts, tick = formatter.format_ticks(locations), ticks()[0]
            there = self.get_transform().transform(locations)
            shown = (there >= first - room) & (there <= last + room)
            before: list[_Place | None] = [None]
            places += [
                _Place(tick, at, text, before)
                for at, text, inside in zip(locations, texts, shown, strict=True)
                if inside
            ]
        return places

    def get_majorticklabels(self) -> list[Any]:
        """The numbers at the ticks, an object each."""
        Axis._update_ticks(self)  # pyright: ignore[reportAttributeAccessIssue]
        return super().get_majorticklabels()

    def get_minorticklabels(self) -> list[Any]:
        """Those at the small ticks."""
        Axis._update_ticks(self)  # pyright: ignore[reportAttributeAccessIssue]
        return super().get_minorticklabels()


class _X(_SharedTicks, XAxis):
    """The horizontal axis."""


class _Y(_SharedTicks, YAxis):
    """The vertical axis."""


class SharedTicksAxes(Axes):
    """A panel, drawn as `matplotlib.axes.Axes` draws it."""

    def _init_axis(self) -> None:
        self.xaxis, self.yaxis = _X(self, clear=False), _Y(self, clear=False)
        for spines, axis in (("bottom", "top"), self.xaxis), (("left", "right"), self.yaxis):
            for name in spines:
                self.spines[name].register_axis(axis)
