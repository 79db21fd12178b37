"""What is called how in results: axes, the components along them, outcomes of cases."""

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
