"""Failure tables: the control authority after every combination of failed actuators."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.controllability.actuators import ActuatorSet, actuator_set
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.judging import actuator_layout, judge_once_stopped, judge_only
from jaxsat.controllability.layout import TOLERANCE, Numbers
from jaxsat.controllability.rod_wording import rod_torques
from jaxsat.controllability.rods import RodSet, judge_with_rods
from jaxsat.controllability.wording import both_signs_by, lost_words
from jaxsat.core.text import csv_text, number_text

MOST_SUBSETS = 1 << 14
"""Largest number of subsets in a table."""


@dataclass(frozen=True, eq=False)
class FailureCase:
    """One subset of failed actuators.

    `judgement` is that of the remaining actuators; `lost` describes the authority that this failure
    removes. Failed wheels coast; `once_stopped` is the verdict after friction has stopped them,
    None if it is the same.
    """

    failed: tuple[str, ...]
    working: tuple[str, ...]
    judgement: Judgement
    lost: str
    once_stopped: str | None = None

    @property
    def directions(self) -> int:
        """Dimension of the torques of both signs available without brackets, 0 to 3.

        Torques of magnetorquers are those at an instant.
        """
        orbit = self.judgement.orbit
        across = 0 if orbit is None else min(orbit.rods, 2)
        return min(self.judgement.cone.two_sided + across, 3)


def failure_table(
    inertia: Numbers,
    actuators: Numbers | ActuatorSet,
    *,
    names: Sequence[str] | None = None,
    tolerance: float | int = TOLERANCE,
    most_failed: int | None = None,
    rods: RodSet | None = None,
) -> tuple[FailureCase, ...]:
    """Judge all subsets of failed actuators, magnetorquers included, fewest failures first.

    `inertia` (3,) or (3, 3) in kg m²; `actuators` an `ActuatorSet`, or torque axes (3, m) of both
    signs with `names` (default g1, g2, …); `rods` are the magnetorquers beside them. `most_failed`
    limits the number of failures, 2 for single and double ones. Brackets are computed once for the
    whole table. Raises ValueError as `analyse`, and for more than 14 actuators (16384 cases)
    without `most_failed`.
    """
    if not isinstance(actuators, ActuatorSet):
        actuators = actuator_set(actuators, two_sided=True, names=names)
    layout = actuator_layout(inertia, actuators)
    still, others = actuators.with_wheels_still, len(actuators.names)
    labels = actuators.names if rods is None else (*actuators.names, *rods.names)
    count = len(labels)
    most = count if most_failed is None else min(most_failed, count)
    if sum(math.comb(count, size) for size in range(most + 1)) > MOST_SUBSETS:
        raise ValueError(f"Argument `actuators` must be at most 14 for a table, but got {count}")
    cases = []
    for size in range(most + 1):
        for failed in itertools.combinations(range(count), size):
            working = tuple(i for i in range(count) if i not in failed)
            sound = tuple(i for i in working if i < others)
            rods_left = [i - others for i in working if i >= others]
            judgement = judge_only(layout, actuators, sound, tolerance)
            stopped_verdict = None
            if judgement.coasting:
                later = judge_only(layout, still, sound, tolerance)
                if np.any(actuators.rotors):  # the body then includes the locked rotors
                    later = judge_once_stopped(judgement, tolerance) or later
                if rods is not None:
                    later = judge_with_rods(later, rods, rods_left, tolerance)
                stopped_verdict = later.verdict
            if rods is not None:
                judgement = judge_with_rods(judgement, rods, rods_left, tolerance)
            cases.append(
                FailureCase(
                    failed=tuple(labels[i] for i in failed),
                    working=tuple(labels[i] for i in working),
                    judgement=judgement,
                    lost=lost_words(judgement),
                    once_stopped=None if stopped_verdict == judgement.verdict else stopped_verdict,
                )
            )
    return tuple(cases)


def torques_kind(judgement: Judgement) -> str:
    """Return the shape of the torque set, for magnetorquers at an instant."""
    return judgement.cone.kind if judgement.orbit is None else rod_torques(judgement.orbit)


_COLUMNS: Mapping[str, Callable[[FailureCase], str | int | float]] = {
    "failed": lambda case: " ".join(case.failed) or "none",
    "working": lambda case: " ".join(case.working) or "none",
    "rank": lambda case: case.judgement.rank,
    "dimension": lambda case: case.judgement.dimension,
    "verdict": lambda case: case.judgement.verdict,
    "margin": lambda case: case.judgement.margin,
    "turn_time_s": lambda case: case.judgement.turn_time,
    "directions": lambda case: case.directions,
    "torques": lambda case: torques_kind(case.judgement),
    "both_signs_by": lambda case: both_signs_by(case.judgement),
    "laws": lambda case: case.judgement.laws,
    "lost": lambda case: case.lost,
    "once_stopped": lambda case: case.once_stopped or case.judgement.verdict,
}
"""Columns of a table of failures, by name."""


def failure_records(cases: Sequence[FailureCase]) -> list[dict[str, str | int | float]]:
    """Return one flat dictionary per case, for tables, terminals and data sets."""
    return [{name: value(case) for name, value in _COLUMNS.items()} for case in cases]


def failure_arrays(cases: Sequence[FailureCase], names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return plain arrays with the case as first axis, for storage.

    `failed` (case, actuator) bool, `rank`, `dimension` and `directions` int, `controllable` and
    `borderline` bool, `margin` (dimensionless), `turn_time` (s), the others str.
    """
    records = failure_records(cases)
    columns = {name: np.array([one[name] for one in records]) for name in _COLUMNS}
    del columns["working"]
    columns["turn_time"] = columns.pop("turn_time_s")
    return columns | {
        "failed": np.array([[name in case.failed for name in names] for case in cases], bool),
        "controllable": np.array([case.judgement.controllable for case in cases]),
        "borderline": np.array([case.judgement.borderline for case in cases]),
    }


def failure_csv(cases: Sequence[FailureCase]) -> str:
    """Return the table as CSV text, full precision."""
    return csv_text([_COLUMNS, *(one.values() for one in failure_records(cases))])


def failure_markdown(cases: Sequence[FailureCase]) -> str:
    """Return the table as Markdown, margins and turn times to three digits."""
    records = failure_records(cases)
    lines = ["| " + " | ".join(_COLUMNS) + " |", "|" + "---|" * len(_COLUMNS)]
    for record in records:
        for column in ("margin", "turn_time_s"):
            record[column] = number_text(float(str(record[column])), 3)
        cells = [str(cell).replace("|", "\\|") for cell in record.values()]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
