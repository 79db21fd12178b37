"""Progress of a command, on standard error from its first second on.

A live line on a terminal; elsewhere plain lines at increasing intervals.
"""

import importlib
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from jaxsat.core.text import clean

FIRST_DELAYS_S = 0.3, 0.8
"""Seconds before the first output, on a terminal and elsewhere: quick commands show nothing."""

REDRAW_INTERVAL_S = 0.1
"""Seconds between two drawings of the live line."""

MAX_INTERVAL_S = 60.0
"""Largest time (s) between two plain lines; up to then each comes after twice the time."""

ERASE = "\r\x1b[2K"
SPINNER = "|/-\\"


class _Display:
    """Thread that shows the text, at most one in a process."""

    def __init__(self, text: str):
        self.text = text
        self.lock = threading.RLock()
        self._live = _is_live()
        if self._live:  # here, as two threads that import parts of one package may fail
            importlib.import_module("rich.cells")
        self._shown = False
        self._begin = time.monotonic()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="jaxsat-progress", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Show nothing more, and erase the live line."""
        self._end.set()
        self._thread.join()
        self.erase()

    def erase(self) -> None:
        """Erase the live line until it is drawn again."""
        with self.lock:
            if self._shown:
                self._shown = False
                _write(ERASE)

    def _run(self) -> None:
        due = FIRST_DELAYS_S[0] if self._live else FIRST_DELAYS_S[1]
        drawing = 0
        while not self._end.wait(max(0.0, due - self._elapsed())):
            seconds = self._elapsed()
            with self.lock:
                if self._live:
                    self._draw(SPINNER[drawing % len(SPINNER)], seconds)
                else:
                    _write(f"jaxsat: {clean(self.text)} ({seconds:.0f} s)\n")
            drawing += 1
            due = seconds + (REDRAW_INTERVAL_S if self._live else until_next_line(seconds))

    def _draw(self, mark: str, seconds: float) -> None:
        from rich.cells import set_cell_size

        room = max(0, shutil.get_terminal_size().columns - 1)
        line = f"{mark} {clean(self.text)} ({seconds:.0f} s)"
        _write(ERASE + set_cell_size(line, room).rstrip())
        self._shown = True

    def _elapsed(self) -> float:
        return time.monotonic() - self._begin


def until_next_line(elapsed: float) -> float:
    """Return seconds from one plain line to the next."""
    return min(MAX_INTERVAL_S, max(1.0, elapsed))


_display: _Display | None = None


@contextmanager
def showing_progress(text: str) -> Iterator[None]:
    """Show progress inside the `with` block; `text` first."""
    global _display
    _display = _Display(text)
    try:
        yield
    finally:
        stop_progress()


def show_progress(text: str) -> None:
    """Show the current task of the command."""
    display = _display
    if display is not None:
        display.text = text


def stop_progress() -> None:
    """Stop showing progress, as for a quiet command."""
    global _display
    display, _display = _display, None
    if display is not None:
        display.stop()


@contextmanager
def between_drawings() -> Iterator[None]:
    """Remove the live line for other output inside the `with` block."""
    display = _display
    if display is None:
        yield
        return
    with display.lock:
        display.erase()
        yield


def _is_live() -> bool:
    try:
        return sys.stderr.isatty() and os.environ.get("TERM", "dumb") not in ("dumb", "unknown", "")
    except (AttributeError, ValueError):  # missing or closed
        return False


def _write(text: str) -> None:
    """Write to standard error, and ignore a closed one: progress is no reason to fail."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except (OSError, ValueError, AttributeError):
        pass
