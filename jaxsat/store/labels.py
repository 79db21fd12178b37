"""What is called how in results: axes, the components along them, outcomes of cases."""

import tomllib
from collections.abc import Sequence
from typing import Any

AXES: dict[str, tuple[str, ...]] = {
    "body_axis": ("x", "y", "z"),
    "driven_axis": ("x", "y"),
    "w_component": ("w1", "w2"),
    "quaternion_component": ("q0", "q1", "q2", "q3"),
    "euler_axis": ("roll", "pitch", "yaw"),
    "product_of_inertia": ("xy", "xz", "yz"),
}
"""By axis; the components along any other one are numbered from 1."""


PARTS = ("thruster", "wheel", "magnetorquer", "gimbal")
"""The axes along which actuators stand, by their kind in a scenario."""

SETTLED, UNSETTLED = "settled", "unsettled"
"""How a case that reached its end is called; any other is called by its failure."""


def flags_of(column: Any) -> tuple[str, ...]:
    """What the codes of a column stand for, from 0 on; empty for one that has none.

    The column is one of `open_study` or of `study_columns`, or a plain array, which has none.
    """
    if hasattr(column, "column"):
        return column.column.flags
    meanings = getattr(column, "attrs", {}).get("flag_meanings", "")
    return tuple(meaning.replace("_", " ") for meaning in meanings.split())


def components(axis: str, count: int) -> tuple[str, ...]:
    """The names of the `count` components along an axis."""
    return AXES.get(axis, tuple(str(number + 1) for number in range(count)))


def part_names(scenario: str, kind: str, count: int) -> list[str]:
    """Names, or numbers from 1, of `count` thrusters, wheels or magnetorquers of a scenario (TOML).

    A two-sided thruster has two places, `NAME+` and `NAME-`. Those that failed before the start are
    left out where the others are as many as asked for.
    """
    tables = tomllib.loads(scenario).get(kind, [])
    parts = [
        (one.get("name", str(number)), bool(one.get("failed")))
        for number, one in enumerate(tables, 1)
        for _ in range(2 if one.get("two_sided") else 1)
    ]
    for named in ([name for name, _ in parts], [name for name, failed in parts if not failed]):
        if len(named) == count:
            return distinct(named)
    return [str(number + 1) for number in range(count)]


def distinct(names: Sequence[str]) -> list[str]:
    """Names of which one that stands twice, for both ways of a part, is told with + and -."""
    return [
        name if names.count(name) == 1 else name + ("-" if name in names[:place] else "+")
        for place, name in enumerate(names)
    ]
