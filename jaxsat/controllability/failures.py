"""Every failure case: which thrusters may fail, and what is lost."""

import csv
import io
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.authority import decided_turn_time
from jaxsat.controllability.decision import RankDecision, decide_rank
from jaxsat.controllability.layout import TOLERANCE, Numbers, make_layout

COLUMNS = (
    "failed",
    "working",
    "rank",
    "verdict",
    "margin",
    "turn_time_s",
    "directions",
    "lost",
)


@dataclass(frozen=True, eq=False)
class FailureCase:
    """One subset of failed thrusters.

    `verdict` is "controllable", "borderline" or "uncontrollable"; `turn_time` (s) is that of
    `jaxsat.controllability.turn_time` for thrusters of 1 N m; `directions` the dimension of the
    torques available without brackets (0 to 3); `lost` says in words what this failure takes away;
    `missing` spans the body torque directions that not even brackets reach.
    """

    failed: tuple[str, ...]
    working: tuple[str, ...]
    rank: int
    controllable: bool
    borderline: bool
    margin: float
    turn_time: float
    directions: int
    lost: str
    missing: Float[np.ndarray, "3 e"]

    @property
    def verdict(self) -> str:
        """One word for tables and colours."""
        if self.borderline:
            return "borderline"
        return "controllable" if self.controllable else "uncontrollable"


def _words(direction: Float[np.ndarray, "3"]) -> str:
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    k = int(np.argmax(direction))
    if direction[k] > 1.0 - 1e-9:
        return "xyz"[k]
    return "(" + ", ".join(f"{entry + 0.0:.2f}" for entry in direction) + ")"


def _lost(decision: RankDecision, directions: int) -> str:
    if decision.rank == 0:
        return "all control"
    if decision.rank == 2:
        return f"all but rotation about {_words(decision.reached[:, 0])}"
    if decision.rank == 5:
        return f"angular acceleration along torque {_words(decision.missing[:, 0])}"
    if directions == 3:
        return "nothing"
    if directions == 2:
        return "direct torque about one axis; reached through the drift"
    return "direct torque about two axes; small-time control"


def failure_table(
    inertia: Numbers,
    torque_axes: Numbers,
    *,
    names: Sequence[str] | None = None,
    tolerance: float | int = TOLERANCE,
) -> tuple[FailureCase, ...]:
    """All 2^m subsets of failed thrusters, fewest failures first.

    `inertia` (3,) or (3, 3) in kg m²; `torque_axes` (3, m); `names` of the thrusters (default g1,
    g2, …). Brackets are computed once for the whole table. Raises ValueError as `analyse`, and for
    more than 14 thrusters (16384 cases).
    """
    layout = make_layout(inertia, torque_axes, labels=names)
    count = len(layout.labels)
    if count > 14:
        raise ValueError(
            f"Argument `torque_axes` must have at most 14 columns for a table, but got {count}"
        )
    cases = []
    for size in range(count + 1):
        for failed in itertools.combinations(range(count), size):
            working = tuple(i for i in range(count) if i not in failed)
            decision = decide_rank(layout, working, tolerance)
            axes = layout.vectors[:, list(working)]
            values = np.linalg.svd(axes, compute_uv=False) if working else np.zeros(0)
            directions = int(np.sum(values > decision.tolerance))
            cases.append(
                FailureCase(
                    failed=tuple(layout.labels[i] for i in failed),
                    working=tuple(layout.labels[i] for i in working),
                    rank=decision.rank,
                    controllable=decision.controllable,
                    borderline=decision.borderline,
                    margin=decision.margin,
                    turn_time=decided_turn_time(
                        decision, layout.inertia, layout.torque_axes[:, list(working)]
                    ),
                    directions=directions,
                    lost=_lost(decision, directions),
                    missing=decision.missing,
                )
            )
    return tuple(cases)


def failure_records(cases: Sequence[FailureCase]) -> list[dict[str, str | int | float]]:
    """One flat dictionary a case, keys `COLUMNS`: rows for a table, a terminal or a data set."""
    return [
        {
            "failed": " ".join(case.failed) or "none",
            "working": " ".join(case.working) or "none",
            "rank": case.rank,
            "verdict": case.verdict,
            "margin": case.margin,
            "turn_time_s": case.turn_time,
            "directions": case.directions,
            "lost": case.lost,
        }
        for case in cases
    ]


def failure_arrays(cases: Sequence[FailureCase], names: Sequence[str]) -> dict[str, np.ndarray]:
    """Plain arrays with the case as first axis, for storage.

    `failed` (case, thruster) bool, `rank` int, `controllable` and `borderline` bool, `margin`
    (dimensionless), `turn_time` (s), `directions` int, `lost` str.
    """
    return {
        "failed": np.array([[name in case.failed for name in names] for case in cases], bool),
        "rank": np.array([case.rank for case in cases]),
        "controllable": np.array([case.controllable for case in cases]),
        "borderline": np.array([case.borderline for case in cases]),
        "margin": np.array([case.margin for case in cases]),
        "turn_time": np.array([case.turn_time for case in cases]),
        "directions": np.array([case.directions for case in cases]),
        "lost": np.array([case.lost for case in cases]),
    }


def failure_csv(cases: Sequence[FailureCase]) -> str:
    """The table as CSV text, full precision."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([record[name] for name in COLUMNS] for record in failure_records(cases))
    return text.getvalue()


def failure_markdown(cases: Sequence[FailureCase]) -> str:
    """The table as Markdown, margins and turn times to three digits."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for record in failure_records(cases):
        for column in ("margin", "turn_time_s"):
            record[column] = f"{record[column]:.3g}"
        cells = [str(record[column]).replace("|", "\\|") for column in COLUMNS]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
