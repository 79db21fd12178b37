"""Estimate of the work, printed before it starts; too much is refused without --yes."""

import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import UserMistake, print_stderr

if TYPE_CHECKING:
    from jaxsat.studies.work import Work

MAX_STEPS = 10**12
"""About a day of ten processors with the native engine; docs/scenarios.md lists all limits."""

MAX_MEMORY = 8 * 10**9
MAX_DISK = 20 * 10**9
MAX_FILES = 10**6
REPORT_FACTOR = 100
"""Ratio of limit to work below which the work is printed on a line of its own."""


def require_approval(parts: "Iterable[Work]", target: Path, *, yes: bool, quiet: bool) -> None:
    """Show the total work of consecutive parts; raises `UserMistake` for too much of it."""
    parts = list(parts)
    trajectories, steps, disk, files = (
        sum(getattr(part, name) for part in parts)
        for name in ("trajectories", "steps", "disk", "files")
    )
    memory = max(part.memory for part in parts)
    text = (
        f"{trajectories:,} trajectories, {steps:,} steps, "
        f"about {_bytes(memory)} of memory and {_bytes(disk)} of disk in {files:,} files"
    )
    show_progress(f"compiling; work: {text}")
    excesses = [
        f"{name} above {limit}"
        for name, value, most, limit in (
            ("steps", steps, MAX_STEPS, f"{MAX_STEPS:,}"),
            ("memory", memory, MAX_MEMORY, _bytes(MAX_MEMORY)),
            ("disk", disk, MAX_DISK, _bytes(MAX_DISK)),
            ("disk", disk, _free(target), "the free disk space"),
            ("files", files, MAX_FILES, f"{MAX_FILES:,} (larger chunks make fewer)"),
            ("files", files, _free_files(target), "what the disk has room for"),
        )
        if value > most
    ]
    if excesses and not yes:
        raise UserMistake(f"too much work ({text}; {', '.join(excesses)}); give --yes to do it")
    near = (steps / MAX_STEPS, memory / MAX_MEMORY, disk / MAX_DISK, files / MAX_FILES)
    if not quiet and max(near) * REPORT_FACTOR > 1:
        print_stderr(f"work: {text}")


def _free(target: Path) -> int | float:
    """Return free bytes at a target's place; infinite where unknown."""
    for place in (target, *target.absolute().parents):
        try:
            return shutil.disk_usage(place).free
        except OSError:
            continue
    return float("inf")


def _free_files(target: Path) -> int | float:
    """Return the number of files that a target's place can still take; infinite where unknown."""
    for place in (target, *target.absolute().parents):
        try:
            status = os.statvfs(place)
        except (OSError, AttributeError):  # a missing place; not on Windows
            continue
        return status.f_favail if status.f_files else float("inf")
    return float("inf")


def _bytes(number: int) -> str:
    for unit, size in (("TB", 10**12), ("GB", 10**9), ("MB", 10**6)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{-(-number // 1000)} kB"
