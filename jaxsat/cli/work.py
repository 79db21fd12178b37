"""Large work is told before it starts, and refused without --yes."""

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.progress import tell
from jaxsat.cli.terminal import UserMistake, report

if TYPE_CHECKING:
    from jaxsat.montecarlo import Work

MOST_STEPS = 10**12
"""About a day of ten processors with the native engine; docs/scenarios.md names all three."""

MOST_MEMORY = 8 * 10**9
MOST_DISK = 20 * 10**9
LARGE = 100
"""Work within this factor of a limit is told in a line of its own."""


def approve(parts: "Iterable[Work]", target: Path, *, yes: bool, quiet: bool) -> None:
    """Tell what the parts take, one after the other; raises `UserMistake` for too much of it."""
    parts = list(parts)
    trajectories, steps, disk = (
        sum(getattr(part, name) for part in parts) for name in ("trajectories", "steps", "disk")
    )
    memory = max(part.memory for part in parts)
    text = (
        f"{trajectories:,} trajectories, {steps:,} steps, "
        f"about {_bytes(memory)} of memory and {_bytes(disk)} of disk"
    )
    tell(f"compiling; to do: {text}")
    excesses = [
        f"{name} above {limit}"
        for name, value, most, limit in (
            ("steps", steps, MOST_STEPS, f"{MOST_STEPS:,}"),
            ("memory", memory, MOST_MEMORY, _bytes(MOST_MEMORY)),
            ("disk", disk, MOST_DISK, _bytes(MOST_DISK)),
            ("disk", disk, _free(target), "what is free there"),
        )
        if value > most
    ]
    if excesses and not yes:
        raise UserMistake(f"too much work ({text}; {', '.join(excesses)}); give --yes to do it")
    near = (steps / MOST_STEPS, memory / MOST_MEMORY, disk / MOST_DISK)
    if not quiet and max(near) * LARGE > 1:
        report(f"to do: {text}")


def _free(target: Path) -> int | float:
    """Bytes that are free where a target will be; unlimited where nobody can tell."""
    for place in (target, *target.absolute().parents):
        try:
            return shutil.disk_usage(place).free
        except OSError:
            continue
    return float("inf")


def _bytes(number: int) -> str:
    for unit, size in (("TB", 10**12), ("GB", 10**9), ("MB", 10**6)):
        if number >= size:
            return f"{number / size:.3g} {unit}"
    return f"{-(-number // 1000)} kB"
