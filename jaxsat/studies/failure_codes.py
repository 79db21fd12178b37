"""Codes of failures and of verdicts on them, as they stand in a store."""

import enum

from jaxsat.control.diagnosis import DiagnosedKind
from jaxsat.spacecraft import FailureKind
from jaxsat.spacecraft.wheel_failures import WheelFailureKind

NEVER = 0
"""The code of a failure that does not strike within the horizon, and of no verdict."""


def words(kinds: type[enum.IntEnum], before: str = "") -> tuple[str, ...]:
    """The names of an enumeration as words."""
    return tuple(before + kind.name.lower().replace("_", " ") for kind in kinds)


FAILURES = ("none", *words(FailureKind), *words(WheelFailureKind, "wheel "))
"""What the codes of `failure_kind` stand for."""

DIAGNOSED = ("none", *words(DiagnosedKind))
"""What the codes of `isolated_kind` stand for."""

AMOUNTLESS = ("none", "dead", "stuck on", "turned", "reversed", "wheel dead", "wheel stopped",
              "wheel runaway")  # fmt: skip
"""Failures that have no amount."""

HYPOTHESES = {
    1 + kind: 1 + DiagnosedKind[kind.name]
    for kind in FailureKind
    if kind.name in DiagnosedKind.__members__
} | {
    1 + len(FailureKind) + kind: 1 + verdict
    for kind, verdict in (
        (WheelFailureKind.DEAD, DiagnosedKind.DEAD),
        (WheelFailureKind.DEGRADED, DiagnosedKind.DEGRADED),
        (WheelFailureKind.STOPPED, DiagnosedKind.STOPPED),
        (WheelFailureKind.FRICTION_BY, DiagnosedKind.FRICTION_UP),
        (WheelFailureKind.FRICTION_TO, DiagnosedKind.FRICTION_UP),
        (WheelFailureKind.RUNAWAY, DiagnosedKind.RUNAWAY),
    )
}
"""The verdict that is right for a failure of a thruster or wheel, where there is one."""
